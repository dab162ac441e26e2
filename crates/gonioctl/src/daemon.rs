//! The client of the daemon's HTTP API.

mod error;
mod stream;
mod unix;

use std::io::BufReader;
use std::path::Path;
use std::time::Duration;

use anyhow::Context;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use ureq::http::{Method, Request};
use ureq::unversioned::resolver::DefaultResolver;
use ureq::{Agent, Body, SendBody};

pub(crate) use error::{ClientError, Refused};
pub(crate) use stream::Stream;

use crate::cli::DaemonArguments;
use unix::UnixConnector;

/// A daemon on this machine answers at once; one at the end of a poor line should have by then.
const CONNECT: Duration = Duration::from_secs(5);

/// A quiet stream of events says every ten seconds that it lives; one that says nothing for so long is dead.
const QUIET: Duration = Duration::from_secs(30);

/// Where a daemon listens unless told otherwise.
const USUAL: &str = "http://127.0.0.1:4664";

/// What the address of a socket file begins with.
const UNIX: &str = "unix:";

/// Handle of a daemon.
pub(crate) struct Daemon {
    agent: Agent,
    /// As given, for messages.
    address: String,
    /// What paths are appended to.
    base: String,
    token: Option<String>,
}

impl Daemon {
    /// A daemon at the address that the arguments name; asks nothing yet.
    ///
    /// # Errors
    /// An address that is none, a token file that holds none.
    pub(crate) fn new(arguments: &DaemonArguments) -> anyhow::Result<Self> {
        let address = arguments.daemon.as_deref().unwrap_or(USUAL);
        let address = address.trim_end_matches('/').to_owned();
        // No proxy: the daemon is here, or at the end of a tunnel.
        let config = Agent::config_builder()
            .proxy(None)
            .http_status_as_error(false)
            .max_redirects(0)
            .timeout_connect(Some(CONNECT))
            .build();
        let (agent, base) = match address.strip_prefix(UNIX) {
            Some(path) => {
                let connector = UnixConnector::new(path);
                let agent = Agent::with_parts(config, connector, DefaultResolver::default());
                (agent, "http://localhost".to_owned())
            }
            None => {
                anyhow::ensure!(
                    address.starts_with("http://"),
                    "{address:?} is no address of a daemon, allowed: http://HOST:PORT, unix:PATH"
                );
                (Agent::new_with_config(config), address.clone())
            }
        };
        let token = arguments.token_file.as_deref().map(token).transpose()?;
        Ok(Self {
            agent,
            address,
            base,
            token,
        })
    }

    /// Reads what is at a path below the API.
    ///
    /// # Errors
    /// The daemon does not answer, or refuses.
    pub(crate) fn read<T: DeserializeOwned>(&self, path: &str) -> Result<T, ClientError> {
        let answer = self.send(Method::GET, path, &[], SendBody::none())?;
        self.decode(answer)
    }

    /// Reads the text at a path below the API.
    ///
    /// # Errors
    /// As [`Daemon::read`].
    pub(crate) fn read_text(&self, path: &str) -> Result<String, ClientError> {
        let mut answer = self.send(Method::GET, path, &[], SendBody::none())?;
        answer.read_to_string().map_err(|error| self.unreachable(error))
    }

    /// Asks for an act that has no answer but that it was done or asked for.
    ///
    /// # Errors
    /// As [`Daemon::read`].
    pub(crate) fn act(&self, path: &str) -> Result<(), ClientError> {
        self.send(Method::POST, path, &[], SendBody::none()).map(drop)
    }

    /// Asks for an act and reads the answer.
    ///
    /// # Errors
    /// As [`Daemon::read`].
    pub(crate) fn ask<T: DeserializeOwned>(&self, path: &str) -> Result<T, ClientError> {
        let answer = self.send(Method::POST, path, &[], SendBody::none())?;
        self.decode(answer)
    }

    /// Hands in a text and reads the answer.
    ///
    /// # Errors
    /// As [`Daemon::read`].
    pub(crate) fn hand_in<T: DeserializeOwned>(
        &self,
        path: &str,
        media_type: &str,
        text: &str,
    ) -> Result<T, ClientError> {
        let headers = [("content-type", media_type)];
        let answer = self.send(
            Method::POST,
            path,
            &headers,
            SendBody::from_reader(&mut text.as_bytes()),
        )?;
        self.decode(answer)
    }

    /// Asks for an act that is described in JSON.
    ///
    /// # Errors
    /// As [`Daemon::read`].
    pub(crate) fn act_on(&self, path: &str, what: &Value) -> Result<(), ClientError> {
        let text = what.to_string();
        let headers = [("content-type", "application/json")];
        let body = &mut text.as_bytes();
        self.send(Method::POST, path, &headers, SendBody::from_reader(body))
            .map(drop)
    }

    /// What happens from now on, or after an event that was seen.
    ///
    /// # Errors
    /// As [`Daemon::read`].
    pub(crate) fn events(&self, after: Option<u64>) -> Result<Stream, ClientError> {
        let last = after.map(|id| id.to_string());
        let headers: Vec<_> = last.iter().map(|id| ("last-event-id", id.as_str())).collect();
        let body = self.send(Method::GET, "/events", &headers, SendBody::none())?;
        Ok(Stream::new(BufReader::new(body.into_reader())))
    }

    fn send(
        &self,
        method: Method,
        path: &str,
        headers: &[(&str, &str)],
        body: SendBody<'_>,
    ) -> Result<Body, ClientError> {
        let mut request = Request::builder()
            .method(method)
            .uri(format!("{}/api/v1{path}", self.base));
        for &(name, value) in headers {
            request = request.header(name, value);
        }
        if let Some(token) = &self.token {
            request = request.header("authorization", format!("Bearer {token}"));
        }
        let request = request
            .body(body)
            .map_err(|error| self.unreachable(error.into()))?;
        let request = self
            .agent
            .configure_request(request)
            .timeout_per_read(Some(QUIET))
            .build();
        let answer = self.agent.run(request).map_err(|error| self.unreachable(error))?;
        let (head, mut body) = answer.into_parts();
        if head.status.is_success() {
            return Ok(body);
        }
        let text = body.read_to_string().unwrap_or_default();
        Err(ClientError::Refused(Refused::new(head.status, &text)))
    }

    fn decode<T: DeserializeOwned>(&self, mut body: Body) -> Result<T, ClientError> {
        let text = body.read_to_string().map_err(|error| self.unreachable(error))?;
        serde_json::from_str(&text).map_err(|source| ClientError::Garbled {
            address: self.address.clone(),
            source,
        })
    }

    fn unreachable(&self, source: ureq::Error) -> ClientError {
        ClientError::Unreachable {
            address: self.address.clone(),
            source: Box::new(source),
        }
    }
}

/// The token in a file: the daemon's own token file, of which the one that operates is taken, or a token alone.
fn token(path: &Path) -> anyhow::Result<String> {
    #[derive(Deserialize)]
    struct Tokens {
        operate: String,
    }
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the token file {}", path.display()))?;
    if let Ok(Tokens { operate }) = toml::from_str(&text) {
        return Ok(operate);
    }
    let token = text.trim();
    anyhow::ensure!(
        !token.is_empty() && token.bytes().all(|byte| byte.is_ascii_graphic()),
        "token file {} holds no token: allowed are one token alone, or the daemon's tokens.toml",
        path.display()
    );
    Ok(token.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arguments(daemon: &str) -> DaemonArguments {
        DaemonArguments {
            daemon: Some(daemon.to_owned()),
            token_file: None,
        }
    }

    #[test]
    fn an_address_is_checked_before_anything_is_asked() {
        assert!(Daemon::new(&arguments("http://127.0.0.1:4664/")).is_ok());
        assert!(Daemon::new(&arguments("unix:/run/goniod/socket")).is_ok());
        let error = Daemon::new(&arguments("127.0.0.1:4664")).err().unwrap();
        assert!(error.to_string().contains("http://HOST:PORT"), "{error}");
    }

    #[test]
    fn nobody_there_is_told_with_the_address() {
        let directory = tempfile::tempdir().unwrap();
        for address in [
            "http://127.0.0.1:1".to_owned(),
            format!("unix:{}/none", directory.path().display()),
        ] {
            let error = Daemon::new(&arguments(&address))
                .unwrap()
                .act("/stop")
                .unwrap_err();
            assert!(matches!(error, ClientError::Unreachable { .. }), "{error}");
            assert!(error.to_string().contains(&address), "{error}");
        }
    }

    #[test]
    fn a_token_comes_alone_or_in_the_daemons_file() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("tokens");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            token(&path)
        };
        assert_eq!(read("abc123\n").unwrap(), "abc123");
        assert_eq!(read("watch = \"w\"\noperate = \"o\"\n").unwrap(), "o");
        assert!(read("\n").unwrap_err().to_string().contains("holds no token"));
        assert!(read("a b\n").is_err());
    }
}
