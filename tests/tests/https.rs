//! `gonioctl` speaks to a daemon behind a TLS proxy, below a path of its own.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;

use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ServerConfig, ServerConnection, StreamOwned};
use tempfile::TempDir;
use tests::Finished;

/// The path below which the proxy puts the daemon.
const BELOW: &str = "/lab/rig";
/// An authority of this test, which vouched for the certificate below and was thrown away.
const AUTHORITY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/tls/ca.pem");
const CERTIFICATE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/tls/localhost.pem");
const KEY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/tls/localhost.key");

/// A daemon behind a proxy; killed when dropped.
struct Behind {
    directory: TempDir,
    daemon: Child,
    proxy: SocketAddr,
}

impl Behind {
    fn start() -> Self {
        let directory = tempfile::tempdir().unwrap();
        let mut daemon = Command::new(env!("CARGO_BIN_EXE_e2e-goniod"))
            .args(["--data", "data", "--listen", "127.0.0.1:0"])
            .current_dir(directory.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut stdout = std::io::BufReader::new(daemon.stdout.take().unwrap());
        std::io::BufRead::read_line(&mut stdout, &mut line).unwrap();
        let to = line.trim().trim_start_matches("http://").parse().unwrap();
        Self {
            directory,
            daemon,
            proxy: proxy(to),
        }
    }

    fn gonioctl(&self, arguments: &[&str]) -> Finished {
        Command::new(env!("CARGO_BIN_EXE_e2e-gonioctl"))
            .args(arguments)
            .args([
                "--daemon",
                &format!("https://localhost:{}{BELOW}/", self.proxy.port()),
            ])
            .current_dir(self.directory.path())
            .env_remove("GONIOD_TOKEN_FILE")
            .env_remove("RUST_LOG")
            .output()
            .unwrap()
            .into()
    }
}

impl Drop for Behind {
    fn drop(&mut self) {
        let _ = self.daemon.kill();
        let _ = self.daemon.wait();
    }
}

/// Starts a TLS proxy that passes each request on, without the path below which it is.
fn proxy(to: SocketAddr) -> SocketAddr {
    let certificates = CertificateDer::pem_file_iter(CERTIFICATE)
        .unwrap()
        .map(Result::unwrap)
        .collect();
    let key = PrivateKeyDer::from_pem_file(KEY).unwrap();
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(certificates, key)
        .unwrap();
    let config = Arc::new(config);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for client in listener.incoming().map_while(Result::ok) {
            let connection = ServerConnection::new(config.clone()).unwrap();
            // A client that trusts another authority breaks off.
            std::thread::spawn(move || pass_on(StreamOwned::new(connection, client), to));
        }
    });
    address
}

/// Passes on one request and its answer.
fn pass_on(mut client: StreamOwned<ServerConnection, TcpStream>, to: SocketAddr) -> std::io::Result<()> {
    let mut head = Vec::new();
    let mut byte = [0];
    while !head.ends_with(b"\r\n\r\n") {
        client.read_exact(&mut byte)?;
        head.push(byte[0]);
    }
    let head = String::from_utf8(head).unwrap();
    let length = head.lines().find_map(|line| {
        line.to_ascii_lowercase()
            .strip_prefix("content-length: ")?
            .parse()
            .ok()
    });
    let mut body = vec![0; length.unwrap_or(0)];
    client.read_exact(&mut body)?;
    let (line, headers) = head.split_once("\r\n").unwrap();
    assert!(line.contains(BELOW), "{line}");
    let mut daemon = TcpStream::connect(to)?;
    let line = line.replace(BELOW, "");
    let added = "X-Forwarded-For: 192.0.2.1\r\nX-Forwarded-Proto: https\r\nConnection: close";
    daemon.write_all(format!("{line}\r\n{added}\r\n{headers}").as_bytes())?;
    daemon.write_all(&body)?;
    let mut buffer = [0; 4096];
    loop {
        let count = daemon.read(&mut buffer)?;
        if count == 0 {
            client.conn.send_close_notify();
            return client.flush();
        }
        client.write_all(&buffer[..count])?;
        client.flush()?;
    }
}

#[test]
fn gonioctl_works_through_a_tls_proxy_below_a_path() {
    let behind = Behind::start();
    let given = ["--ca", AUTHORITY, "--token-file", "data/tokens.toml"];
    let _ = behind.gonioctl(&[&["jobs"], &given[..]].concat()).expect(0);
    // It listens to the events until the arm rests.
    let moved = behind
        .gonioctl(&[&["jog", "light", "-40"], &given[..]].concat())
        .expect(0);
    let angle = moved
        .stderr
        .strip_prefix("light arm at ")
        .and_then(|rest| rest.split('°').next());
    let angle: f64 = angle.unwrap().parse().unwrap();
    assert!((angle + 40.0).abs() <= 0.5, "{}", moved.stderr);
}

#[test]
fn behind_a_tls_proxy_a_token_and_a_known_authority_are_needed() {
    let behind = Behind::start();
    let refused = behind.gonioctl(&["jobs", "--ca", AUTHORITY]).expect(5);
    assert!(refused.stderr.contains("--token-file"), "{}", refused.stderr);
    let unknown = behind
        .gonioctl(&["jobs", "--token-file", "data/tokens.toml"])
        .expect(5);
    assert!(
        unknown.stderr.contains("certificate") && unknown.stderr.contains("--ca"),
        "{}",
        unknown.stderr
    );
    for wrong in [Path::new(KEY), Path::new("missing.pem")] {
        let wrong = behind
            .gonioctl(&["jobs", "--ca", wrong.to_str().unwrap()])
            .expect(2);
        assert!(wrong.stderr.contains("--ca"), "{}", wrong.stderr);
    }
}
