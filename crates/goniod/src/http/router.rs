use std::any::Any;

use axum::http::{HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router, middleware};
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::csrf::CsrfLayer;
use tower_http::limit::RequestBodyLimitLayer;
use tower_http::set_header::SetResponseHeaderLayer;
use tower_http::timeout::TimeoutLayer;

use super::keys::QueryKeys;
use super::openapi::{API, api};
use super::problem::{Problem, only_problems};
use super::shared::Shared;
use super::{Limits, access, keys, metrics, page};

/// Everything that is answered, behind all that a request must pass first.
pub(crate) fn router(shared: Shared, limits: &Limits) -> Router {
    let (api, document) = api();
    let api = api.route_layer(middleware::from_fn_with_state(
        QueryKeys::of(&document),
        keys::only_known,
    ));
    let nowhere = async || Problem::new(StatusCode::NOT_FOUND, "there is nothing at this address");
    api.route(&format!("{API}/openapi.json"), get(async move || Json(document)))
        .route("/health", get(health))
        .route("/metrics", get(metrics::show))
        .merge(page::routes())
        .fallback(nowhere)
        // From the inside out.
        .layer(TimeoutLayer::with_status_code(
            StatusCode::REQUEST_TIMEOUT,
            limits.answer,
        ))
        .layer(RequestBodyLimitLayer::new(limits.body))
        .layer(CsrfLayer::new())
        .layer(middleware::from_fn_with_state(shared.clone(), access::gate))
        .layer(CatchPanicLayer::custom(panicked))
        .layer(middleware::map_response(only_problems))
        .layer(middleware::from_fn_with_state(shared.clone(), metrics::count))
        .layer(header_unless_set(header::CACHE_CONTROL, "no-store"))
        .layer(header_unless_set(header::REFERRER_POLICY, "no-referrer"))
        .layer(header_unless_set(header::X_FRAME_OPTIONS, "DENY"))
        .layer(header_unless_set(header::X_CONTENT_TYPE_OPTIONS, "nosniff"))
        .with_state(shared)
}

/// Whether the daemon answers.
async fn health() -> &'static str {
    "ok\n"
}

fn header_unless_set(name: HeaderName, value: &'static str) -> SetResponseHeaderLayer<HeaderValue> {
    SetResponseHeaderLayer::if_not_present(name, HeaderValue::from_static(value))
}

/// A handler's panic is ours alone to mend: the one who asked learns no more than that.
fn panicked(_: Box<dyn Any + Send + 'static>) -> Response {
    Problem::new(
        StatusCode::INTERNAL_SERVER_ERROR,
        "the daemon failed to answer; its log says why",
    )
    .into_response()
}
