//! A run that is stopped, or runs out of disk, loses nothing and can be gone on with.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use capture::{Outcome, Record};
use rustix::process::{Pid, Signal, kill_process};
use tests::{Captured, Finished, Simulator, on_a_full_disk, run, run_by};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");
const GONIOD: &str = env!("CARGO_BIN_EXE_e2e-goniod");

/// Long enough not to be over before it is stopped.
const JOB: &str = "[[plane]]\ntheta_r_deg = 70.0\nreadings = 400\n[arc]\nreadings = 400\n";
const RUN: [&str; 4] = ["run", "job.toml", "--rig", "rig.toml"];

fn prepare(directory: &Path) {
    fs::write(directory.join("job.toml"), JOB).unwrap();
    fs::write(directory.join("rig.toml"), "").unwrap();
}

fn only_run(directory: &Path) -> PathBuf {
    let runs: Vec<_> = fs::read_dir(directory.join("runs"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    assert_eq!(runs.len(), 1, "{runs:?}");
    runs[0].clone()
}

/// Starts a run that tells every event, and returns once it has told of so many of one kind.
fn started(directory: &Path, kind: &str, events: usize) -> (Child, BufReader<std::process::ChildStderr>) {
    let mut child = Command::new(GONIOCTL)
        .args(RUN)
        .current_dir(directory)
        .env("RUST_LOG", "gonioctl=debug")
        .env_remove("GONIOD_URL")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = BufReader::new(child.stderr.take().unwrap());
    let (mut line, mut seen) = (String::new(), 0);
    while seen < events {
        line.clear();
        assert!(
            stderr.read_line(&mut line).unwrap() > 0,
            "it ended before {events} of {kind}"
        );
        seen += usize::from(line.contains(kind));
    }
    (child, stderr)
}

fn signal(child: &Child, signal: Signal) {
    let id = Pid::from_raw(child.id().try_into().unwrap()).unwrap();
    kill_process(id, signal).unwrap();
}

fn ended(child: Child, mut stderr: impl Read) -> Finished {
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    let mut finished = Finished::from(child.wait_with_output().unwrap());
    finished.stderr = said;
    finished
}

/// Resumes a run and asserts that every step then has one accepted reading, and that nothing was lost.
fn resume(directory: &Path, before: &Captured) {
    let path = before.directory.to_str().unwrap();
    let _ = run(GONIOCTL, directory, &["run", "--resume", path]).expect(0);
    let whole = Captured::read(&before.directory);
    assert_eq!(
        &whole.records[..before.records.len()],
        &before.records[..],
        "nothing was lost"
    );
    let accepted = whole.accepted();
    assert!(accepted.iter().all(|&n| n == 1), "each pose is measured once");
    assert!(before.directory.join("brdf.binary").exists());
    // A run that is done is only reported again.
    let _ = run(GONIOCTL, directory, &["run", "--resume", path]).expect(0);
    assert_eq!(Captured::read(&before.directory).records, whole.records);
}

#[test]
fn one_interrupt_finishes_the_reading_and_leaves_a_run_to_resume() {
    let temporary = tempfile::tempdir().unwrap();
    prepare(temporary.path());
    let (child, stderr) = started(temporary.path(), "Reading {", 100);
    signal(&child, Signal::INT);
    let finished = ended(child, stderr).expect(4);
    assert!(
        finished.stderr.contains("--resume"),
        "it says how to go on: {}",
        finished.stderr
    );
    let directory = only_run(temporary.path());
    let stopped = Captured::read(&directory);
    let last = stopped.records.last();
    assert!(
        matches!(
            last,
            Some(Record::End {
                outcome: Outcome::Stopped,
                ..
            })
        ),
        "{last:?}"
    );
    let readings = stopped.readings().count();
    assert!((100..800).contains(&readings), "{readings} readings");
    assert!(
        !directory.join("brdf.binary").exists(),
        "half a run makes no BRDF"
    );
    assert!(directory.join("report.html").exists(), "but a report");
    resume(temporary.path(), &stopped);
}

#[test]
fn a_second_interrupt_is_an_emergency_stop() {
    let temporary = tempfile::tempdir().unwrap();
    prepare(temporary.path());
    // A long dwell before each reading, so that the second signal comes before the reading in hand is finished.
    fs::write(
        temporary.path().join("rig.toml"),
        "motion.settle_ms = 5000\nsim.clock = \"real\"\n",
    )
    .unwrap();
    // Between two readings the first signal would end it by itself.
    let (child, mut stderr) = started(temporary.path(), "Step {", 2);
    signal(&child, Signal::INT);
    let mut line = String::new();
    while !line.contains("again for an emergency stop") {
        line.clear();
        assert!(
            stderr.read_line(&mut line).unwrap() > 0,
            "it did not say that it stops"
        );
    }
    signal(&child, Signal::INT);
    let finished = ended(child, stderr).expect(3);
    assert!(finished.stderr.contains("emergency stop"), "{}", finished.stderr);
    let stopped = Captured::read(&only_run(temporary.path()));
    let last = stopped.records.last();
    assert!(
        matches!(
            last,
            Some(Record::End {
                outcome: Outcome::Failed { .. },
                ..
            })
        ),
        "{last:?}"
    );
}

#[test]
fn a_full_disk_loses_nothing() {
    let temporary = tempfile::tempdir().unwrap();
    prepare(temporary.path());
    let finished = run_by(on_a_full_disk(GONIOCTL, 600), temporary.path(), &RUN).expect(4);
    let directory = only_run(temporary.path());
    assert!(finished.stderr.contains("journal"), "{}", finished.stderr);
    let full = Captured::read(&directory);
    let readings = full.readings().count();
    assert!((1..800).contains(&readings), "{readings} readings");
    resume(temporary.path(), &full);
}

/// A pipe by name: who reads it waits until somebody writes, and until that one ends.
fn pipe(path: &Path) {
    let mode = rustix::fs::Mode::from_raw_mode(0o600);
    rustix::fs::mknodat(rustix::fs::CWD, path, rustix::fs::FileType::Fifo, mode, 0).unwrap();
}

/// Whether this process, and whatever it starts, ignores SIGINT (proc(5), "SigIgn").
fn ignores_interrupts() -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.unwrap_or_default() & (1 << (Signal::INT.as_raw() - 1)) != 0
}

#[test]
fn a_signal_ends_a_program_that_waits_for_its_input() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    prepare(here);
    pipe(&here.join("pipe.toml"));
    for (program, arguments) in [
        (GONIOCTL, &["run", "pipe.toml"][..]),
        (GONIOCTL, &["run", "job.toml", "--rig", "pipe.toml"]),
        (GONIOCTL, &["calibrate", "white", "--standard", "pipe.toml"]),
        (GONIOCTL, &["plan", "pipe.toml"]),
        (GONIOD, &["--config", "pipe.toml", "--listen", "127.0.0.1:0"]),
    ] {
        for number in [Signal::INT, Signal::TERM] {
            // Whoever starts the tests in the background of a shell has them ignore Ctrl-C, and so all that they start.
            if number == Signal::INT && ignores_interrupts() {
                println!("left out: SIGINT is ignored here");
                continue;
            }
            let child = Command::new(program)
                .args(arguments)
                .current_dir(here)
                .env_remove("GONIOD_URL")
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            // Returns once the program has opened its end, and so waits for what we say.
            let writer = fs::File::options()
                .write(true)
                .open(here.join("pipe.toml"))
                .unwrap();
            signal(&child, number);
            // Where signals do nothing it reads an empty file now, and ends by itself.
            drop(writer);
            let status = child.wait_with_output().unwrap().status;
            assert_eq!(
                std::os::unix::process::ExitStatusExt::signal(&status),
                Some(number.as_raw()),
                "{arguments:?}: {status}"
            );
        }
    }
}

#[test]
fn a_run_goes_on_where_its_adapter_came_back_and_on_no_other_rig() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    prepare(here);
    let before = Simulator::new("");
    let _ = before.rig_file(here);
    let (child, stderr) = started(here, "Reading {", 40);
    signal(&child, Signal::INT);
    let _ = ended(child, stderr).expect(4);
    let stopped = Captured::read(&only_run(here));
    let path = stopped.directory.to_str().unwrap();
    drop(before);

    let again = Simulator::new("");
    let port = again.server.path().display().to_string();
    fs::write(
        here.join("other.toml"),
        format!("bus.port = \"{port}\"\nmotion.settle_ms = 77\n"),
    )
    .unwrap();
    let other = run(GONIOCTL, here, &["run", "--resume", path, "--rig", "other.toml"]).expect(2);
    assert!(
        other.stderr.contains("only [bus] and [sim] may differ"),
        "{}",
        other.stderr
    );
    assert_eq!(
        again.server.counters().packets,
        0,
        "nothing was sent to another rig"
    );

    let moved = again.rig_file(here);
    let resume = ["run", "--resume", path, "--rig", moved.to_str().unwrap()];
    let _ = run(GONIOCTL, here, &resume).expect(0);
    let whole = Captured::read(&stopped.directory);
    assert_eq!(&whole.records[..stopped.records.len()], &stopped.records[..]);
    assert!(stopped.directory.join("brdf.binary").exists());
}
