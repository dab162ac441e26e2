use std::net::SocketAddr;
use std::num::NonZeroU32;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use governor::{DefaultDirectRateLimiter, Quota, RateLimiter};

use super::Limits;
use super::credential::Credential;
use super::peer::Peer;
use super::problem::Problem;
use super::refusals::Refusals;
use super::shared::Shared;
use super::site::Site;
use super::tokens::{Role, Tokens};
use crate::Caller;

/// Paths that stop the rig, or let it be used again: no request rate holds them up.
const NEVER_HELD_UP: [&str; 5] = [
    "/api/v1/estop",
    "/api/v1/finish",
    "/api/v1/stop",
    "/api/v1/pause",
    "/api/v1/acknowledge",
];
/// Whether requests to a path wait for nothing, and their connection is not closed to make room.
pub(crate) fn never_held_up(path: &str) -> bool {
    NEVER_HELD_UP.contains(&path)
}

/// Refusals that are logged one by one, each second; beyond, a stranger would fill the disk.
const LOGGED_REFUSALS: NonZeroU32 = NonZeroU32::new(20).expect("20 is not 0");
/// What somebody needs to say who asks over TCP, or through a relay.
const TOKEN_NEEDED: &str = "a token of the daemon's token file is needed: Authorization: Bearer TOKEN";

/// Who may use a listener, and how much.
///
/// Whoever presents a token may do what the token says. Without one, only the users of this computer who may operate
/// the Unix socket get in. An address is never a reason to trust anybody.
pub struct Access {
    site: Site,
    tokens: Option<Tokens>,
    requests: DefaultDirectRateLimiter,
    /// What was refused, for the log.
    pub(crate) refusals: Refusals,
}

impl Access {
    /// Access to a listener on `address`, `None` being a Unix socket, that is also known under `names`. Where there are
    /// no tokens, nobody gets in over TCP.
    pub fn new(
        address: Option<SocketAddr>,
        names: impl IntoIterator<Item = String>,
        tokens: Option<Tokens>,
        limits: &Limits,
    ) -> Self {
        Self {
            site: Site::new(address, names),
            tokens,
            requests: RateLimiter::direct(
                Quota::per_second(limits.requests_per_s).allow_burst(limits.requests_per_s),
            ),
            refusals: Refusals::new(LOGGED_REFUSALS),
        }
    }

    /// What the bearer of a token may do.
    pub(crate) fn role_of_token(&self, token: &str) -> Option<Role> {
        self.tokens.as_ref()?.role(token)
    }

    /// What somebody may do by what a request says and who is at the other end.
    pub(crate) fn role(&self, peer: Peer, headers: &HeaderMap) -> Option<Role> {
        match Credential::of(headers) {
            Credential::Bearer(token) | Credential::Cookie(token) => self.role_of_token(token),
            Credential::Other => None,
            Credential::None => is_trusted(peer, headers).then_some(Role::Operate),
        }
    }

    /// What a request may do, or why it is refused.
    fn admit(&self, peer: Peer, request: &Request) -> Result<Option<Role>, (&'static str, Problem)> {
        let (method, path) = (request.method(), request.uri().path());
        let safe = matches!(*method, Method::GET | Method::HEAD);
        let forbidden = |why: &str| Problem::new(StatusCode::FORBIDDEN, why);
        self.site
            .check(request.uri(), request.headers())
            .map_err(|why| ("site", forbidden(&why)))?;
        let role = self.role(peer, request.headers());
        if !open(path) {
            let needed = if safe { Role::Watch } else { Role::Operate };
            match role {
                None => return Err(self.stranger(peer, request.headers())),
                Some(role) if role < needed => {
                    return Err(("role", forbidden("this token may watch, not operate")));
                }
                Some(_) => {}
            }
            // Every browser says where a request comes from that it makes with a cookie and that changes something.
            let told = request.headers().contains_key(header::ORIGIN);
            if matches!(Credential::of(request.headers()), Credential::Cookie(_)) && !safe && !told {
                return Err(("site", forbidden("the header Origin is missing")));
            }
        }
        if !never_held_up(path) && self.requests.check().is_err() {
            let why = "more requests than the daemon answers; try again in a second";
            return Err(("rate", Problem::new(StatusCode::TOO_MANY_REQUESTS, why)));
        }
        Ok(role)
    }

    /// Why somebody is refused who may do nothing here.
    fn stranger(&self, peer: Peer, headers: &HeaderMap) -> (&'static str, Problem) {
        let unauthorized = |why: &str| ("token", Problem::new(StatusCode::UNAUTHORIZED, why));
        match (peer, Credential::of(headers)) {
            (Peer::Local { operates: false, .. }, Credential::None) => {
                let why = format!(
                    "{peer} may not operate the rig: allowed are root, the owner of the daemon's socket and the members of \
                     the socket's group, and whoever has a token"
                );
                ("user", Problem::new(StatusCode::FORBIDDEN, why))
            }
            (Peer::Local { .. }, Credential::None) => unauthorized(
                "this came through a relay, behind which anybody may be; a token of the daemon's token file is needed: \
                 Authorization: Bearer TOKEN",
            ),
            _ => unauthorized(TOKEN_NEEDED),
        }
    }
}

/// Whether a request without a token comes from a user of this computer who may operate the rig, and not from somebody
/// behind a relay of theirs: a relay says what it relays, and a browser, which cannot reach a Unix socket, what it is.
fn is_trusted(peer: Peer, headers: &HeaderMap) -> bool {
    const SIGNS: [&str; 5] = ["forwarded", "via", "x-real-ip", "origin", "referer"];
    let relayed = headers.keys().map(axum::http::HeaderName::as_str).any(|name| {
        SIGNS.contains(&name) || name.starts_with("x-forwarded-") || name.starts_with("sec-fetch-")
    });
    matches!(peer, Peer::Local { operates: true, .. }) && !relayed
}

/// Lets a request in, or refuses it and says so in the log.
pub(crate) async fn gate(State(shared): State<Shared>, mut request: Request, next: Next) -> Response {
    let peer = *request
        .extensions()
        .get::<Peer>()
        .expect("the server says who is at the other end");
    match shared.access.admit(peer, &request) {
        Ok(role) => {
            let name = match (peer, role) {
                (Peer::Tcp(_), Some(Role::Operate)) => format!("operator at {peer}"),
                (_, Some(Role::Watch)) => format!("watcher at {peer}"),
                _ => peer.to_string(),
            };
            request.extensions_mut().insert(Caller { name });
            next.run(request).await
        }
        Err((reason, problem)) => {
            shared.metrics.refused(reason);
            let (method, path) = (request.method(), request.uri().path());
            shared.access.refusals.log(|unlogged| {
                tracing::warn!(%peer, %method, path, reason, unlogged, "refused: {}", problem.detail());
            });
            let mut response = problem.into_response();
            let (name, value) = match reason {
                "token" => (header::WWW_AUTHENTICATE, "Bearer realm=\"goniod\""),
                "rate" => (header::RETRY_AFTER, "1"),
                _ => return response,
            };
            response
                .headers_mut()
                .insert(name, HeaderValue::from_static(value));
            response
        }
    }
}

/// Whether a path tells nothing of the rig: the page, which has its data from elsewhere, signing in, whether it lives.
fn open(path: &str) -> bool {
    matches!(path, "/" | "/health" | "/api/v1/session") || path.starts_with("/assets/")
}
