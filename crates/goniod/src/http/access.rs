use std::net::SocketAddr;
use std::num::NonZeroU32;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use governor::{DefaultDirectRateLimiter, Quota, RateLimiter};

use super::Limits;
use super::problem::Problem;
use super::serve::Peer;
use super::shared::Shared;
use super::site::Site;
use super::tokens::{Role, Tokens};
use crate::Caller;

/// The cookie in which a browser keeps its token.
pub(crate) const COOKIE: &str = "goniod";

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

/// Who may use a listener, and how much.
pub struct Access {
    site: Site,
    tokens: Option<Tokens>,
    requests: DefaultDirectRateLimiter,
    logged: DefaultDirectRateLimiter,
}

impl Access {
    /// Access to a listener on `address`, `None` being a Unix socket, that is also known under `names`. Without
    /// tokens, whoever reaches it may operate.
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
            logged: RateLimiter::direct(Quota::per_second(LOGGED_REFUSALS)),
        }
    }

    /// What the bearer of a token may do; everything where no tokens are needed.
    pub(crate) fn role(&self, token: Option<&str>) -> Option<Role> {
        match &self.tokens {
            None => Some(Role::Operate),
            Some(tokens) => tokens.role(token?),
        }
    }

    /// Whether tokens are needed.
    pub(crate) fn needs_token(&self) -> bool {
        self.tokens.is_some()
    }

    /// What a request may do, or why it is refused.
    fn admit(&self, request: &Request) -> Result<Option<Role>, (&'static str, Problem)> {
        let (method, path) = (request.method(), request.uri().path());
        let safe = matches!(*method, Method::GET | Method::HEAD);
        let forbidden = |why: &str| Problem::new(StatusCode::FORBIDDEN, why);
        self.site
            .check(request.uri(), request.headers())
            .map_err(|why| ("site", forbidden(&why)))?;
        let credential = Credential::of(request.headers());
        let role = self.role(credential.token());
        if !open(path) {
            let needed = if safe { Role::Watch } else { Role::Operate };
            match role {
                None => {
                    let why = "a token of the daemon's token file is needed: Authorization: Bearer TOKEN";
                    return Err(("token", Problem::new(StatusCode::UNAUTHORIZED, why)));
                }
                Some(role) if role < needed => {
                    return Err(("role", forbidden("this token may watch, not operate")));
                }
                Some(_) => {}
            }
            // Every browser says where a request comes from that it makes with a cookie and that changes something.
            let told = request.headers().contains_key(header::ORIGIN);
            if matches!(credential, Credential::Cookie(_)) && !safe && !told && self.needs_token() {
                return Err(("site", forbidden("the header Origin is missing")));
            }
        }
        if !never_held_up(path) && self.requests.check().is_err() {
            let why = "more requests than the daemon answers; try again in a second";
            return Err(("rate", Problem::new(StatusCode::TOO_MANY_REQUESTS, why)));
        }
        Ok(role)
    }
}

/// Lets a request in, or refuses it and says so in the log.
pub(crate) async fn gate(State(shared): State<Shared>, mut request: Request, next: Next) -> Response {
    let peer = request.extensions().get::<Peer>().cloned().unwrap_or_default();
    match shared.access.admit(&request) {
        Ok(role) => {
            let name = match role.filter(|_| shared.access.needs_token()) {
                Some(Role::Operate) => format!("operator at {peer}"),
                Some(Role::Watch) => format!("watcher at {peer}"),
                None => peer.to_string(),
            };
            request.extensions_mut().insert(Caller { name });
            next.run(request).await
        }
        Err((reason, problem)) => {
            shared.metrics.refused(reason);
            if shared.access.logged.check().is_ok() {
                let (method, path) = (request.method(), request.uri().path());
                tracing::warn!(%peer, %method, path, reason, "refused: {}", problem.detail());
            }
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

/// How a request says who it is.
pub(crate) enum Credential<'a> {
    Bearer(&'a str),
    Cookie(&'a str),
    None,
}

impl<'a> Credential<'a> {
    pub(crate) fn of(headers: &'a HeaderMap) -> Self {
        if let Some(value) = headers.get(header::AUTHORIZATION) {
            let bearer = value.to_str().ok().and_then(|value| value.split_once(' '));
            return match bearer {
                Some((scheme, token)) if scheme.eq_ignore_ascii_case("bearer") => Self::Bearer(token.trim()),
                _ => Self::None,
            };
        }
        let cookies = headers.get_all(header::COOKIE).iter();
        let mut pairs = cookies
            .filter_map(|value| value.to_str().ok())
            .flat_map(|value| value.split(';'))
            .filter_map(|pair| pair.trim().split_once('='));
        pairs
            .find(|(name, _)| *name == COOKIE)
            .map_or(Self::None, |(_, token)| Self::Cookie(token))
    }

    pub(crate) fn token(&self) -> Option<&'a str> {
        match self {
            Self::Bearer(token) | Self::Cookie(token) => Some(token),
            Self::None => None,
        }
    }
}
