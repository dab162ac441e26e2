use api::{Acknowledgement, ArmName, Jog};
use arms::{Arm, ArmAngle};
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::{Extension, Json};
use utoipa_axum::{router::OpenApiRouter, routes};

use super::body;
use super::problem::Problem;
use super::shared::Shared;
use crate::{Caller, RigView};

/// What an operator's hand does; answered without a body.
type Done = Result<StatusCode, Problem>;
const DONE: StatusCode = StatusCode::NO_CONTENT;

pub(crate) fn routes() -> OpenApiRouter<Shared> {
    OpenApiRouter::new()
        .routes(routes!(rig))
        .routes(routes!(rig_file))
        .routes(routes!(pause))
        .routes(routes!(proceed))
        .routes(routes!(finish))
        .routes(routes!(stop))
        .routes(routes!(estop))
        .routes(routes!(acknowledge))
        .routes(routes!(jog))
        .routes(routes!(park))
}

/// Where the arms are, and all else that is known of the rig.
#[utoipa::path(get, path = "/rig", tag = "rig", responses((status = 200, body = RigView)))]
async fn rig(State(shared): State<Shared>) -> Json<RigView> {
    Json(shared.daemon.rig().borrow().clone())
}

/// The rig file, as the daemon was given it.
#[utoipa::path(get, path = "/rig/file", tag = "rig",
    responses((status = 200, body = String, content_type = "application/toml")))]
async fn rig_file(State(shared): State<Shared>) -> ([(HeaderName, &'static str); 1], String) {
    let toml = [(header::CONTENT_TYPE, "application/toml")];
    (toml, shared.daemon.rig_file().to_owned())
}

/// Finish the reading, then hold.
#[utoipa::path(post, path = "/pause", tag = "rig", responses((status = 204, description = "Asked for"),
    (status = 409, body = Problem, content_type = "application/problem+json", description = "Nothing runs")))]
async fn pause(State(shared): State<Shared>, Extension(by): Extension<Caller>) -> Done {
    shared.daemon.pause(&by).await?;
    Ok(DONE)
}

/// Go on after a pause.
#[utoipa::path(post, path = "/proceed", tag = "rig", responses((status = 204, description = "Asked for"),
    (status = 409, body = Problem, content_type = "application/problem+json", description = "Nothing is paused")))]
async fn proceed(State(shared): State<Shared>, Extension(by): Extension<Caller>) -> Done {
    shared.daemon.proceed(&by).await?;
    Ok(DONE)
}

/// Finish the reading, then end; the run can be resumed. Nothing starts until an operator starts or resumes a job.
#[utoipa::path(post, path = "/finish", tag = "rig", responses((status = 204, description = "Asked for; the queue is held, also after a restart"),
    (status = 503, body = Problem, content_type = "application/problem+json", description = "Asked for, but the queue is held only as long as the daemon runs: the disk refuses")))]
async fn finish(State(shared): State<Shared>, Extension(by): Extension<Caller>) -> Done {
    shared.daemon.finish(&by).await?;
    Ok(DONE)
}

/// Brake now; the run can be resumed. Nothing starts until an operator starts or resumes a job. Never refused.
#[utoipa::path(post, path = "/stop", tag = "rig", responses((status = 204, description = "The arms were told to stop; the queue is held, also after a restart"),
    (status = 503, body = Problem, content_type = "application/problem+json", description = "The arms stop, but the queue is held only as long as the daemon runs: the disk refuses")))]
async fn stop(State(shared): State<Shared>, Extension(by): Extension<Caller>) -> Done {
    shared.daemon.stop(&by).await?;
    Ok(DONE)
}

/// Emergency stop: arms and lamp at once, and no motion until it is acknowledged by its id, which GET /rig shows.
#[utoipa::path(post, path = "/estop", tag = "rig", responses((status = 204, description = "Latched, also for a restart"),
    (status = 503, body = Problem, content_type = "application/problem+json", description = "Latched, but only as long as the daemon runs: the disk refuses")))]
async fn estop(State(shared): State<Shared>, Extension(by): Extension<Caller>) -> Done {
    shared.daemon.estop(&by).await?;
    Ok(DONE)
}

/// Acknowledge the newest latched fault by its id: somebody has looked at the rig. Starts nothing.
#[utoipa::path(post, path = "/acknowledge", tag = "rig", request_body = Acknowledgement, responses((status = 204, description = "Acknowledged"),
    (status = 409, body = Problem, content_type = "application/problem+json", description = "No fault is latched, another one is newer (`fault`), or the rig is still coming to rest")))]
async fn acknowledge(
    State(shared): State<Shared>,
    Extension(by): Extension<Caller>,
    headers: HeaderMap,
    text: Bytes,
) -> Done {
    let Acknowledgement { fault } = body::json(&headers, &text)?;
    shared.daemon.acknowledge(&by, &fault).await?;
    Ok(DONE)
}

/// Move one arm by hand, within the envelope.
#[utoipa::path(post, path = "/jog", tag = "rig", request_body = Jog, responses((status = 204, description = "Checked; the arm is on its way"),
    (status = 409, body = Problem, content_type = "application/problem+json", description = "The rig is busy, or holds a fault"),
    (status = 422, body = Problem, content_type = "application/problem+json", description = "Not within the envelope"),
    (status = 503, body = Problem, content_type = "application/problem+json", description = "The rig does not answer")))]
async fn jog(
    State(shared): State<Shared>,
    Extension(by): Extension<Caller>,
    headers: HeaderMap,
    text: Bytes,
) -> Done {
    let Jog { arm, angle_deg } = body::json(&headers, &text)?;
    let arm = match arm {
        ArmName::Light => Arm::Light,
        ArmName::Sensor => Arm::Sensor,
    };
    shared.daemon.jog(&by, arm, ArmAngle::from_deg(angle_deg)).await?;
    Ok(DONE)
}

/// Take both arms to rest.
#[utoipa::path(post, path = "/park", tag = "rig", responses((status = 204, description = "Checked; the arms are on their way"),
    (status = 409, body = Problem, content_type = "application/problem+json", description = "The rig is busy, or holds a fault"),
    (status = 422, body = Problem, content_type = "application/problem+json", description = "No way there within the envelope"),
    (status = 503, body = Problem, content_type = "application/problem+json", description = "The rig does not answer")))]
async fn park(State(shared): State<Shared>, Extension(by): Extension<Caller>) -> Done {
    shared.daemon.park(&by).await?;
    Ok(DONE)
}
