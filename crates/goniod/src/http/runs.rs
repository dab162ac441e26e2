use std::fs::Metadata;
use std::path::PathBuf;

use axum::body::Bytes;
use axum::extract::{Path, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::{Deserialize, Serialize};
use tower::ServiceExt;
use tower_http::services::ServeFile;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};

use super::body;
use super::download::{disposition, download_name};
use super::keys::{Asked, place, with_next};
use super::problem::Problem;
use super::shared::{Shared, long_json};
use crate::history::USUAL;
use crate::{Caller, JobState, ReadingView, RecordEdit, RunQuery, RunView};

/// What a file of a run may do in a browser: show itself. No script, no form, nothing fetched.
///
/// Of this daemon's own origin only, so that the page can see how high it is: without a script that lets it do nothing.
const SANDBOX: &str = "sandbox allow-same-origin; default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'; base-uri 'none'";
/// The one file that a browser shows instead of saving it.
const REPORT: &str = "report.html";

/// A file of a run directory.
#[derive(Serialize, ToSchema)]
struct FileView {
    /// Its name.
    name: String,
    /// Its size.
    bytes: u64,
    /// Whether it is made when somebody asks for it.
    made: bool,
}

pub(crate) fn routes() -> OpenApiRouter<Shared> {
    OpenApiRouter::new()
        .routes(routes!(runs))
        .routes(routes!(run, describe, delete))
        .routes(routes!(archive))
        .routes(routes!(unarchive))
        .routes(routes!(readings))
        .routes(routes!(files))
        .routes(routes!(file))
}

/// Which runs somebody wants to see: those for which everything holds that is said.
#[derive(Clone, Default, Deserialize, Serialize, IntoParams)]
#[into_params(parameter_in = Query)]
struct Wanted {
    /// At most so many; 50 unless given.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<u32>,
    /// Those whose place is before this one.
    #[serde(default, deserialize_with = "place")]
    before: Option<u64>,
    /// Every word of it is the beginning of a word of the specimen, the job file's name, the record or the id.
    q: Option<String>,
    /// One of its tags, whatever the case of its letters.
    tag: Option<String>,
    /// Who measured, exactly.
    operator: Option<String>,
    /// What it was measured for, exactly.
    project: Option<String>,
    /// The specimen's name or number, exactly.
    specimen: Option<String>,
    /// How its job stands.
    state: Option<JobState>,
    /// It began then or later: a day such as 2026-12-01, or a time such as 2026-12-01T08:30:00Z.
    from: Option<String>,
    /// It began then or earlier, or on that day.
    to: Option<String>,
    /// Those that were put away, instead of those that were not.
    archived: Option<bool>,
}

impl Wanted {
    fn query(self) -> RunQuery {
        let said = |text: Option<String>| text.filter(|text| !text.is_empty());
        RunQuery {
            limit: self.limit.unwrap_or(USUAL),
            before: self.before,
            words: said(self.q),
            tag: said(self.tag),
            operator: said(self.operator),
            project: said(self.project),
            specimen: said(self.specimen),
            state: self.state,
            from: said(self.from),
            to: said(self.to),
            archived: self.archived.unwrap_or(false),
        }
    }

    /// The query for the runs before a place.
    fn before(&self, place: u64) -> Vec<(&'static str, String)> {
        let number = |number: Option<u32>| number.map(|number| number.to_string());
        let pairs = [
            ("limit", number(self.limit)),
            ("before", Some(place.to_string())),
            ("q", self.q.clone()),
            ("tag", self.tag.clone()),
            ("operator", self.operator.clone()),
            ("project", self.project.clone()),
            ("specimen", self.specimen.clone()),
            ("state", self.state.map(word)),
            ("from", self.from.clone()),
            ("to", self.to.clone()),
            ("archived", self.archived.map(|archived| archived.to_string())),
        ];
        let said = pairs.into_iter();
        said.filter_map(|(key, value)| Some((key, value?))).collect()
    }
}

/// A state as JSON spells it.
fn word(state: JobState) -> String {
    let word = serde_json::to_value(state).ok();
    word.and_then(|word| word.as_str().map(str::to_owned))
        .unwrap_or_default()
}

/// The runs that somebody wants to see, the newest first.
///
/// Where there are earlier ones, the header Link says where (RFC 8288, `rel="next"`).
#[utoipa::path(get, path = "/runs", tag = "runs", params(Wanted), responses((status = 200, body = Vec<RunView>,
    headers(("Link" = String, description = "Where the runs before these are found, if there are any")))))]
async fn runs(State(shared): State<Shared>, Asked(wanted): Asked<Wanted>) -> Result<Response, Problem> {
    let daemon = shared.daemon.clone();
    shared
        .work(async move {
            let query = wanted.clone().query();
            let runs = daemon.runs(&query).await?;
            let last = runs.last().filter(|_| runs.len() == query.limit as usize);
            let next = last.map(|run| wanted.before(run.place));
            Ok(with_next(long_json(runs).await?, next))
        })
        .await
}

/// One run.
#[utoipa::path(get, path = "/runs/{id}", tag = "runs", params(("id" = String, Path, description = "Id of the run")),
    responses((status = 200, body = RunView),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run")))]
async fn run(State(shared): State<Shared>, Path(id): Path<String>) -> Result<Json<RunView>, Problem> {
    Ok(Json(shared.daemon.run(&id).await?))
}

/// Change what is said of a run: what is named takes the place of what was there. What was measured stays as it is.
#[utoipa::path(patch, path = "/runs/{id}", tag = "runs", params(("id" = String, Path, description = "Id of the run")),
    request_body = RecordEdit,
    responses((status = 200, body = RunView),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run")))]
async fn describe(
    State(shared): State<Shared>,
    Extension(by): Extension<Caller>,
    Path(id): Path<String>,
    headers: HeaderMap,
    text: Bytes,
) -> Result<Json<RunView>, Problem> {
    let edit: RecordEdit = body::json(&headers, &text)?;
    Ok(Json(shared.daemon.describe(&by, &id, edit).await?))
}

/// Put a run away: the history shows it only where that is asked for.
#[utoipa::path(post, path = "/runs/{id}/archive", tag = "runs", params(("id" = String, Path, description = "Id of the run")),
    responses((status = 200, body = RunView),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "Its job is not over")))]
async fn archive(
    State(shared): State<Shared>,
    Extension(by): Extension<Caller>,
    Path(id): Path<String>,
) -> Result<Json<RunView>, Problem> {
    Ok(Json(shared.daemon.archive(&by, &id, true).await?))
}

/// Take a run back into the history.
#[utoipa::path(post, path = "/runs/{id}/unarchive", tag = "runs", params(("id" = String, Path, description = "Id of the run")),
    responses((status = 200, body = RunView),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "Its job is not over")))]
async fn unarchive(
    State(shared): State<Shared>,
    Extension(by): Extension<Caller>,
    Path(id): Path<String>,
) -> Result<Json<RunView>, Problem> {
    Ok(Json(shared.daemon.archive(&by, &id, false).await?))
}

/// Delete a run with its files and its readings. It cannot be taken back.
#[utoipa::path(delete, path = "/runs/{id}", tag = "runs", params(("id" = String, Path, description = "Id of the run")),
    responses((status = 204, description = "Deleted"),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such run"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "Its job is not over"),
        (status = 503, body = Problem, content_type = "application/problem+json", description = "Its files cannot be removed")))]
async fn delete(
    State(shared): State<Shared>,
    Extension(by): Extension<Caller>,
    Path(id): Path<String>,
) -> Result<StatusCode, Problem> {
    shared.daemon.delete(&by, &id).await?;
    Ok(StatusCode::NO_CONTENT)
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
            let made = false;
            files.push(FileView { name, bytes, made });
        }
    }
    for (name, bytes) in shared.daemon.files_to_make(&id).await? {
        if !files.iter().any(|file| file.name == name) {
            let (name, made) = (name.to_owned(), true);
            files.push(FileView { name, bytes, made });
        }
    }
    files.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(Json(files))
}

/// Download a file of a run directory; ranges are served. One that is made when somebody asks for it takes a few seconds.
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
    let run = shared.daemon.run(&id).await?;
    let path = match regular(run.directory.clone(), &name).await {
        Some(path) => path,
        None => {
            let (daemon, id, name) = (shared.daemon.clone(), id.clone(), name.clone());
            let made = shared.work(async move { Ok(daemon.make_file(&id, &name).await?) });
            made.await?.ok_or_else(missing)?
        }
    };
    let Ok(mut response) = ServeFile::new(path)
        .oneshot(request)
        .await
        .map(IntoResponse::into_response);
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(SANDBOX));
    headers.insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("SAMEORIGIN"));
    let kind = if name == REPORT { "inline" } else { "attachment" };
    let disposition = disposition(kind, &download_name(&run, &name));
    headers.insert(header::CONTENT_DISPOSITION, disposition);
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
