use axum::body::Bytes;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse, Response};
use axum::{Extension, Json};
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::body;
use super::job_file::JobFile;
use super::keys::{Asked, place, with_next};
use super::problem::Problem;
use super::shared::{Shared, long_json};
use crate::history::USUAL;
use crate::{Action, Caller, Job, JobId, PlanView, Submission};

pub(crate) fn routes() -> OpenApiRouter<Shared> {
    OpenApiRouter::new()
        .routes(routes!(jobs, submit))
        .routes(routes!(job))
        .routes(routes!(act))
        .routes(routes!(plan))
}

/// What to call a job, and what its run leaves.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
struct Naming {
    /// What messages call the job's file.
    #[param(max_length = 200)]
    name: Option<String>,
    /// Whether the run directory gets all files, also the large ones that can be made when somebody asks for them.
    #[serde(default)]
    whole: bool,
}

/// Which jobs.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
struct Page {
    /// At most so many that are over; 50 unless given.
    #[param(minimum = 1, maximum = 200)]
    limit: Option<u32>,
    /// Only those that are over and whose place is before this one.
    #[serde(default, deserialize_with = "place")]
    before: Option<u64>,
}

/// The jobs in the order in which they are worked off, by `place`: the latest that are over, then the queue.
///
/// Where there are earlier ones that are over, the header Link says where (RFC 8288, `rel="next"`).
#[utoipa::path(get, path = "/jobs", tag = "queue", params(Page), responses((status = 200, body = Vec<Job>,
    headers(("Link" = String, description = "Where the jobs before these are found, if there are any")))))]
async fn jobs(
    State(shared): State<Shared>,
    Asked(Page { limit, before }): Asked<Page>,
) -> Result<Response, Problem> {
    let daemon = shared.daemon.clone();
    let limit = limit.unwrap_or(USUAL);
    shared
        .work(async move {
            let mut jobs = daemon.jobs_over(before, limit).await?;
            let earlier = (jobs.len() == limit as usize).then(|| jobs.last().map(|job| job.place));
            if before.is_none() {
                jobs.extend(daemon.waiting_jobs().await?);
            }
            jobs.sort_by_key(|job| job.place);
            let answer = long_json(jobs).await?;
            let next = earlier
                .flatten()
                .map(|place| vec![("limit", limit.to_string()), ("before", place.to_string())]);
            Ok(with_next(answer, next))
        })
        .await
}

/// Add a job to the queue: a job file, TOML as config/jobs/quickstart.toml explains it, or the same keys in JSON.
#[utoipa::path(post, path = "/jobs", tag = "queue", params(Naming),
    request_body(content((JobFile = "application/json"), (String = "application/toml"))),
    responses((status = 201, body = Job, headers(("Location" = String, description = "Where the job is found"))),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "Not while the rig is as it is"),
        (status = 415, body = Problem, content_type = "application/problem+json", description = "Neither TOML nor JSON"),
        (status = 422, body = Problem, content_type = "application/problem+json", description = "The job file is wrong, or this rig cannot do it")))]
async fn submit(
    State(shared): State<Shared>,
    Extension(by): Extension<Caller>,
    Asked(Naming { name, whole }): Asked<Naming>,
    headers: HeaderMap,
    text: Bytes,
) -> Result<impl IntoResponse, Problem> {
    let name = name
        .filter(|name| !name.is_empty())
        .unwrap_or_else(|| "job".to_owned());
    if name.chars().count() > 200 || name.chars().any(char::is_control) {
        let why = "name must have at most 200 characters, none of them a control character";
        return Err(Problem::new(StatusCode::UNPROCESSABLE_ENTITY, why));
    }
    let job = job_text(&headers, &text)?;
    let daemon = shared.daemon.clone();
    let job = shared
        .work(async move { Ok(daemon.submit(&by, Submission { job, name, whole }).await?) })
        .await?;
    let location = format!("/api/v1/jobs/{}", job.id);
    Ok((
        StatusCode::CREATED,
        AppendHeaders([(header::LOCATION, location)]),
        Json(job),
    ))
}

/// One job.
#[utoipa::path(get, path = "/jobs/{id}", tag = "queue", params(("id" = String, Path, description = "Id of the job")),
    responses((status = 200, body = Job),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such job")))]
async fn job(State(shared): State<Shared>, Path(id): Path<String>) -> Result<Json<Job>, Problem> {
    Ok(Json(shared.daemon.job(job_id(&id)?).await?))
}

/// Do something with one job.
#[utoipa::path(post, path = "/jobs/{id}/{action}", tag = "queue",
    params(("id" = String, Path, description = "Id of the job"), ("action" = Action, Path, description = "What to do")),
    responses((status = 200, body = Job),
        (status = 404, body = Problem, content_type = "application/problem+json", description = "There is no such job or action"),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "Not in the job's state")))]
async fn act(
    State(shared): State<Shared>,
    Extension(by): Extension<Caller>,
    Path((id, action)): Path<(String, String)>,
) -> Result<Json<Job>, Problem> {
    let action: Action = serde_json::from_value(action.into())
        .map_err(|_| Problem::new(StatusCode::NOT_FOUND, "actions are ready, cancel, resume"))?;
    Ok(Json(shared.daemon.act(&by, job_id(&id)?, action).await?))
}

/// What would be done for a job file; touches no hardware.
#[utoipa::path(post, path = "/plan", tag = "queue",
    request_body(content((JobFile = "application/json"), (String = "application/toml"))),
    responses((status = 200, body = PlanView),
        (status = 409, body = Problem, content_type = "application/problem+json", description = "Not while the rig is as it is"),
        (status = 415, body = Problem, content_type = "application/problem+json", description = "Neither TOML nor JSON"),
        (status = 422, body = Problem, content_type = "application/problem+json", description = "The job file is wrong, or this rig cannot do it")))]
async fn plan(State(shared): State<Shared>, headers: HeaderMap, text: Bytes) -> Result<Response, Problem> {
    let (daemon, job) = (shared.daemon.clone(), job_text(&headers, &text)?);
    shared
        .work(async move { long_json(daemon.plan(&job).await?).await })
        .await
}

fn job_id(id: &str) -> Result<JobId, Problem> {
    id.parse()
        .map_err(|_| Problem::new(StatusCode::NOT_FOUND, "there is no such job"))
}

/// What is said of a job file whose line breaks were lost on the way.
const UNBROKEN: &str = "the job file has lost its line breaks: `curl -d @FILE` drops them, `curl --data-binary @FILE` \
                        keeps them";

/// Whether a job file has lost its line breaks: it is all in one line, with a table or more than one key in it, or all
/// of it a comment. A job that really is one line has one key, as each has a line of its own.
fn unbroken(text: &str) -> bool {
    let text = text.trim();
    let one_line = !text.contains(['\n', '\r']);
    one_line
        && (text.starts_with('#') || text.contains("[[") || text.matches('=').count() > 1)
        && toml::from_str::<toml::Table>(text).map_or(true, |table| table.is_empty())
}

/// The job file of a body as TOML: as it came, or made of JSON with the same keys.
fn job_text(headers: &HeaderMap, text: &[u8]) -> Result<String, Problem> {
    let wrong = |why: String| Problem::new(StatusCode::UNPROCESSABLE_ENTITY, why);
    match body::media_type(headers).as_str() {
        "application/json" => {
            let job: toml::Table = body::json(headers, text)?;
            toml::to_string(&job).map_err(|error| wrong(format!("this JSON is no job file: {error}")))
        }
        "application/toml" => {
            let text =
                config::decode(text.to_vec()).map_err(|error| wrong(format!("the job file: {error}")))?;
            if unbroken(&text) {
                return Err(wrong(UNBROKEN.to_owned()));
            }
            Ok(text)
        }
        "application/x-www-form-urlencoded" => Err(Problem::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "the body is a form, as `curl -d` says unless told otherwise; send a job file with `curl -H 'Content-Type: \
             application/toml' --data-binary @FILE`",
        )),
        other => Err(Problem::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            format!("the body is {other:?}, taken are application/toml and application/json"),
        )),
    }
}
