//! What stands behind the question mark of an address: only what the OpenAPI document names, and told where it is wrong.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::{FromRequestParts, MatchedPath, Query, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer};
use utoipa::openapi::path::{Operation, ParameterIn};
use utoipa::openapi::{OpenApi, RefOr};

use super::problem::Problem;

/// The keys of the query of every operation, by its path.
#[derive(Clone, Debug)]
pub(crate) struct QueryKeys(Arc<BTreeMap<(String, &'static str), Vec<String>>>);

impl QueryKeys {
    /// Those that a document names.
    pub(crate) fn of(document: &OpenApi) -> Self {
        let mut keys = BTreeMap::new();
        for (path, item) in &document.paths.paths {
            let methods = [
                ("GET", &item.get),
                ("POST", &item.post),
                ("PUT", &item.put),
                ("PATCH", &item.patch),
                ("DELETE", &item.delete),
            ];
            for (method, operation) in methods {
                if let Some(operation) = operation {
                    keys.insert((path.clone(), method), names(operation));
                }
            }
        }
        Self(Arc::new(keys))
    }

    /// Why a query is refused.
    fn refuse(&self, method: &Method, path: &str, query: &[(String, String)]) -> Option<String> {
        let method = match *method {
            Method::HEAD => "GET",
            ref other => other.as_str(),
        };
        let known = self.0.iter().find(|((p, m), _)| p == path && *m == method);
        let (_, known) = known?;
        let (unknown, _) = query.iter().find(|(key, _)| !known.contains(key))?;
        Some(match known.as_slice() {
            [] => format!("unknown query key {unknown:?}: {path} takes none"),
            known => format!("unknown query key {unknown:?}: {path} takes {}", known.join(", ")),
        })
    }
}

fn names(operation: &Operation) -> Vec<String> {
    let parameters = operation.parameters.iter().flatten();
    // Ours stand in their operation, none elsewhere.
    let own = parameters.filter_map(|parameter| match parameter {
        RefOr::T(parameter) => Some(parameter),
        RefOr::Ref(_) => None,
    });
    let query = own.filter(|parameter| parameter.parameter_in == ParameterIn::Query);
    query.map(|parameter| parameter.name.clone()).collect()
}

/// Refuses a query with a key that its operation does not take: it would be ignored, and the answer be another one than
/// was asked for.
pub(crate) async fn only_known(
    State(keys): State<QueryKeys>,
    path: MatchedPath,
    request: Request,
    next: Next,
) -> Response {
    let why = match Query::<Vec<(String, String)>>::try_from_uri(request.uri()) {
        Ok(Query(query)) => keys.refuse(request.method(), path.as_str(), &query),
        Err(error) => Some(error.body_text()),
    };
    match why {
        Some(why) => Problem::new(StatusCode::BAD_REQUEST, why).into_response(),
        None => next.run(request).await,
    }
}

/// The query of a request; one that is wrong is told with what is wrong about it.
pub(crate) struct Asked<T>(pub(crate) T);

impl<S: Sync, T: DeserializeOwned> FromRequestParts<S> for Asked<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Self, Problem> {
        let Query(asked) = Query::try_from_uri(&parts.uri)
            .map_err(|error| Problem::new(StatusCode::BAD_REQUEST, error.body_text()))?;
        Ok(Self(asked))
    }
}

/// A place in the queue or the history that a query names: what the store and the document call a whole number of 64 bits.
pub(crate) fn place<'de, D: Deserializer<'de>>(value: D) -> Result<Option<u64>, D::Error> {
    let place = u64::deserialize(value)?;
    match i64::try_from(place) {
        Ok(_) => Ok(Some(place)),
        Err(_) => Err(D::Error::custom(format!(
            "{place} is no place, allowed are 0 … {}",
            i64::MAX
        ))),
    }
}

/// An answer with the address of what follows on it: this one's, with another query.
pub(crate) fn with_next(mut answer: Response, query: Option<Vec<(&'static str, String)>>) -> Response {
    if let Some(query) = query {
        let query: Vec<String> = query
            .iter()
            .map(|(key, value)| format!("{key}={}", encoded(value)))
            .collect();
        let link = format!("<?{}>; rel=\"next\"", query.join("&"));
        let link = HeaderValue::from_str(&link).expect("letters of ASCII only");
        answer.headers_mut().insert(header::LINK, link);
    }
    answer
}

/// Percent-encoded for a query (RFC 3986, unreserved characters).
pub(crate) fn encoded(text: &str) -> String {
    let byte = |byte: u8| match byte {
        byte if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) => char::from(byte).to_string(),
        byte => format!("%{byte:02X}"),
    };
    text.bytes().map(byte).collect()
}
