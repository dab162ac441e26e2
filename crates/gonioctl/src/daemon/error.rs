use goniod::Status;
use serde::Deserialize;
use ureq::http::StatusCode;

/// Why the daemon did not do what was asked of it.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ClientError {
    /// It does not answer.
    #[error(
        "cannot reach the daemon at {address}; is it running (`systemctl status goniod`), and is the address right (--daemon)?"
    )]
    Unreachable {
        /// Where it was looked for.
        address: String,
        /// Why not.
        source: Box<ureq::Error>,
    },
    /// It refuses.
    #[error("{0}")]
    Refused(Refused),
    /// There is nothing to do it with.
    #[error("{0}")]
    Absent(&'static str),
    /// It could not begin now.
    #[error("the daemon cannot run this now: {0}")]
    Busy(String),
    /// A job ended before it had a run.
    #[error("{why}")]
    Unbegun {
        /// What kept it from beginning.
        why: String,
        /// How the command ends.
        status: Status,
    },
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
pub(crate) struct Refused {
    /// HTTP status.
    pub(crate) status: StatusCode,
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
    pub(crate) fn invalid(&self) -> bool {
        self.status == StatusCode::UNPROCESSABLE_ENTITY
    }
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let hint = match self.status {
            StatusCode::UNAUTHORIZED => " (give it with --token-file)",
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
