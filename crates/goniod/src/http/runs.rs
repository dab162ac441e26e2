use std::fs::Metadata;
use std::path::PathBuf;

use axum::Json;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use tower::ServiceExt;
use tower_http::services::ServeFile;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::problem::Problem;
use super::shared::{Shared, long_json};
use crate::{ReadingView, RunView};

/// What a file of a run may do in a browser: show itself. No script, no form, no origin, nothing fetched.
const SANDBOX: &str = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'; base-uri 'none'";
/// The one file that a browser shows instead of saving it.
const REPORT: &str = "report.html";

/// A file of a run directory.
#[derive(Serialize, ToSchema)]
struct FileView {
    /// Its name.
    name: String,
    /// Its size.
    bytes: u64,
}

pub(crate) fn routes() -> OpenApiRouter<Shared> {
    OpenApiRouter::new()
        .routes(routes!(runs))
        .routes(routes!(run))
        .routes(routes!(readings))
        .routes(routes!(files))
        .routes(routes!(file))
}

/// All runs, the newest first.
#[utoipa::path(get, path = "/runs", tag = "runs", responses((status = 200, body = Vec<RunView>)))]
async fn runs(State(shared): State<Shared>) -> Result<Response, Problem> {
    let daemon = shared.daemon.clone();
    shared
        .work(async move { long_json(daemon.runs().await?).await })
        .await
}

/// One run.
#[utoipa::path(get, path = "/runs/{id}", tag = "runs", params(("id" = String, Path, description = "Id of the run")),
    responses((status = 200, body = RunView),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run")))]
async fn run(State(shared): State<Shared>, Path(id): Path<String>) -> Result<Json<RunView>, Problem> {
    Ok(Json(shared.daemon.run(&id).await?))
}

/// The readings of a run, in the order in which they were taken.
#[utoipa::path(get, path = "/runs/{id}/readings", tag = "runs", params(("id" = String, Path, description = "Id of the run")),
    responses((status = 200, body = Vec<ReadingView>),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run")))]
async fn readings(State(shared): State<Shared>, Path(id): Path<String>) -> Result<Response, Problem> {
    let daemon = shared.daemon.clone();
    shared
        .work(async move { long_json(daemon.readings(&id).await?).await })
        .await
}

/// The files of a run directory.
#[utoipa::path(get, path = "/runs/{id}/files", tag = "runs", params(("id" = String, Path, description = "Id of the run")),
    responses((status = 200, body = Vec<FileView>),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run")))]
async fn files(State(shared): State<Shared>, Path(id): Path<String>) -> Result<Json<Vec<FileView>>, Problem> {
    let directory = shared.daemon.run(&id).await?.directory;
    let mut files = Vec::new();
    let Ok(mut entries) = tokio::fs::read_dir(&directory).await else {
        // Its directory is yet to be written.
        return Ok(Json(files));
    };
    while let Ok(Some(entry)) = entries.next_entry().await {
        let Ok(metadata) = entry.metadata().await else {
            continue;
        };
        let name = entry.file_name().to_string_lossy().into_owned();
        if is_plain(&name) && metadata.is_file() {
            let bytes = metadata.len();
            files.push(FileView { name, bytes });
        }
    }
    files.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(Json(files))
}

/// Download a file of a run directory; ranges are served.
#[utoipa::path(get, path = "/runs/{id}/files/{name}", tag = "runs",
    params(("id" = String, Path, description = "Id of the run"), ("name" = String, Path, description = "Name of the file")),
    responses((status = 200, description = "The file", body = [u8], content_type = "*/*"),
        (status = 206, description = "The range of it that was asked for", body = [u8], content_type = "*/*"),
        (status = 304, description = "It did not change"),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run or file"),
        (status = 416, body = Problem, content_type = "application/problem+json", description = "It has no such range")))]
async fn file(
    State(shared): State<Shared>,
    Path((id, name)): Path<(String, String)>,
    request: Request,
) -> Result<Response, Problem> {
    let missing = || Problem::new(StatusCode::NOT_FOUND, "this run has no such file");
    let directory = shared.daemon.run(&id).await?.directory;
    let path = regular(directory, &name).await.ok_or_else(missing)?;
    let Ok(mut response) = ServeFile::new(path)
        .oneshot(request)
        .await
        .map(IntoResponse::into_response);
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(SANDBOX));
    headers.insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("SAMEORIGIN"));
    if name != REPORT {
        let value = format!("attachment; filename=\"{name}\"");
        let value = HeaderValue::from_str(&value).map_err(|_| missing())?;
        headers.insert(header::CONTENT_DISPOSITION, value);
    }
    Ok(response)
}

/// A regular file right in a directory; links are not followed.
async fn regular(directory: PathBuf, name: &str) -> Option<PathBuf> {
    if !is_plain(name) {
        return None;
    }
    let path = directory.join(name);
    let metadata: Metadata = tokio::fs::symlink_metadata(&path).await.ok()?;
    metadata.is_file().then_some(path)
}

/// Whether a name is that of a file that a run directory may hold: no way up, no other folder, nothing half-written.
fn is_plain(name: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    !name.is_empty() && !name.starts_with('.') && name.chars().all(allowed)
}

#[cfg(test)]
mod tests {
    use super::is_plain;

    #[test]
    fn only_names_of_files_right_in_the_directory_are_plain() {
        for name in ["journal", "brdf.binary", "report.html", "a-b_c.1"] {
            assert!(is_plain(name), "{name}");
        }
        for name in [
            "",
            ".",
            "..",
            "../journal",
            "a/b",
            "/etc/passwd",
            ".part",
            "a\\b",
            "a\0b",
            "a\"b",
            "ä",
        ] {
            assert!(!is_plain(name), "{name:?}");
        }
    }
}
