use axum::Router;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use super::shared::Shared;

/// The page may use what this daemon serves, and nothing else may use or frame the page.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
    connect-src 'self'; frame-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'none'";

const HTML: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// The page: what belongs to it, with path and media type. All of it is in the binary.
const ASSETS: [(&str, &str, &str); 8] = [
    ("/", HTML, include_str!("../../assets/index.html")),
    (
        "/assets/page.css",
        "text/css; charset=utf-8",
        include_str!("../../assets/page.css"),
    ),
    ("/assets/now.js", SCRIPT, include_str!("../../assets/now.js")),
    ("/assets/page.js", SCRIPT, include_str!("../../assets/page.js")),
    ("/assets/plot.js", SCRIPT, include_str!("../../assets/plot.js")),
    ("/assets/rig.js", SCRIPT, include_str!("../../assets/rig.js")),
    (
        "/assets/icon.svg",
        "image/svg+xml",
        include_str!("../../assets/icon.svg"),
    ),
    // What a new job is made of.
    (
        "/assets/quickstart.toml",
        "application/toml",
        include_str!("../../../../config/jobs/quickstart.toml"),
    ),
];

pub(crate) fn routes() -> Router<Shared> {
    ASSETS
        .into_iter()
        .fold(Router::new(), |router, (path, media_type, text)| {
            router.route(
                path,
                get(async move |headers: HeaderMap| asset(&headers, media_type, text)),
            )
        })
}

/// An asset; a browser that has this version's already is told so.
fn asset(headers: &HeaderMap, media_type: &'static str, text: &'static str) -> Response {
    let tag = format!("\"{:x}\"", digest(text));
    let known = headers
        .get(header::IF_NONE_MATCH)
        .is_some_and(|known| known == tag.as_str());
    let about = [
        (header::CONTENT_TYPE, media_type.to_owned()),
        (header::CONTENT_SECURITY_POLICY, POLICY.to_owned()),
        // Asked for anew each time: after an update the old page would talk to a new daemon.
        (header::CACHE_CONTROL, "no-cache".to_owned()),
        (header::ETAG, tag),
    ];
    if known {
        return (StatusCode::NOT_MODIFIED, about).into_response();
    }
    (about, text).into_response()
}

/// Tells one version of an asset from another.
fn digest(text: &str) -> u64 {
    use std::hash::{DefaultHasher, Hasher};
    let mut hasher = DefaultHasher::new();
    hasher.write(text.as_bytes());
    hasher.finish()
}
