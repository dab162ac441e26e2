use std::path::PathBuf;

use serde::Deserialize;
use ureq::http::StatusCode;

/// Why the daemon did not do what was asked of it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// An address is neither of a computer and a port nor of a socket file.
    #[error("{address:?} is no address of a daemon, allowed: unix:PATH, http://HOST:PORT, https://HOST/PATH")]
    Address {
        /// The address as given.
        address: String,
    },
    /// A token file cannot be read.
    #[error("cannot read the token file {}", .path.display())]
    TokenFile {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file of certificates cannot be read, or holds none.
    #[error("--ca: cannot read the certificates in {}", .path.display())]
    Authorities {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A token file holds no token.
    #[error("token file {} holds no token: allowed are one token alone, or the daemon's tokens.toml", .path.display())]
    NoToken {
        /// Which.
        path: PathBuf,
    },
    /// It does not answer.
    #[error("cannot reach the daemon at {address}{remedy}")]
    Unreachable {
        /// Where it was looked for.
        address: String,
        /// What can be done, from a semicolon on.
        remedy: String,
        /// Why not.
        source: Box<ureq::Error>,
    },
    /// It refuses.
    #[error("{0}")]
    Refused(Refused),
    /// What it says is not what this version understands.
    #[error("the daemon at {address} says what this version of gonioctl does not understand")]
    Garbled {
        /// Where it is.
        address: String,
        /// What is wrong with it.
        source: serde_json::Error,
    },
}

/// A request that the daemon refused.
#[derive(Debug)]
pub struct Refused {
    /// HTTP status.
    status: StatusCode,
    /// What was wrong, in the daemon's words.
    detail: String,
}

impl Refused {
    /// From an answer's status and body, a problem document where all is well.
    pub(super) fn new(status: StatusCode, body: &str) -> Self {
        #[derive(Deserialize)]
        struct Problem {
            detail: String,
        }
        let problem: Option<Problem> = serde_json::from_str(body).ok();
        Self {
            status,
            detail: problem.map_or_else(|| status.to_string(), |problem| problem.detail),
        }
    }

    /// Whether what was handed in is wrong, rather than the moment.
    pub fn invalid(&self) -> bool {
        self.status == StatusCode::UNPROCESSABLE_ENTITY
    }

    /// Whether a token is needed, and none that is known was given.
    pub fn unauthorized(&self) -> bool {
        self.status == StatusCode::UNAUTHORIZED
    }

    /// Whether there is no such thing.
    pub fn not_found(&self) -> bool {
        self.status == StatusCode::NOT_FOUND
    }
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let hint = match self.status {
            StatusCode::UNAUTHORIZED => {
                " (give it with --token-file; the daemon keeps it in tokens.toml of its data folder)"
            }
            _ => "",
        };
        write!(f, "the daemon refuses: {}{hint}", self.detail)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_says_what_the_daemon_said() {
        let body = r#"{"type":"about:blank","title":"Conflict","status":409,"detail":"nothing runs"}"#;
        let refused = Refused::new(StatusCode::CONFLICT, body);
        assert_eq!(refused.to_string(), "the daemon refuses: nothing runs");
        assert!(!refused.invalid());
        let other = Refused::new(StatusCode::BAD_GATEWAY, "<html>");
        assert_eq!(other.to_string(), "the daemon refuses: 502 Bad Gateway");
        let token = Refused::new(StatusCode::UNAUTHORIZED, body);
        assert!(token.to_string().contains("--token-file"), "{token}");
    }
}
