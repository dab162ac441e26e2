//! Who may use a daemon as it is installed, and what of others' text reaches a terminal or a log.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::fd::OwnedFd;
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Command, Stdio};

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use tempfile::TempDir;
use tests::Finished;

/// Text that would clear the screen, set a title, hide and reorder what follows, and forge a line.
const HOSTILE: &str =
    "gold\u{1b}[2J\u{9b}31m\u{1b}]0;x\u{7}\u{202e}\u{2066}\u{200b}\u{2028}\rFAULT\nFAULT none";

/// A daemon in a folder of its own, with its usual socket there; killed when dropped.
struct Daemon {
    directory: TempDir,
    child: Child,
    addresses: Vec<String>,
}

impl Daemon {
    /// With its stderr in the file log.
    fn start(arguments: &[&str], addresses: usize) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let log = File::create(directory.path().join("log")).unwrap();
        Self::start_in(directory, log.into(), arguments, addresses)
    }

    fn start_in(directory: TempDir, stderr: OwnedFd, arguments: &[&str], addresses: usize) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_e2e-goniod"))
            .args(["--data", "data"])
            .args(arguments)
            .current_dir(directory.path())
            .env("XDG_RUNTIME_DIR", directory.path())
            .env_remove("RUNTIME_DIRECTORY")
            .env_remove("RUST_LOG")
            .stdout(Stdio::piped())
            .stderr(stderr)
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let addresses = lines.take(addresses).map(Result::unwrap).collect();
        Self {
            directory,
            child,
            addresses,
        }
    }

    fn gonioctl(&self, arguments: &[&str]) -> Finished {
        Command::new(env!("CARGO_BIN_EXE_e2e-gonioctl"))
            .args(arguments)
            .current_dir(self.directory.path())
            .env("XDG_RUNTIME_DIR", self.directory.path())
            .env_remove("GONIOD_URL")
            .env_remove("GONIOD_TOKEN_FILE")
            .env_remove("RUST_LOG")
            .output()
            .unwrap()
            .into()
    }

    fn read(&self, file: &str) -> String {
        fs::read_to_string(self.directory.path().join(file)).unwrap()
    }

    fn operate_token(&self) -> String {
        self.read("data/tokens.toml").parse::<toml::Table>().unwrap()["operate"]
            .as_str()
            .unwrap()
            .to_owned()
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Asserts that a text could be shown on a terminal: nothing in it but line breaks controls one.
#[track_caller]
fn assert_harmless(what: &str, text: &str) {
    let bad = |c: char| c != '\n' && (c.is_control() || "\u{202e}\u{2066}\u{200b}\u{2028}".contains(c));
    assert!(!text.contains(bad), "{what}: {text:?}");
}

#[test]
fn the_owner_operates_over_the_usual_socket_without_a_token() {
    let daemon = Daemon::start(&["--listen", "unix"], 1);
    let socket = daemon.directory.path().join("goniod.sock");
    assert_eq!(daemon.addresses, [format!("unix:{}", socket.display())]);
    let _ = daemon.gonioctl(&["jobs"]).expect(0);
    let _ = daemon.gonioctl(&["park"]).expect(0);
}

#[test]
fn the_token_file_is_made_at_the_first_start_for_its_user_alone() {
    let daemon = Daemon::start(&["--listen", "127.0.0.1:0"], 1);
    let mode = fs::metadata(daemon.directory.path().join("data/tokens.toml"))
        .unwrap()
        .permissions()
        .mode();
    assert_eq!(mode & 0o777, 0o600);
    let refused = daemon
        .gonioctl(&["jobs", "--daemon", &daemon.addresses[0]])
        .expect(5);
    assert!(refused.stderr.contains("--token-file"), "{}", refused.stderr);
    let token = ["--token-file", "data/tokens.toml"];
    let _ = daemon
        .gonioctl(&[&["jobs", "--daemon", &daemon.addresses[0]], &token[..]].concat())
        .expect(0);
    assert!(
        !daemon.read("log").contains(&daemon.operate_token()),
        "no token in a log"
    );
}

#[test]
fn a_sign_in_link_is_printed_to_a_terminal_and_nowhere_else() {
    let directory = tempfile::tempdir().unwrap();
    let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&ours).unwrap();
    unlockpt(&ours).unwrap();
    let path = ptsname(&ours, Vec::new()).unwrap();
    let terminal = rustix::fs::open(path.as_c_str(), OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    let daemon = Daemon::start_in(directory, terminal, &["--listen", "127.0.0.1:0"], 1);
    let link = BufReader::new(File::from(ours))
        .lines()
        .map(Result::unwrap)
        .find(|line| line.contains("#token="))
        .unwrap();
    let expected = format!("{}/#token={}", daemon.addresses[0], daemon.operate_token());
    assert!(link.contains(&expected), "{link}");
    let elsewhere = Daemon::start(&["--listen", "127.0.0.1:0"], 1);
    let _ = elsewhere
        .gonioctl(&["jobs", "--daemon", &elsewhere.addresses[0]])
        .expect(5);
    assert!(
        !elsewhere.read("log").contains("token="),
        "{}",
        elsewhere.read("log")
    );
}

#[test]
fn nothing_in_a_job_file_reaches_a_terminal_or_the_log_as_it_stands() {
    for log in ["human", "json"] {
        let daemon = Daemon::start(&["--listen", "unix", "--log", log], 1);
        let name = serde_json::to_string(HOSTILE).unwrap();
        // A string of JSON is one of TOML too.
        let job =
            format!("specimen = {name}\n[[plane]]\ntheta_r_deg = 70\nreadings = 5\n[arc]\nreadings = 5\n");
        let file = format!("{HOSTILE}.toml");
        fs::write(daemon.directory.path().join(&file), &job).unwrap();
        // The daemon takes no file's name that has control characters in it.
        fs::write(daemon.directory.path().join("job.toml"), &job).unwrap();
        let _ = daemon.gonioctl(&["plan", &file]);
        for arguments in [
            &["submit", &file][..],
            &["submit", "job.toml"],
            &["submit", "job.toml", "--json"],
            &["jobs"],
            &["jobs", "--json"],
            &["run", &file],
            &["cancel", HOSTILE],
            &["submit", HOSTILE],
            &["jobs", "--daemon", HOSTILE],
            &["jobs", "--token-file", HOSTILE, "--daemon", "http://127.0.0.1:1"],
            &["plan", HOSTILE],
            &["reconstruct", HOSTILE],
            &["eval", HOSTILE, HOSTILE],
        ] {
            let said = daemon.gonioctl(arguments);
            assert!(
                !said.stdout.is_empty() || !said.stderr.is_empty(),
                "{arguments:?}"
            );
            assert_harmless(&format!("{arguments:?} stdout"), &said.stdout);
            assert_harmless(&format!("{arguments:?} stderr"), &said.stderr);
        }
        let jobs: serde_json::Value =
            serde_json::from_str(&daemon.gonioctl(&["jobs", "--json"]).expect(0).stdout).unwrap();
        assert_eq!(jobs["jobs"][0]["specimen"], HOSTILE, "machines read it as it is");
        assert_harmless("log", &daemon.read("log"));
    }
}

#[test]
fn nothing_in_a_request_reaches_the_log_as_it_stands() {
    for log in ["human", "json"] {
        let daemon = Daemon::start(&["--listen", "127.0.0.1:0", "--log", log], 1);
        let address = daemon.addresses[0].trim_start_matches("http://");
        for head in [
            format!("GET /\u{9b}31m\u{202e} HTTP/1.1\r\nHost: {address}\r\n"),
            format!("GET /api/v1/rig?\u{1b}[2J HTTP/1.1\r\nHost: {address}\r\n"),
            format!("GET /api/v1/rig HTTP/1.1\r\nHost: {address}\r\nOrigin: http://\u{202e}evil\u{9b}\r\n"),
            "GET /api/v1/rig HTTP/1.1\r\nHost: evil\u{9b}.example\r\n".to_owned(),
            format!("GET /api/v1/%1b%5b2J%e2%80%ae HTTP/1.1\r\nHost: {address}\r\n"),
        ] {
            let mut stream = TcpStream::connect(address).unwrap();
            stream
                .write_all(format!("{head}Connection: close\r\n\r\n").as_bytes())
                .unwrap();
            let mut answer = Vec::new();
            // One that is not understood may be closed without an answer.
            let _ = stream.read_to_end(&mut answer);
        }
        let log = daemon.read("log");
        assert!(log.contains("refused"), "{log}");
        assert_harmless("log", &log);
    }
}

#[test]
fn failed_sign_ins_are_in_the_log_without_what_was_tried() {
    let daemon = Daemon::start(&["--listen", "127.0.0.1:0"], 1);
    let address = daemon.addresses[0].trim_start_matches("http://");
    let body = "{\"token\":\"a guess that is not to be kept\"}";
    let mut stream = TcpStream::connect(address).unwrap();
    write!(
        stream,
        "POST /api/v1/session HTTP/1.1\r\nHost: {address}\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}",
        body.len()
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 401"), "{answer}");
    let log = daemon.read("log");
    assert!(
        log.contains("sign-in refused") && log.contains("127.0.0.1") && !log.contains("a guess"),
        "{log}"
    );
}
