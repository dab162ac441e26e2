//! The verbs that work on a daemon, through both executables.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs::{self, File};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;
use tests::{Captured, Finished, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");
const GONIOD: &str = env!("CARGO_BIN_EXE_e2e-goniod");

const SHORT: &str =
    "specimen = \"short\"\n[[plane]]\ntheta_r_deg = 70.0\nreadings = 10\n[arc]\nreadings = 10\n";
/// Long enough not to be over before it is stopped.
const LONG: &str = "specimen = \"long\"\non_stage = true\n[[plane]]\ntheta_r_deg = 70.0\nreadings = 400\n[arc]\nreadings = 400\n";

/// A daemon on the built-in simulator, in a directory of its own; killed when dropped.
struct Service {
    directory: TempDir,
    child: Child,
    address: String,
}

impl Service {
    fn start(arguments: &[&str]) -> Self {
        Self::with("", arguments)
    }

    fn with(rig: &str, arguments: &[&str]) -> Self {
        let directory = tempfile::tempdir().unwrap();
        for (name, text) in [("rig.toml", rig), ("short.toml", SHORT), ("long.toml", LONG)] {
            fs::write(directory.path().join(name), text).unwrap();
        }
        let (child, address) = launch(directory.path(), arguments);
        Self {
            directory,
            child,
            address,
        }
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(GONIOCTL);
        command
            .args(arguments)
            .current_dir(self.directory.path())
            .env("GONIOD_URL", &self.address)
            .env("GONIOD_TOKEN_FILE", "data/tokens.toml")
            .env_remove("RUST_LOG");
        command
    }

    fn gonioctl(&self, arguments: &[&str]) -> Finished {
        self.command(arguments).output().unwrap().into()
    }

    /// Submits a job file and returns its id.
    fn submit(&self, file: &str) -> String {
        self.gonioctl(&["submit", file])
            .expect(0)
            .stdout
            .trim()
            .to_owned()
    }

    fn rig(&self, arguments: &[&str]) -> Value {
        let told = self.gonioctl(&[arguments, &["--json"]].concat()).expect(0);
        serde_json::from_str(&told.stdout).unwrap()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Starts a daemon and returns it with its address, once it answers.
fn launch(directory: &Path, arguments: &[&str]) -> (Child, String) {
    let log = File::create(directory.join("log")).unwrap();
    let mut child = Command::new(GONIOD)
        .args(["--config", "rig.toml", "--data", "data"])
        .args(arguments)
        .current_dir(directory)
        .stdout(Stdio::piped())
        .stderr(log)
        .spawn()
        .unwrap();
    let mut address = String::new();
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    stdout.read_line(&mut address).unwrap();
    let log = || fs::read_to_string(directory.join("log")).unwrap();
    assert!(!address.is_empty(), "the daemon did not start: {}", log());
    (child, address.trim().to_owned())
}

/// A `gonioctl watch --json`, whose events are read as they come.
struct Watcher {
    child: Child,
    lines: BufReader<ChildStdout>,
}

impl Watcher {
    fn of(service: &Service, job: &str) -> Self {
        Self::start(service.command(&["watch", job, "--json"]))
    }

    /// Of whatever happens from now on.
    fn of_all(service: &Service) -> Self {
        let mut command = service.command(&["watch", "--json"]);
        let mut watcher = Self::start(command.stderr(Stdio::piped()));
        let said = watcher.child.stderr.take().unwrap();
        until(&mut BufReader::new(said), "watching");
        watcher
    }

    fn start(mut command: impl std::borrow::BorrowMut<Command>) -> Self {
        let mut child = command.borrow_mut().stdout(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap());
        Self { child, lines }
    }

    /// Reads until an event is told of which this holds.
    fn until(&mut self, what: &str, holds: impl Fn(&Value) -> bool) {
        let mut line = String::new();
        loop {
            line.clear();
            assert!(
                self.lines.read_line(&mut line).unwrap() > 0,
                "it ended before: {what}"
            );
            if holds(&serde_json::from_str(&line).unwrap()) {
                return;
            }
        }
    }

    fn state(&mut self, state: &str) {
        self.until(state, |event| event["job"]["state"] == state);
    }

    fn readings(&mut self, count: u64) {
        self.until("readings", |event| {
            event["progress"]["done"]
                .as_u64()
                .is_some_and(|done| done >= count)
        });
    }

    fn code(mut self) -> i32 {
        // To its end, or it would wait for us to read.
        std::io::copy(&mut self.lines, &mut std::io::sink()).unwrap();
        self.child.wait().unwrap().code().unwrap()
    }
}

#[test]
fn a_specimen_is_submitted_laid_on_the_stage_and_watched_to_its_end() {
    let service = Service::start(&["--listen", "127.0.0.1:0"]);
    let told = service.gonioctl(&["jobs"]).expect(0);
    assert!(told.stderr.contains("no job"), "{}", told.stderr);
    let id = service.submit("short.toml");
    let listed = service.gonioctl(&["jobs"]).expect(0).stdout;
    assert!(listed.contains(&id) && listed.contains("short"), "{listed}");
    let _ = service.gonioctl(&["ready", &id]).expect(0);
    let watched = service.gonioctl(&["watch", &id]).expect(0);
    assert!(
        watched.stderr.contains(&format!("{id} short: done")),
        "{}",
        watched.stderr
    );
    let listed = service.gonioctl(&["jobs"]).expect(0).stdout;
    assert!(!listed.contains(&id), "what is over is not listed: {listed}");
    let all: Value =
        serde_json::from_str(&service.gonioctl(&["jobs", "--all", "--json"]).expect(0).stdout).unwrap();
    assert_eq!(all["jobs"][0]["state"], "done");
}

#[test]
fn the_result_of_a_run_is_exported_from_the_daemon_by_its_id_and_by_an_address() {
    let service = Service::start(&["--listen", "127.0.0.1:0"]);
    let none = service
        .gonioctl(&["export", &service.address, "--format", "ssdd"])
        .expect(2);
    assert!(none.stderr.contains("no run with a result"), "{none:?}");
    let id = service.submit("short.toml");
    let _ = service.gonioctl(&["ready", &id]).expect(0);
    let _ = service.gonioctl(&["watch", &id]).expect(0);
    let job = service.rig(&["jobs", "--all"]);
    let run = job["jobs"][0]["run"].as_str().unwrap().to_owned();
    let of_run = [
        run.clone(),
        service.address.clone(),
        format!("{}/#run/{run}", service.address),
        format!("{}/api/v1/runs/{run}", service.address),
    ];
    let mut files = Vec::new();
    for (n, run) in of_run.iter().enumerate() {
        let to = format!("{n}.ssdd");
        let told = service
            .gonioctl(&["export", run, "--format", "ssdd", "--to", &to])
            .expect(0);
        assert!(told.stderr.contains("ssdd: read back"), "{run}: {told:?}");
        files.push(fs::read(service.directory.path().join(to)).unwrap());
    }
    assert!(files.iter().all(|file| *file == files[0]));
    let readings = service
        .gonioctl(&["export", &run, "--format", "csv"])
        .expect(0)
        .stdout;
    assert!(readings.starts_with("index,sweep,"), "{readings}");
}

#[test]
fn a_run_is_paused_stopped_and_gone_on_with() {
    let service = Service::start(&["--listen", "127.0.0.1:0"]);
    let id = service.submit("long.toml");
    let mut watcher = Watcher::of(&service, &id);
    watcher.readings(20);
    let _ = service.gonioctl(&["pause"]).expect(0);
    watcher.state("paused");
    let _ = service.gonioctl(&["resume"]).expect(0);
    watcher.state("running");
    let _ = service.gonioctl(&["stop"]).expect(0);
    watcher.state("interrupted");
    assert_eq!(watcher.code(), 4, "stopped before the end");
    let _ = service.gonioctl(&["resume"]).expect(0);
    let _ = service.gonioctl(&["watch", &id]).expect(0);
    let refused = service.gonioctl(&["resume"]).expect(5);
    assert!(refused.stderr.contains("nothing is paused"), "{}", refused.stderr);
}

#[test]
fn run_has_the_daemon_do_it_and_an_interrupt_leaves_a_run_to_go_on_with() {
    let service = Service::start(&["--listen", "127.0.0.1:0"]);
    let here = service.directory.path();
    let mut watcher = Watcher::of_all(&service);
    let running = service
        .command(&["run", "long.toml", "--rig", "rig.toml"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    watcher.readings(20);
    let busy = service.gonioctl(&["run", "short.toml"]).expect(5);
    assert!(busy.stderr.contains("gonioctl submit"), "{}", busy.stderr);
    let id = Pid::from_raw(running.id().try_into().unwrap()).unwrap();
    kill_process(id, Signal::INT).unwrap();
    let stopped = Finished::from(running.wait_with_output().unwrap()).expect(4);
    for said in [
        "after this reading",
        "the readings so far are safe",
        "gonioctl resume",
    ] {
        assert!(stopped.stderr.contains(said), "{said}: {}", stopped.stderr);
    }
    let directory = Path::new(stopped.stdout.trim());
    assert!(
        directory.starts_with(here.join("data")),
        "{}",
        directory.display()
    );
    let before = Captured::read(directory);
    assert!(before.readings().count() >= 20);
    assert!(!directory.join("brdf.binary").exists());
    assert!(!here.join("runs").exists(), "the run is the daemon's alone");

    let resume = ["run", "--resume", stopped.stdout.trim(), "--json"];
    let finished = service.gonioctl(&resume).expect(0);
    let summary: Value = serde_json::from_str(&finished.stdout).unwrap();
    assert_eq!(
        (&summary["state"], &summary["exit_status"]),
        (&"done".into(), &0.into())
    );
    let whole = Captured::read(directory);
    let kept = before
        .readings()
        .all(|reading| whole.readings().any(|other| other == reading));
    assert!(kept, "nothing was lost");
    let accepted = whole.readings().filter(|reading| reading.accepted).count();
    assert_eq!(summary["readings"]["planned"], accepted);
    assert!(directory.join("brdf.binary").exists());
    watcher.child.kill().unwrap();
    watcher.child.wait().unwrap();
}

#[test]
fn a_second_interrupt_of_a_run_that_the_daemon_does_is_an_emergency_stop() {
    // In real time and with a long dwell, so that the second signal comes before the reading in hand is finished.
    let slow = "motion.settle_ms = 5000\nsim.clock = \"real\"\n";
    let service = Service::with(slow, &["--listen", "127.0.0.1:0"]);
    let mut watcher = Watcher::of_all(&service);
    let mut running = service
        .command(&["run", "long.toml"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    watcher.until("a step", |event| event["event"] == "step");
    let id = Pid::from_raw(running.id().try_into().unwrap()).unwrap();
    kill_process(id, Signal::INT).unwrap();
    let mut said = BufReader::new(running.stderr.take().unwrap());
    until(&mut said, "again for an emergency stop");
    kill_process(id, Signal::INT).unwrap();
    until(&mut said, "emergency stop");
    std::io::copy(&mut said, &mut std::io::sink()).unwrap();
    let _ = Finished::from(running.wait_with_output().unwrap()).expect(3);
    let refused = service.gonioctl(&["park"]).expect(5);
    assert!(refused.stderr.contains("emergency stop"), "{}", refused.stderr);
    watcher.child.kill().unwrap();
    watcher.child.wait().unwrap();
}

#[test]
fn run_lays_the_specimen_on_the_stage_of_a_daemon_that_has_the_rig_and_of_no_other() {
    let service = Service::start(&["--listen", "127.0.0.1:0"]);
    let finished = service
        .gonioctl(&["run", "short.toml", "--rig", "rig.toml"])
        .expect(0);
    assert!(
        finished.stderr.contains("errors against the simulated specimen"),
        "{}",
        finished.stderr
    );
    let all: Value =
        serde_json::from_str(&service.gonioctl(&["jobs", "--all", "--json"]).expect(0).stdout).unwrap();
    assert_eq!(all["jobs"][0]["state"], "done", "{all:#}");
    fs::write(
        service.directory.path().join("other.toml"),
        "[envelope]\nseparation_deg = 7.0\n",
    )
    .unwrap();
    let other = service
        .gonioctl(&["run", "short.toml", "--rig", "other.toml"])
        .expect(2);
    assert!(other.stderr.contains("another rig"), "{}", other.stderr);
    // Where a directory is given, the run is made there.
    let alone = service
        .gonioctl(&["run", "short.toml", "--rig", "rig.toml", "--out", "mine"])
        .expect(0);
    assert!(alone.stdout.starts_with("mine"), "{}", alone.stdout);
    let bad = service.gonioctl(&["run", "missing.toml"]).expect(2);
    assert!(bad.stderr.contains("missing.toml"), "{}", bad.stderr);
    let nobody = ["run", "short.toml", "--daemon", "http://127.0.0.1:1"];
    let _ = service.gonioctl(&nobody).expect(5);
    let _ = service.gonioctl(&["estop"]).expect(0);
    let latched = service.gonioctl(&["run", "short.toml"]).expect(5);
    assert!(latched.stderr.contains("acknowledge"), "{}", latched.stderr);
}

#[test]
fn an_emergency_stop_is_latched_until_it_is_acknowledged() {
    let service = Service::start(&["--listen", "127.0.0.1:0"]);
    let job = service.submit("long.toml");
    let mut watcher = Watcher::of(&service, &job);
    watcher.readings(20);
    let _ = service.gonioctl(&["estop"]).expect(0);
    watcher.state("interrupted");
    assert_eq!(watcher.code(), 3, "ended by a fault");
    let refused = service.gonioctl(&["park"]).expect(5);
    assert!(refused.stderr.contains("acknowledge"), "{}", refused.stderr);
    // Nobody can be asked here whether the rig was looked at.
    let unnamed = service.gonioctl(&["acknowledge"]).expect(2);
    let id = unnamed.stderr.split("--fault ").nth(1).unwrap().trim().to_owned();
    assert!(unnamed.stderr.contains("emergency stop by"), "{}", unnamed.stderr);
    let _ = service.gonioctl(&["estop"]).expect(0);
    let older = service.gonioctl(&["acknowledge", "--fault", &id]).expect(5);
    let id = older
        .stderr
        .split("fault ")
        .nth(2)
        .unwrap()
        .split(' ')
        .next()
        .unwrap();
    let rig = service.rig(&["acknowledge", "--fault", id]);
    assert!(rig["fault"].is_null(), "{rig:#}");
    let _ = service.gonioctl(&["acknowledge", "--fault", id]).expect(5);
    let _ = service.gonioctl(&["cancel", &job]).expect(0);
}

#[test]
fn arms_go_by_hand_within_the_envelope() {
    let service = Service::start(&["--listen", "127.0.0.1:0"]);
    let angle = |rig: &Value, arm: usize| rig["arms"][arm]["measured_deg"].as_f64().unwrap();
    let rig = service.rig(&["jog", "light", "-40"]);
    assert!((angle(&rig, 0) + 40.0).abs() <= 0.5, "{rig:#}");
    let outside = service.gonioctl(&["jog", "light", "-89.5"]).expect(2);
    assert!(outside.stderr.contains("-88"), "{}", outside.stderr);
    let _ = service.gonioctl(&["jog", "lamp", "10"]).expect(2);
    let rig = service.rig(&["park"]);
    assert!((angle(&rig, 0) + 45.0).abs() <= 0.5, "{rig:#}");
}

#[test]
fn what_is_wrong_is_told_and_has_its_exit_code() {
    let here = tempfile::tempdir().unwrap();
    let nobody = run(GONIOCTL, here.path(), &["jobs", "--daemon", "http://127.0.0.1:1"]).expect(5);
    assert!(
        nobody
            .stderr
            .contains("cannot reach the daemon at http://127.0.0.1:1"),
        "{}",
        nobody.stderr
    );
    let _ = run(GONIOCTL, here.path(), &["jobs", "--daemon", "ftp://here"]).expect(2);

    let service = Service::start(&["--listen", "127.0.0.1:0"]);
    fs::write(
        service.directory.path().join("bad.toml"),
        "[[plane]]\ntheta_r_deg = 95.0\nreadings = 10\n[arc]\nreadings = 10\n",
    )
    .unwrap();
    let bad = service.gonioctl(&["submit", "bad.toml"]).expect(2);
    assert!(
        bad.stderr.contains("bad.toml") && bad.stderr.contains("theta_r_deg"),
        "{}",
        bad.stderr
    );
    let _ = service.gonioctl(&["submit", "none.toml"]).expect(2);
    let _ = service.gonioctl(&["cancel", "no-id"]).expect(2);
    let _ = service
        .gonioctl(&["cancel", "01KAGN4Z7Q3X9V5T8R2M6C1D0B"])
        .expect(5);
    let _ = service.gonioctl(&["pause"]).expect(5);
    let _ = service.gonioctl(&["ready"]).expect(5);
}

#[test]
fn a_token_is_needed_over_tcp() {
    let service = Service::start(&["--listen", "127.0.0.1:0", "--tokens", "tokens.toml"]);
    let mut without = service.command(&["jobs"]);
    let refused = Finished::from(without.env_remove("GONIOD_TOKEN_FILE").output().unwrap()).expect(5);
    assert!(refused.stderr.contains("--token-file"), "{}", refused.stderr);
    let _ = service
        .gonioctl(&["jobs", "--token-file", "tokens.toml"])
        .expect(0);
    let _ = service.gonioctl(&["jobs", "--token-file", "missing"]).expect(2);
}

#[test]
fn a_watcher_finds_a_daemon_that_was_killed_and_started_again() {
    let mut service = Service::start(&["--listen", "unix:socket"]);
    let _ = service.gonioctl(&["jobs"]).expect(0);
    let mut watcher = service
        .command(&["watch"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(watcher.stderr.take().unwrap());
    until(&mut said, "watching");
    service.child.kill().unwrap();
    service.child.wait().unwrap();
    until(&mut said, "lost the daemon");
    (service.child, service.address) = launch(service.directory.path(), &["--listen", "unix:socket"]);
    until(&mut said, "the daemon is back");
    let id = service.submit("short.toml");
    until(&mut said, &id);
    watcher.kill().unwrap();
    watcher.wait().unwrap();
}

fn until(said: &mut BufReader<ChildStderr>, what: &str) {
    let mut line = String::new();
    while !line.contains(what) {
        line.clear();
        assert!(said.read_line(&mut line).unwrap() > 0, "it ended before: {what}");
    }
}

#[test]
fn a_store_is_backed_up_while_the_daemon_runs_and_brought_back() {
    let mut service = Service::start(&["--listen", "127.0.0.1:0"]);
    let here = service.directory.path().to_owned();
    let first = service.submit("short.toml");
    let _ = service.gonioctl(&["ready", &first]).expect(0);
    let _ = service.gonioctl(&["watch", &first]).expect(0);
    let made = run(GONIOD, &here, &["backup", "copy.db", "--data", "data"]).expect(0);
    assert_eq!(made.stdout.trim(), "copy.db");
    let second = service.submit("short.toml");
    let _ = service.gonioctl(&["ready", &second]).expect(0);
    let _ = service.gonioctl(&["watch", &second]).expect(0);
    let busy = run(GONIOD, &here, &["restore", "copy.db", "--data", "data"]).expect(2);
    assert!(
        busy.stderr.contains("in use by another goniod"),
        "{}",
        busy.stderr
    );
    service.child.kill().unwrap();
    service.child.wait().unwrap();

    // Nothing is taken for a new store where runs lie.
    let data = here.join("data");
    for name in ["goniod.db", "goniod.db-wal", "goniod.db-shm"] {
        let _ = fs::remove_file(data.join(name));
    }
    let serve = [
        "--config",
        "rig.toml",
        "--data",
        "data",
        "--listen",
        "127.0.0.1:0",
    ];
    let refused = run(GONIOD, &here, &serve).expect(2);
    assert!(refused.stderr.contains("goniod restore"), "{}", refused.stderr);
    assert!(!data.join("goniod.db").exists(), "no new one was made");

    let restored = run(GONIOD, &here, &["restore", "copy.db", "--data", "data"]).expect(0);
    assert!(
        restored.stderr.contains("1 runs are newer than the backup"),
        "{}",
        restored.stderr
    );
    (service.child, service.address) = launch(&here, &["--listen", "127.0.0.1:0"]);
    let told = service.gonioctl(&["jobs", "--all", "--json"]).expect(0).stdout;
    let told: Value = serde_json::from_str(&told).unwrap();
    let jobs = &told["jobs"];
    assert_eq!(jobs.as_array().unwrap().len(), 1, "{jobs}");
    assert_eq!(
        (&jobs[0]["id"], &jobs[0]["state"]),
        (&first.into(), &"done".into())
    );
}

#[test]
fn runs_that_belong_to_no_store_are_accepted_once() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    fs::write(here.join("rig.toml"), "").unwrap();
    fs::write(here.join("short.toml"), SHORT).unwrap();
    let _ = run(
        GONIOCTL,
        here,
        &["run", "short.toml", "--rig", "rig.toml", "--out", "data/runs"],
    )
    .expect(0);
    let serve = [
        "--config",
        "rig.toml",
        "--data",
        "data",
        "--listen",
        "127.0.0.1:0",
    ];
    let refused = run(GONIOD, here, &serve).expect(2);
    assert!(refused.stderr.contains("--accept-runs"), "{}", refused.stderr);
    for arguments in [
        &["--listen", "127.0.0.1:0", "--accept-runs"][..],
        &["--listen", "127.0.0.1:0"],
    ] {
        let (mut child, _) = launch(here, arguments);
        child.kill().unwrap();
        child.wait().unwrap();
    }
}
