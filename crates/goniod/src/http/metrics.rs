use axum::extract::{MatchedPath, Request, State};
use axum::http::{StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};
use std::sync::atomic::AtomicU64;

use super::problem::Problem;
use super::shared::Shared;
use crate::{JobState, RigView};

/// Media type of the text that Prometheus reads.
const MEDIA_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";
const ARMS: [&str; 2] = ["light", "sensor"];

type Number = Gauge<f64, AtomicU64>;

/// What /metrics tells.
pub(crate) struct Metrics {
    registry: Registry,
    requests: Family<Asked, Counter>,
    refused: Family<Reason, Counter>,
    closed: Family<Reason, Counter>,
    streams: Gauge,
    jobs: Family<Standing, Gauge>,
    rig: Rig,
}

/// The rig as gauges.
#[derive(Default)]
struct Rig {
    connected: Gauge,
    fault: Gauge,
    lamp: Gauge,
    angle: Family<OfArm, Number>,
    moving: Family<OfArm, Gauge>,
    monitor: Number,
    temperature: Number,
    steps_done: Gauge,
    steps_planned: Gauge,
    seconds_left: Number,
    retries: Gauge,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Asked {
    method: &'static str,
    route: String,
    status: u16,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Reason {
    reason: &'static str,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Standing {
    state: String,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct OfArm {
    arm: &'static str,
}

/// Counts an open stream as long as it is held.
pub(crate) struct Open(Gauge);

impl Drop for Open {
    fn drop(&mut self) {
        self.0.dec();
    }
}

impl Metrics {
    pub(crate) fn new() -> Self {
        let mut registry = Registry::with_prefix("goniod");
        let r = &mut registry;
        let rig = Rig::default();
        let (requests, refused, closed, streams, jobs) = (
            Family::default(),
            Family::default(),
            Family::default(),
            Gauge::default(),
            Family::default(),
        );
        r.register("http_requests", "Requests answered", requests.clone());
        r.register(
            "http_refused",
            "Requests refused before they were looked at",
            refused.clone(),
        );
        r.register(
            "http_closed",
            "Connections closed to make room for new ones",
            closed.clone(),
        );
        r.register(
            "event_streams",
            "Streams of events that are open",
            streams.clone(),
        );
        r.register("jobs", "Jobs by state", jobs.clone());
        r.register(
            "rig_connected",
            "Whether the devices answered when asked last",
            rig.connected.clone(),
        );
        r.register(
            "fault_latched",
            "Whether a fault waits to be acknowledged",
            rig.fault.clone(),
        );
        r.register("lamp_on", "Whether the lamp is on", rig.lamp.clone());
        r.register(
            "arm_angle_degrees",
            "Where an arm was seen last, from the normal",
            rig.angle.clone(),
        );
        r.register("arm_moving", "Whether an arm moves", rig.moving.clone());
        r.register(
            "lamp_monitor_ratio",
            "Lamp output relative to nominal",
            rig.monitor.clone(),
        );
        r.register_with_unit(
            "photometer_temperature",
            "At the last reading",
            Unit::Celsius,
            rig.temperature.clone(),
        );
        r.register(
            "run_steps_done",
            "Steps of the run under way that have a reading",
            rig.steps_done.clone(),
        );
        r.register(
            "run_steps_planned",
            "Steps of the run under way",
            rig.steps_planned.clone(),
        );
        r.register_with_unit(
            "run_left",
            "Rig time that the run still needs",
            Unit::Seconds,
            rig.seconds_left.clone(),
        );
        r.register(
            "run_retries",
            "Requests on the bus that the run repeated",
            rig.retries.clone(),
        );
        Self {
            registry,
            requests,
            refused,
            closed,
            streams,
            jobs,
            rig,
        }
    }

    /// A request was refused.
    pub(crate) fn refused(&self, reason: &'static str) {
        self.refused.get_or_create(&Reason { reason }).inc();
    }

    /// A connection was closed to make room for another: all slots were taken, or all files that may be open.
    pub(crate) fn closed(&self, reason: &'static str) {
        self.closed.get_or_create(&Reason { reason }).inc();
    }

    /// A stream of events was opened.
    pub(crate) fn stream(&self) -> Open {
        self.streams.inc();
        Open(self.streams.clone())
    }

    fn text(
        &self,
        view: &RigView,
        states: impl Iterator<Item = JobState>,
    ) -> Result<String, std::fmt::Error> {
        self.rig.show(view);
        self.jobs.clear();
        for state in states {
            let state = state.to_string();
            self.jobs.get_or_create(&Standing { state }).inc();
        }
        let mut text = String::new();
        encode(&mut text, &self.registry)?;
        Ok(text)
    }
}

impl Rig {
    fn show(&self, view: &RigView) {
        self.connected.set(view.connected.into());
        self.fault.set(view.fault.is_some().into());
        self.lamp.set(view.lamp.into());
        for (arm, seen) in ARMS.into_iter().zip(&view.arms) {
            let of = OfArm { arm };
            self.angle
                .get_or_create(&of)
                .set(seen.measured_deg.unwrap_or(f64::NAN));
            self.moving.get_or_create(&of).set(seen.moving.into());
        }
        self.monitor.set(view.lamp_monitor.unwrap_or(f64::NAN));
        self.temperature
            .set(view.temperature_c.map_or(f64::NAN, f64::from));
        let whole = |count: usize| i64::try_from(count).unwrap_or(i64::MAX);
        let progress = view.progress;
        self.steps_done.set(progress.map_or(0, |p| whole(p.done)));
        self.steps_planned.set(progress.map_or(0, |p| whole(p.of)));
        self.seconds_left.set(progress.map_or(0.0, |p| p.seconds_left));
        self.retries.set(progress.map_or(0, |p| p.retries.into()));
    }
}

/// GET /metrics.
pub(crate) async fn show(State(shared): State<Shared>) -> Result<Response, Problem> {
    let jobs = shared.daemon.jobs().await?;
    let view = shared.daemon.rig().borrow().clone();
    let text = shared.metrics.text(&view, jobs.iter().map(|job| job.state));
    let text = text.map_err(|error| Problem::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string()))?;
    Ok(([(header::CONTENT_TYPE, MEDIA_TYPE)], text).into_response())
}

/// Counts what is answered, by route: a stranger's paths must not become labels.
pub(crate) async fn count(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let route = request
        .extensions()
        .get::<MatchedPath>()
        .map_or("none", MatchedPath::as_str)
        .to_owned();
    let method = match request.method().as_str() {
        "GET" => "GET",
        "POST" => "POST",
        "HEAD" => "HEAD",
        "DELETE" => "DELETE",
        "PATCH" => "PATCH",
        _ => "other",
    };
    let response = next.run(request).await;
    let status = response.status().as_u16();
    shared
        .metrics
        .requests
        .get_or_create(&Asked {
            method,
            route,
            status,
        })
        .inc();
    response
}
