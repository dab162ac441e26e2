use axum::http::{HeaderMap, header};

/// The cookie in which a browser keeps its token.
pub(crate) const COOKIE: &str = "goniod";

/// How a request says who it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Credential<'a> {
    /// By a token in the header Authorization.
    Bearer(&'a str),
    /// By a token in a browser's cookie.
    Cookie(&'a str),
    /// By something that is not taken here, such as a password.
    Other,
    /// Not at all.
    None,
}

impl<'a> Credential<'a> {
    /// What the headers of a request say; Authorization outranks a cookie.
    pub(crate) fn of(headers: &'a HeaderMap) -> Self {
        if let Some(value) = headers.get(header::AUTHORIZATION) {
            let bearer = value.to_str().ok().and_then(|value| value.split_once(' '));
            return match bearer {
                Some((scheme, token)) if scheme.eq_ignore_ascii_case("bearer") => Self::Bearer(token.trim()),
                _ => Self::Other,
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
}
