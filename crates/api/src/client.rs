//! The client of the daemon's HTTP API.

mod error;
mod place;
mod post;
mod roots;
mod stream;
mod unix;

use std::io::{BufReader, Read};
use std::path::Path;
use std::time::Duration;

use serde::Deserialize;
use serde::Serialize;
use serde::de::DeserializeOwned;
use ureq::http::{Method, Request};
use ureq::tls::TlsConfig;
use ureq::{Agent, Body, SendBody};

pub use error::{ClientError, Refused};
pub use post::{PostError, post_json};
pub use stream::{Message, ServerSentEvent, Stream};

use crate::{Action, Job, JobId, Jog, RigView, RunView};
use place::Place;
use roots::roots;
use unix::{NoNames, UnixConnector};

/// A daemon on this machine answers at once; one at the end of a poor line should have by then.
const CONNECT: Duration = Duration::from_secs(5);

/// A quiet stream of events says every ten seconds that it lives; one that says nothing for so long is dead.
const QUIET: Duration = Duration::from_secs(30);

/// What an address behind a TLS proxy begins with.
const HTTPS: &str = "https://";

/// What the address of a socket file begins with.
const UNIX: &str = "unix:";

/// Speaks to a daemon over HTTP, on TCP or on a socket file. Every request blocks until it is answered.
pub struct Client {
    agent: Agent,
    /// As given, for messages.
    address: String,
    /// Where it was looked for, unless it was named.
    place: Option<Place>,
    /// What paths are appended to.
    base: String,
    token: Option<String>,
}

impl Client {
    /// The client of the daemon at an address, else of the daemon of this computer: on a socket where it listens on one,
    /// else over TCP. Asks nothing yet.
    ///
    /// It reads its token from a file where one is named, and takes the word of the authorities in the file `ca`, else of
    /// those of the system, for who a daemon behind https is.
    ///
    /// # Errors
    /// An address that is none, a token file that holds none, a file of certificates that holds none.
    pub fn new(
        address: Option<&str>,
        token_file: Option<&Path>,
        ca: Option<&Path>,
    ) -> Result<Self, ClientError> {
        let (address, place) = match address {
            Some(address) => (address.trim_end_matches('/').to_owned(), None),
            None => {
                let place = Place::find();
                (place.address.clone(), Some(place))
            }
        };
        let mut tls = TlsConfig::builder();
        if address.starts_with(HTTPS) {
            tls = tls.root_certs(roots(ca)?);
        }
        // No proxy of the environment: a proxy of the daemon's is its address.
        let config = Agent::config_builder()
            .tls_config(tls.build())
            .proxy(None)
            .http_status_as_error(false)
            .max_redirects(0)
            .timeout_connect(Some(CONNECT))
            .build();
        let (agent, base) = match address.strip_prefix(UNIX) {
            Some(path) => {
                let connector = UnixConnector::new(path);
                let agent = Agent::with_parts(config, connector, NoNames);
                (agent, "http://localhost".to_owned())
            }
            None => {
                if !address.starts_with("http://") && !address.starts_with(HTTPS) {
                    return Err(ClientError::Address { address });
                }
                (Agent::new_with_config(config), address.clone())
            }
        };
        // On the socket of this computer's daemon a user is known without one.
        let known = place.is_some() && address.starts_with(UNIX);
        let token_file = token_file.filter(|_| !known);
        let token = token_file.map(token).transpose()?;
        Ok(Self {
            agent,
            address,
            place,
            base,
            token,
        })
    }

    /// Reads what is at a path below the API.
    ///
    /// # Errors
    /// The daemon does not answer, or refuses.
    pub fn read<T: DeserializeOwned>(&self, path: &str) -> Result<T, ClientError> {
        let answer = self.send(Method::GET, path, &[], SendBody::none())?;
        self.decode(answer)
    }

    /// Returns how the rig is.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn rig(&self) -> Result<RigView, ClientError> {
        self.read("/rig")
    }

    /// Returns the latest jobs that are over, and the queue, in their order.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn jobs(&self) -> Result<Vec<Job>, ClientError> {
        self.read("/jobs")
    }

    /// Returns all jobs there ever were, the queue among them, in their order.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn all_jobs(&self) -> Result<Vec<Job>, ClientError> {
        let mut jobs: Vec<Job> = self.jobs()?;
        let first = |jobs: &[Job]| {
            jobs.iter()
                .filter(|job| job.state.over())
                .map(|job| job.place)
                .min()
        };
        let mut before = first(&jobs);
        while let Some(place) = before {
            let earlier: Vec<Job> = self.read(&format!("/jobs?limit=200&before={place}"))?;
            before = first(&earlier);
            jobs.extend(earlier);
        }
        jobs.sort_by_key(|job| job.place);
        Ok(jobs)
    }

    /// Returns one job.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn job(&self, id: JobId) -> Result<Job, ClientError> {
        self.read(&format!("/jobs/{id}"))
    }

    /// Starts, resumes or cancels a job, and returns how it stands then.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn act_on_job(&self, id: JobId, action: Action) -> Result<Job, ClientError> {
        self.ask(&format!("/jobs/{id}/{action}"))
    }

    /// Returns a run.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn run(&self, id: &str) -> Result<RunView, ClientError> {
        self.read(&format!("/runs/{id}"))
    }

    /// Moves one arm by hand.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn jog(&self, jog: Jog) -> Result<(), ClientError> {
        self.act_on("/jog", &jog)
    }

    /// Reads the text at a path below the API.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn read_text(&self, path: &str) -> Result<String, ClientError> {
        let mut answer = self.send(Method::GET, path, &[], SendBody::none())?;
        answer.read_to_string().map_err(|error| self.unreachable(error))
    }

    /// Returns the runs, the newest first.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn runs(&self) -> Result<Vec<RunView>, ClientError> {
        self.read("/runs")
    }

    /// Reads the file at a path below the API, as it comes.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn download(&self, path: &str) -> Result<impl Read + use<>, ClientError> {
        Ok(self.send(Method::GET, path, &[], SendBody::none())?.into_reader())
    }

    /// Asks for an act that has no answer but that it was done or asked for.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn act(&self, path: &str) -> Result<(), ClientError> {
        self.send(Method::POST, path, &[], SendBody::none()).map(drop)
    }

    /// Asks for an act and reads the answer.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn ask<T: DeserializeOwned>(&self, path: &str) -> Result<T, ClientError> {
        let answer = self.send(Method::POST, path, &[], SendBody::none())?;
        self.decode(answer)
    }

    /// Hands in a text and reads the answer.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn hand_in<T: DeserializeOwned>(
        &self,
        path: &str,
        media_type: &str,
        text: &str,
    ) -> Result<T, ClientError> {
        // Not in chunks of unknown number, which not every proxy passes on.
        let length = text.len().to_string();
        let headers = [("content-type", media_type), ("content-length", &length)];
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
    /// As [`Client::read`].
    pub fn act_on(&self, path: &str, what: &impl Serialize) -> Result<(), ClientError> {
        let text = serde_json::to_string(what).map_err(|source| self.garbled(source))?;
        let length = text.len().to_string();
        let headers = [("content-type", "application/json"), ("content-length", &length)];
        let body = &mut text.as_bytes();
        self.send(Method::POST, path, &headers, SendBody::from_reader(body))
            .map(drop)
    }

    /// What happens from now on, or after an event that was seen.
    ///
    /// # Errors
    /// As [`Client::read`].
    pub fn events(&self, after: Option<u64>) -> Result<Stream, ClientError> {
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
        serde_json::from_str(&text).map_err(|source| self.garbled(source))
    }

    fn garbled(&self, source: serde_json::Error) -> ClientError {
        ClientError::Garbled {
            address: self.address.clone(),
            source,
        }
    }

    fn unreachable(&self, source: ureq::Error) -> ClientError {
        ClientError::Unreachable {
            address: self.address.clone(),
            remedy: match &self.place {
                _ if is_about_trust(&source) => {
                    "; its certificate is not of an authority that this computer knows: name the file of its authority with --ca"
                        .to_owned()
                }
                Some(place) => place.remedy(),
                None => "; is it running (`systemctl status goniod`), and is the address right (--daemon)?"
                    .to_owned(),
            },
            source: Box::new(source),
        }
    }
}

/// Whether the other end is there, and it is not known who it is.
fn is_about_trust(error: &ureq::Error) -> bool {
    let text = error.to_string();
    text.contains("certificate") || matches!(error, ureq::Error::Tls(_))
}

/// The token in a file: the daemon's own token file, of which the one that operates is taken, or a token alone.
fn token(path: &Path) -> Result<String, ClientError> {
    #[derive(Deserialize)]
    struct Tokens {
        operate: String,
    }
    let text = std::fs::read_to_string(path).map_err(|source| ClientError::TokenFile {
        path: path.to_owned(),
        source,
    })?;
    if let Ok(Tokens { operate }) = toml::from_str(&text) {
        return Ok(operate);
    }
    let token = text.trim();
    if token.is_empty() || !token.bytes().all(|byte| byte.is_ascii_graphic()) {
        return Err(ClientError::NoToken {
            path: path.to_owned(),
        });
    }
    Ok(token.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(address: &str) -> Result<Client, ClientError> {
        Client::new(Some(address), None, None)
    }

    #[test]
    fn an_address_is_checked_before_anything_is_asked() {
        assert!(client("http://127.0.0.1:4664/").is_ok());
        assert!(client("unix:/run/goniod/socket").is_ok());
        let error = client("127.0.0.1:4664").err().unwrap();
        assert!(error.to_string().contains("http://HOST:PORT"), "{error}");
        assert!(client("https://lab.example/rig/").is_ok());
    }

    #[test]
    fn nobody_there_is_told_with_the_address() {
        let directory = tempfile::tempdir().unwrap();
        for address in [
            "http://127.0.0.1:1".to_owned(),
            format!("unix:{}/none", directory.path().display()),
        ] {
            let error = client(&address).unwrap().act("/stop").unwrap_err();
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
