use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::access::{COOKIE, Credential};
use super::body;
use super::problem::Problem;
use super::shared::Shared;
use super::tokens::Role;

/// A token to sign in with.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct SignIn {
    /// Token of the daemon's token file.
    token: String,
}

/// What the one who asks may do.
#[derive(Serialize, ToSchema)]
struct Session {
    /// Whether a token is needed here.
    needs_token: bool,
    /// "operate", "watch", or nothing without a token.
    role: Option<Role>,
}

pub(crate) fn routes() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(session, sign_in, sign_out))
}

/// Tell what the one who asks may do.
#[utoipa::path(get, path = "/session", tag = "access", responses((status = 200, body = Session)))]
async fn session(State(shared): State<Shared>, headers: HeaderMap) -> Json<Session> {
    Json(Session {
        needs_token: shared.access.needs_token(),
        role: shared.access.role(Credential::of(&headers).token()),
    })
}

/// Sign in: keep the token in a cookie that scripts cannot read and other sites cannot use.
#[utoipa::path(post, path = "/session", tag = "access", request_body = SignIn,
    responses((status = 204, description = "Signed in")))]
async fn sign_in(
    State(shared): State<Shared>,
    headers: HeaderMap,
    text: Bytes,
) -> Result<impl IntoResponse, Problem> {
    let SignIn { token } = body::json(&headers, &text)?;
    if shared.access.role(Some(&token)).is_none() {
        shared.metrics.refused("token");
        return Err(Problem::new(
            StatusCode::UNAUTHORIZED,
            "this is no token of the daemon's token file",
        ));
    }
    // Where no tokens are needed there is nothing to keep, and what was sent may be anything.
    let kept = if shared.access.needs_token() { &token } else { "" };
    Ok((StatusCode::NO_CONTENT, cookie(kept, "")))
}

/// Sign out: forget the token.
#[utoipa::path(delete, path = "/session", tag = "access", responses((status = 204, description = "Signed out")))]
async fn sign_out() -> impl IntoResponse {
    (StatusCode::NO_CONTENT, cookie("", "; Max-Age=0"))
}

fn cookie(token: &str, age: &str) -> AppendHeaders<[(header::HeaderName, String); 1]> {
    let value = format!("{COOKIE}={token}; Path=/; HttpOnly; SameSite=Strict{age}");
    AppendHeaders([(header::SET_COOKIE, value)])
}
