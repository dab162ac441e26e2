use std::net::SocketAddr;
use std::path::Path;

use goniod::http::{Access, Address, Limits, Listener, Tokens, serve};
use goniod::{Daemon, Settings};
use serde_json::Value;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader, Lines};
use tokio::net::TcpStream;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// A job that is done within a blink.
pub(crate) const JOB: &str =
    "specimen = \"test\"\n[[plane]]\ntheta_r_deg = 60\nreadings = 6\n[arc]\nreadings = 4\n";

/// A daemon with a simulated rig and a listener on a free port.
pub(crate) struct Service {
    pub(crate) address: SocketAddr,
    pub(crate) data: TempDir,
    pub(crate) daemon: Daemon,
    close: oneshot::Sender<()>,
    server: JoinHandle<std::io::Result<()>>,
}

/// An answer.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    head: String,
    pub(crate) body: Vec<u8>,
}

/// A daemon on an ideal rig.
pub(crate) fn settings(data: &Path) -> Settings {
    Settings {
        rig: "[sim]\nimperfections = \"none\"\n".to_owned(),
        rig_name: "test rig".to_owned(),
        data: data.to_owned(),
        clock: std::time::SystemTime::now,
    }
}

/// A token of the token file in a data folder.
pub(crate) fn token(data: &Path, role: &str) -> String {
    let text = std::fs::read_to_string(data.join("tokens.toml")).unwrap();
    text.parse::<toml::Table>().unwrap()[role]
        .as_str()
        .unwrap()
        .to_owned()
}

impl Service {
    pub(crate) async fn start() -> Self {
        Self::with(Limits::default()).await
    }

    /// Its tokens are in the file tokens.toml of the data folder.
    pub(crate) async fn with(limits: Limits) -> Self {
        let data = tempfile::tempdir().unwrap();
        let daemon = Daemon::open(settings(data.path())).await.unwrap();
        let listener = Listener::bind(&"127.0.0.1:0".parse().unwrap()).await.unwrap();
        let Address::Tcp(address) = listener.address().unwrap() else {
            panic!("TCP was asked for");
        };
        let tokens = Tokens::open(&data.path().join("tokens.toml")).unwrap();
        let access = Access::new(Some(address), [], Some(tokens), &limits);
        let (close, closed) = oneshot::channel();
        let server = tokio::spawn(serve(listener, access, limits, daemon.clone(), async {
            let _ = closed.await;
        }));
        Self {
            address,
            data,
            daemon,
            close,
            server,
        }
    }

    /// A token of the token file.
    pub(crate) fn token(&self, role: &str) -> String {
        token(self.data.path(), role)
    }

    /// The header by which the bearer of a token says who it is.
    pub(crate) fn bearer(&self, role: &str) -> String {
        format!("Authorization: Bearer {}\r\n", self.token(role))
    }

    /// Sends a request as it stands, but for the end of its head, and reads the answer.
    pub(crate) async fn raw(&self, head: &str, body: &[u8]) -> Answer {
        let mut stream = TcpStream::connect(self.address).await.unwrap();
        stream
            .write_all(format!("{head}Connection: close\r\n\r\n").as_bytes())
            .await
            .unwrap();
        // Whoever is refused for its head may close before the body is sent.
        let _ = stream.write_all(body).await;
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer).await;
        let end = answer
            .windows(4)
            .position(|four| four == b"\r\n\r\n")
            .expect("an answer has a head");
        let head = String::from_utf8(answer[..end].to_vec()).unwrap();
        Answer {
            status: head.split(' ').nth(1).unwrap().parse().unwrap(),
            body: answer[end + 4..].to_vec(),
            head,
        }
    }

    /// Sends an operator's request with headers, each ending in a line break, and a body.
    pub(crate) async fn ask(&self, method: &str, path: &str, headers: &str, body: &str) -> Answer {
        let headers = format!("{}{headers}", self.bearer("operate"));
        self.ask_as_stranger(method, path, &headers, body).await
    }

    /// Sends a request that says who it is by these headers alone.
    pub(crate) async fn ask_as_stranger(
        &self,
        method: &str,
        path: &str,
        headers: &str,
        body: &str,
    ) -> Answer {
        let (host, length) = (self.address, body.len());
        let head =
            format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n{headers}");
        self.raw(&head, body.as_bytes()).await
    }

    pub(crate) async fn get(&self, path: &str) -> Answer {
        self.ask("GET", path, "", "").await
    }

    pub(crate) async fn post(&self, path: &str) -> Answer {
        self.ask("POST", path, "", "").await
    }

    /// Queues [`JOB`] and returns its id.
    pub(crate) async fn submit(&self) -> String {
        let answer = self
            .ask(
                "POST",
                "/api/v1/jobs?name=job.toml",
                "Content-Type: application/toml\r\n",
                JOB,
            )
            .await;
        assert_eq!(answer.status, 201, "{answer:?}");
        answer.json()["id"].as_str().unwrap().to_owned()
    }

    /// Opens a stream of events.
    pub(crate) async fn watch(&self, headers: &str) -> Watch {
        let mut stream = TcpStream::connect(self.address).await.unwrap();
        let head = format!(
            "GET /api/v1/events HTTP/1.1\r\nHost: {}\r\n{}{headers}\r\n",
            self.address,
            self.bearer("operate")
        );
        stream.write_all(head.as_bytes()).await.unwrap();
        let mut lines = BufReader::new(stream).lines();
        let status = lines.next_line().await.unwrap().unwrap();
        Watch {
            status: status.split(' ').nth(1).unwrap().parse().unwrap(),
            lines,
        }
    }

    /// Ends it; returns once everything has ended.
    pub(crate) async fn end(self) {
        self.daemon.shutdown().await;
        let _ = self.close.send(());
        self.server.await.unwrap().unwrap();
    }
}

impl Answer {
    pub(crate) fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let headers = self.head.lines().skip(1).filter_map(|line| line.split_once(": "));
        headers
            .into_iter()
            .find(|(n, _)| n.eq_ignore_ascii_case(name))
            .map(|(_, value)| value)
    }

    /// Checks that it is a problem document of a status, and returns its detail.
    #[track_caller]
    pub(crate) fn problem(&self, status: u16) -> String {
        assert_eq!(self.status, status, "{self:?}");
        assert_eq!(
            self.header("content-type"),
            Some("application/problem+json"),
            "{self:?}"
        );
        let problem = self.json();
        assert_eq!(problem["status"], status);
        assert_eq!(problem["type"], "about:blank");
        problem["detail"].as_str().unwrap().to_owned()
    }
}

/// A stream of events.
pub(crate) struct Watch {
    pub(crate) status: u16,
    lines: Lines<BufReader<TcpStream>>,
}

impl Watch {
    /// The next event that is one, with its id; pictures of the rig are passed over. `None` at the end of the stream.
    pub(crate) async fn next(&mut self) -> Option<(u64, Value)> {
        let mut id = None;
        while let Some(line) = self.lines.next_line().await.unwrap() {
            if let Some(text) = line.strip_prefix("id: ") {
                id = Some(text.parse().unwrap());
            } else if let Some(text) = line.strip_prefix("data: ") {
                let data = serde_json::from_str(text).unwrap();
                if let Some(id) = id.take() {
                    return Some((id, data));
                }
            }
        }
        None
    }

    /// Reads on until an event that is looked for.
    ///
    /// # Panics
    /// At a fault that is not.
    pub(crate) async fn until(&mut self, wanted: impl Fn(&Value) -> bool) -> (u64, Value) {
        loop {
            let (id, event) = self.next().await.expect("the stream goes on");
            if wanted(&event) {
                return (id, event);
            }
            assert!(event["event"] != "fault", "{event}");
        }
    }
}
