use std::io;

use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::{Path, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use formats::FORMATS;
use futures_util::stream;
use tokio::sync::mpsc;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::problem::Problem;
use super::shared::Shared;
use crate::ExportView;

/// What stands for all formats in one archive.
const ALL: &str = "all";
/// Parts of an archive that may wait for a client.
const PARTS: usize = 8;
/// Bytes of a part, about.
const PART: usize = 64 * 1024;

pub(crate) fn routes() -> OpenApiRouter<Shared> {
    OpenApiRouter::new()
        .routes(routes!(exports))
        .routes(routes!(export))
}

/// The formats in which the result of a run can be had.
#[utoipa::path(get, path = "/runs/{id}/exports", tag = "runs", params(("id" = String, Path, description = "Id of the run")),
    responses((status = 200, body = Vec<ExportView>),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run")))]
async fn exports(
    State(shared): State<Shared>,
    Path(id): Path<String>,
) -> Result<Json<Vec<ExportView>>, Problem> {
    shared.daemon.run(&id).await?;
    let formats = FORMATS.iter().map(|format| ExportView {
        format: format.name.to_owned(),
        extension: format.extension.to_owned(),
        about: format.about.to_owned(),
    });
    let all = ExportView {
        format: ALL.to_owned(),
        extension: "zip".to_owned(),
        about: "Archive of the readings and of every format that holds the result, with the figures of each."
            .to_owned(),
    };
    Ok(Json(formats.chain([all]).collect()))
}

/// Make the result of a run in a format, or in all of them as a ZIP archive, from its readings. A format that does not
/// hold the specimen well enough is refused with its figures.
#[utoipa::path(get, path = "/runs/{id}/exports/{format}", tag = "runs",
    params(("id" = String, Path, description = "Id of the run"), ("format" = String, Path, description = "Name of the format, or \"all\"")),
    responses((status = 200, description = "The file", body = [u8], content_type = "*/*"),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run or format"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "The run has no BRDF, or the format does not hold it")))]
async fn export(
    State(shared): State<Shared>,
    Path((id, format)): Path<(String, String)>,
) -> Result<Response, Problem> {
    if format == ALL {
        return archive(&shared, id).await;
    }
    let daemon = shared.daemon.clone();
    let (name, bytes) = shared
        .work(async move { Ok(daemon.export(&id, &format).await?) })
        .await?;
    attachment(&name, "application/octet-stream", Body::from(bytes))
}

/// The archive is sent as it is made: all formats together may take longer than an answer may.
async fn archive(shared: &Shared, id: String) -> Result<Response, Problem> {
    let (daemon, working) = (shared.daemon.clone(), shared.working.clone());
    let permit = working.acquire_owned().await;
    let permit = permit.map_err(|_| Problem::of(StatusCode::INTERNAL_SERVER_ERROR))?;
    let run = daemon.run_export(&id).await?;
    let (sender, parts) = mpsc::channel(PARTS);
    let name = run.name_of(ALL, "zip");
    tokio::task::spawn_blocking(move || {
        let _permit = permit;
        let mut out = io::BufWriter::with_capacity(PART, Parts(sender.clone()));
        let written = run.archive(&mut out).and_then(|()| io::Write::flush(&mut out));
        if let Err(error) = written {
            // Whoever asked may have gone. Who has not sees that the archive has no end.
            let _ = sender.blocking_send(Err(error));
        }
    });
    let parts = stream::unfold(parts, async |mut parts| {
        parts.recv().await.map(|part| (part, parts))
    });
    attachment(&name, "application/zip", Body::from_stream(parts))
}

/// A file that a browser saves.
fn attachment(name: &str, media_type: &'static str, body: Body) -> Result<Response, Problem> {
    let value = HeaderValue::from_str(&format!("attachment; filename=\"{name}\""));
    let value = value.map_err(|_| Problem::of(StatusCode::INTERNAL_SERVER_ERROR))?;
    let headers = [
        (header::CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (header::CONTENT_DISPOSITION, value),
    ];
    Ok((headers, body).into_response())
}

/// Hands what is written to the client.
struct Parts(mpsc::Sender<io::Result<Bytes>>);

impl io::Write for Parts {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let gone = |_| io::Error::from(io::ErrorKind::BrokenPipe);
        self.0
            .blocking_send(Ok(Bytes::copy_from_slice(bytes)))
            .map_err(gone)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
