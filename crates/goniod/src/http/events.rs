use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{self, KeepAlive, Sse};
use futures_util::stream::{self, Stream};
use serde::{Deserialize, Serialize};
use tokio::sync::{OwnedSemaphorePermit, watch};
use tokio::time::{Instant, sleep_until};
use utoipa::IntoParams;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::keys::Asked;
use super::metrics::Open;
use super::problem::Problem;
use super::shared::Shared;
use crate::event::TOLD;
use crate::{Event, Events, RigView};

/// Pictures of the rig are sent at most so often; an eye does not follow more.
const PICTURE_EVERY: Duration = Duration::from_millis(50);
/// A quiet stream says so often that it lives, so that either side notices when the other is gone.
const KEEP_ALIVE: Duration = Duration::from_secs(10);
/// Events that are told of what happened, unless said otherwise.
const LOGGED: usize = 60;

pub(crate) fn routes() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(events)).routes(routes!(log))
}

/// Where to go on.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
struct After {
    /// Events after this id; the header Last-Event-ID outranks it. Without either, events from now on.
    after: Option<u64>,
}

/// How much to tell.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
struct Most {
    /// At most so many events, the latest; 60 unless given.
    #[param(minimum = 1, maximum = 100)]
    limit: Option<usize>,
}

/// What happened: the latest events that whoever comes later wants to know of, oldest first.
///
/// Those of jobs, poses measured again, warnings, faults and acknowledgements, since the daemon was started.
#[utoipa::path(get, path = "/log", tag = "events", params(Most), responses((status = 200, body = Vec<Event>)))]
async fn log(
    State(shared): State<Shared>,
    Asked(Most { limit }): Asked<Most>,
) -> Result<Json<Vec<Event>>, Problem> {
    let limit = limit.unwrap_or(LOGGED);
    if !(1..=TOLD).contains(&limit) {
        let why = format!("limit is {limit}, allowed are 1 … {TOLD}");
        return Err(Problem::new(StatusCode::BAD_REQUEST, why));
    }
    Ok(Json(shared.daemon.latest_events(limit)))
}

/// What happens, as it happens: server-sent events.
///
/// Each has an id to go on from, and an `Event` in JSON as its data. Between them, without an id, events named `rig`
/// carry a `RigView` whenever the picture of the rig changed.
#[utoipa::path(get, path = "/events", tag = "events",
    params(After, ("Last-Event-ID" = Option<u64>, Header, description = "Id of the last event that was seen")),
    responses((status = 200, description = "A stream that ends with the daemon", body = String, content_type = "text/event-stream"),
        (status = 503, body = Problem, content_type = "application/problem+json", description = "Too many streams are open")))]
async fn events(
    State(shared): State<Shared>,
    Asked(After { after }): Asked<After>,
    headers: HeaderMap,
) -> Result<Sse<impl Stream<Item = Result<sse::Event, Infallible>>>, Problem> {
    let permit = Arc::clone(&shared.streams).try_acquire_owned().map_err(|_| {
        let why = "as many streams of events are open as the daemon serves; close one";
        Problem::new(StatusCode::SERVICE_UNAVAILABLE, why)
    })?;
    let last = headers
        .get("last-event-id")
        .and_then(|id| id.to_str().ok()?.parse().ok());
    let mut rig = shared.daemon.rig();
    // A new watcher sees the rig at once.
    rig.mark_changed();
    let source = Source {
        events: shared.daemon.events(last.or(after)),
        rig,
        closing: shared.closing.clone(),
        next_picture: Instant::now(),
        _permit: permit,
        _open: shared.metrics.stream(),
    };
    let stream = stream::unfold(source, async |mut source| {
        let event = source.next().await?;
        Some((Ok(event), source))
    });
    Ok(Sse::new(stream).keep_alive(KeepAlive::new().interval(KEEP_ALIVE)))
}

/// One watcher's events.
struct Source {
    events: Events,
    rig: watch::Receiver<RigView>,
    closing: watch::Receiver<bool>,
    next_picture: Instant,
    _permit: OwnedSemaphorePermit,
    _open: Open,
}

impl Source {
    async fn next(&mut self) -> Option<sse::Event> {
        let picture = async {
            sleep_until(self.next_picture).await;
            self.rig.changed().await
        };
        tokio::select! {
            biased;
            _ = self.closing.wait_for(|&closing| closing) => None,
            event = self.events.next() => {
                let event = event?;
                encode(sse::Event::default().id(event.id.to_string()), &event)
            }
            changed = picture => {
                changed.ok()?;
                self.next_picture = Instant::now() + PICTURE_EVERY;
                let view = self.rig.borrow_and_update().clone();
                encode(sse::Event::default().event("rig"), &view)
            }
        }
    }
}

fn encode(event: sse::Event, data: &impl Serialize) -> Option<sse::Event> {
    match event.json_data(data) {
        Ok(event) => Some(event),
        Err(error) => {
            tracing::error!("an event cannot be told: {error}");
            None
        }
    }
}
