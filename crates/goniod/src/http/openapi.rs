use utoipa::OpenApi;
use utoipa::openapi::path::Operation;
use utoipa::openapi::security::{
    ApiKey, ApiKeyValue, HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme,
};
use utoipa::openapi::{Content, Ref, RefOr, ResponseBuilder};
use utoipa_axum::router::OpenApiRouter;

use super::job_file::SpecimenTable;
use super::problem::{MEDIA_TYPE, Problem};
use super::shared::Shared;
use super::{credential, events, exports, jobs, rig, runs, session};
use crate::{Action, Event};

/// Path of the API; its version changes with what a client could notice.
pub(crate) const API: &str = "/api/v1";

/// Refusals that every operation may answer with.
const REFUSALS: [(&str, &str); 8] = [
    ("400", "Not understood"),
    ("401", "A token is needed"),
    (
        "403",
        "The token may only watch, or the request comes from another site",
    ),
    ("408", "It did not arrive in time"),
    ("413", "The body is too large"),
    ("415", "Not a media type that is taken here"),
    ("422", "What was handed in is wrong"),
    ("429", "Too many requests"),
];

#[derive(OpenApi)]
#[openapi(
    info(
        title = "goniod",
        description = "A gonio-reflectometer with two arms: its queue, its runs, and the hands that stop it. \
            Errors are RFC 9457 problem documents."
    ),
    components(schemas(Problem, Event, Action, SpecimenTable)),
    tags(
        (name = "rig", description = "The arms, and the hands that stop them"),
        (name = "queue", description = "Jobs, in the order in which they are worked off"),
        (name = "runs", description = "What was measured, with its files"),
        (name = "events", description = "What happens, as it happens"),
        (name = "access", description = "Who may use it"),
    )
)]
struct Document;

/// The API with the document that describes it.
pub(crate) fn api() -> (axum::Router<Shared>, utoipa::openapi::OpenApi) {
    let routes = OpenApiRouter::new()
        .merge(jobs::routes())
        .merge(runs::routes())
        .merge(exports::routes())
        .merge(rig::routes())
        .merge(events::routes())
        .merge(session::routes());
    let (router, mut document) = OpenApiRouter::with_openapi(Document::openapi())
        .nest(API, routes)
        .split_for_parts();
    complete(&mut document);
    (router, document)
}

/// The OpenAPI document of the API.
pub fn openapi() -> utoipa::openapi::OpenApi {
    api().1
}

/// Adds what is the same for every operation: the refusals, and how to say who one is.
fn complete(document: &mut utoipa::openapi::OpenApi) {
    let components = document.components.get_or_insert_default();
    components.add_security_scheme(
        "token",
        SecurityScheme::Http(HttpBuilder::new().scheme(HttpAuthScheme::Bearer).build()),
    );
    components.add_security_scheme(
        "cookie",
        SecurityScheme::ApiKey(ApiKey::Cookie(ApiKeyValue::new(credential::COOKIE))),
    );
    // Where the daemon has no tokens, none is needed.
    document.security = Some(vec![
        SecurityRequirement::default(),
        SecurityRequirement::new::<_, [&str; 0], &str>("token", []),
        SecurityRequirement::new::<_, [&str; 0], &str>("cookie", []),
    ]);
    for item in document.paths.paths.values_mut() {
        let operations = [&mut item.get, &mut item.post, &mut item.patch, &mut item.delete];
        for operation in operations.into_iter().flatten() {
            refusals(operation);
        }
    }
}

fn refusals(operation: &mut Operation) {
    for (status, why) in REFUSALS {
        let content = Content::new(Some(Ref::from_schema_name("Problem")));
        let response = ResponseBuilder::new()
            .description(why)
            .content(MEDIA_TYPE, content)
            .build();
        let responses = &mut operation.responses.responses;
        responses.entry(status.to_owned()).or_insert(RefOr::T(response));
    }
}
