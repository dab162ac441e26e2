use axum::Json;
use axum::body::Bytes;
use axum::extract::{Extension, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::body;
use super::credential::COOKIE;
use super::peer::Peer;
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
async fn session(
    State(shared): State<Shared>,
    Extension(peer): Extension<Peer>,
    headers: HeaderMap,
) -> Json<Session> {
    Json(Session {
        needs_token: shared.access.role(peer, &HeaderMap::new()).is_none(),
        role: shared.access.role(peer, &headers),
    })
}

/// Sign in: keep the token in a cookie that scripts cannot read and other sites cannot use.
#[utoipa::path(post, path = "/session", tag = "access", request_body = SignIn,
    responses((status = 204, description = "Signed in")))]
async fn sign_in(
    State(shared): State<Shared>,
    Extension(peer): Extension<Peer>,
    headers: HeaderMap,
    text: Bytes,
) -> Result<impl IntoResponse, Problem> {
    let SignIn { token } = body::json(&headers, &text)?;
    let Some(role) = shared.access.role_of_token(&token) else {
        shared.metrics.refused("token");
        shared.access.refusals.log(|unlogged| {
            tracing::warn!(%peer, unlogged, "sign-in refused: the token is none of the daemon's token file");
        });
        return Err(Problem::new(
            StatusCode::UNAUTHORIZED,
            "this is no token of the daemon's token file",
        ));
    };
    tracing::info!(%peer, ?role, "signed in");
    // Over TLS, which a proxy speaks, a browser is to send it over TLS alone.
    let origin = headers
        .get(header::ORIGIN)
        .and_then(|origin| origin.to_str().ok());
    let secure = origin.is_some_and(|origin| origin.starts_with("https://"));
    Ok((
        StatusCode::NO_CONTENT,
        cookie(&token, if secure { "; Secure" } else { "" }),
    ))
}

/// Sign out: forget the token.
#[utoipa::path(delete, path = "/session", tag = "access", responses((status = 204, description = "Signed out")))]
async fn sign_out() -> impl IntoResponse {
    (StatusCode::NO_CONTENT, cookie("", "; Max-Age=0"))
}

/// Without a path of its own the cookie belongs to the API alone, wherever a proxy puts that (RFC 6265, 5.1.4): others
/// on the same host do not get it, and two daemons below one host do not get each other's.
fn cookie(token: &str, more: &str) -> AppendHeaders<[(header::HeaderName, String); 1]> {
    let value = format!("{COOKIE}={token}; HttpOnly; SameSite=Strict{more}");
    AppendHeaders([(header::SET_COOKIE, value)])
}
