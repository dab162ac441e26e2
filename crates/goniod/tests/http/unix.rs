//! Listening on a Unix socket: whose it is, and what stands where it should be.

use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt, symlink};
use std::os::unix::net::{UnixDatagram, UnixListener};
use std::path::{Path, PathBuf};

use goniod::http::{Access, Address, Limits, ListenError, Listener, Tokens, serve};
use goniod::{Daemon, Settings};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::UnixStream;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// A daemon that listens on a Unix socket alone.
struct Local {
    data: TempDir,
    path: PathBuf,
    daemon: Daemon,
    close: oneshot::Sender<()>,
    server: JoinHandle<std::io::Result<()>>,
}

impl Local {
    async fn start() -> Self {
        let data = tempfile::tempdir().unwrap();
        let path = data.path().join("goniod.sock");
        // What a killed daemon leaves behind.
        drop(UnixListener::bind(&path).unwrap());
        let settings = Settings {
            rig: String::new(),
            rig_name: "test rig".to_owned(),
            data: data.path().to_owned(),
            clock: std::time::SystemTime::now,
        };
        let daemon = Daemon::open(settings).await.unwrap();
        let listener = bind(&path).await.unwrap();
        let limits = Limits::default();
        let tokens = Tokens::open(&data.path().join("tokens.toml")).unwrap();
        let access = Access::new(None, [], Some(tokens), &limits);
        let (close, closed) = oneshot::channel::<()>();
        let server = tokio::spawn(serve(listener, access, limits, daemon.clone(), async {
            let _ = closed.await;
        }));
        Self {
            data,
            path,
            daemon,
            close,
            server,
        }
    }

    /// The status with which a request is answered, and the whole answer.
    async fn ask(&self, method: &str, path: &str, headers: &str) -> (u16, String) {
        let mut stream = UnixStream::connect(&self.path).await.unwrap();
        let request = format!(
            "{method} {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n{headers}Connection: close\r\n\r\n"
        );
        stream.write_all(request.as_bytes()).await.unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await.unwrap();
        (answer.split(' ').nth(1).unwrap().parse().unwrap(), answer)
    }

    async fn end(self) {
        self.daemon.shutdown().await;
        let _ = self.close.send(());
        self.server.await.unwrap().unwrap();
        assert!(!self.path.exists(), "the socket goes with its daemon");
    }
}

async fn bind(path: &Path) -> Result<Listener, ListenError> {
    Listener::bind(&format!("unix:{}", path.display()).parse().unwrap()).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_unix_socket_replaces_one_that_is_dead_and_not_one_that_lives() {
    let local = Local::start().await;
    assert_eq!(local.ask("GET", "/health", "").await.0, 200);
    let error = bind(&local.path).await.unwrap_err();
    assert!(matches!(error, ListenError::InUse { .. }), "{error}");
    assert_eq!(local.ask("GET", "/health", "").await.0, 200, "it still listens");
    assert_eq!(fs::metadata(&local.path).unwrap().mode() & 0o777, 0o660);
    local.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_owner_of_a_unix_socket_operates_without_a_token() {
    let local = Local::start().await;
    assert_eq!(local.ask("GET", "/api/v1/rig", "").await.0, 200);
    assert_eq!(local.ask("POST", "/api/v1/estop", "").await.0, 204);
    let (_, session) = local.ask("GET", "/api/v1/session", "").await;
    assert!(
        session.contains("\"needs_token\":false") && session.contains("operate"),
        "{session}"
    );
    local.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_behind_a_relay_of_the_unix_socket_gets_in_without_a_token() {
    let local = Local::start().await;
    let text = fs::read_to_string(local.data.path().join("tokens.toml")).unwrap();
    let token = text.parse::<toml::Table>().unwrap()["operate"]
        .as_str()
        .unwrap()
        .to_owned();
    for sign in [
        "Forwarded: for=192.0.2.1\r\n",
        "Via: 1.1 proxy\r\n",
        "X-Forwarded-For: 192.0.2.1\r\n",
        "X-Forwarded-Proto: https\r\n",
        "X-Real-IP: 192.0.2.1\r\n",
        "Origin: http://localhost\r\n",
        "Sec-Fetch-Mode: cors\r\n",
        "Authorization: Basic dXNlcjpwYXNzd29yZA==\r\n",
        "Authorization: Bearer 0\r\n",
        "Cookie: goniod=0\r\n",
    ] {
        let (status, answer) = local.ask("POST", "/api/v1/stop", sign).await;
        assert_eq!(status, 401, "{sign}{answer}");
        assert!(answer.contains("token"), "{answer}");
        if !sign.starts_with("Authorization") {
            let bearer = format!("{sign}Authorization: Bearer {token}\r\n");
            assert_eq!(local.ask("GET", "/api/v1/rig", &bearer).await.0, 200, "{sign}");
        }
    }
    local.end().await;
}

#[tokio::test]
async fn whatever_is_no_dead_socket_stays_where_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("goniod.db"), "a store").unwrap();
    fs::write(at("empty"), "").unwrap();
    fs::create_dir(at("folder")).unwrap();
    drop(UnixListener::bind(at("dead")).unwrap());
    symlink(at("dead"), at("link to a dead socket")).unwrap();
    symlink(at("goniod.db"), at("link to a file")).unwrap();
    symlink(at("nowhere"), at("link to nothing")).unwrap();
    let _living = UnixListener::bind(at("living")).unwrap();
    let _datagrams = UnixDatagram::bind(at("datagrams")).unwrap();
    rustix::fs::mknodat(
        rustix::fs::CWD,
        at("pipe"),
        rustix::fs::FileType::Fifo,
        rustix::fs::Mode::from_raw_mode(0o600),
        0,
    )
    .unwrap();
    for (name, what) in [
        ("goniod.db", "a file"),
        ("empty", "a file"),
        ("folder", "a folder"),
        ("link to a dead socket", "a symbolic link"),
        ("link to a file", "a symbolic link"),
        ("link to nothing", "a symbolic link"),
        ("pipe", "no socket"),
        ("living", "another program"),
        ("datagrams", "another program"),
    ] {
        let before = fs::symlink_metadata(at(name)).unwrap();
        let error = bind(&at(name)).await.unwrap_err().to_string();
        assert!(
            error.contains(what) && error.contains("--listen"),
            "{name}: {error}"
        );
        let after = fs::symlink_metadata(at(name)).unwrap();
        assert_eq!(
            (before.ino(), before.mode(), before.len()),
            (after.ino(), after.mode(), after.len()),
            "{name}"
        );
    }
    assert_eq!(fs::read_to_string(at("goniod.db")).unwrap(), "a store");
    assert!(at("dead").exists(), "not removed through a link either");
    let missing = bind(&at("missing").join("goniod.sock")).await.unwrap_err();
    assert!(matches!(missing, ListenError::NoFolder { .. }), "{missing}");
    assert!(!at("missing").exists());
}

#[tokio::test]
async fn a_daemon_that_ends_leaves_what_took_the_place_of_its_socket() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("goniod.sock");
    let listener = bind(&path).await.unwrap();
    assert_eq!(listener.address().unwrap(), Address::Unix(path.clone()));
    fs::remove_file(&path).unwrap();
    fs::write(&path, "something else").unwrap();
    fs::set_permissions(&path, Permissions::from_mode(0o600)).unwrap();
    drop(listener);
    assert_eq!(fs::read_to_string(&path).unwrap(), "something else");
}
