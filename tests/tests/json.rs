//! What commands print with `--json` is of the schema that `gonioctl schema` prints of it.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::Value;
use tests::{run, run_by};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");
const GONIOD: &str = env!("CARGO_BIN_EXE_e2e-goniod");

const JOB: &str = "specimen = \"x\"\n[[plane]]\ntheta_r_deg = 70.0\nreadings = 10\n[arc]\nreadings = 10\n";

/// Validators by name, as they are asked for.
struct Schemas(BTreeMap<String, jsonschema::Validator>);

impl Schemas {
    /// Asserts that an object is of the kind and of the schema that it names; returns the kind.
    fn check(&mut self, object: &Value, what: &str) -> String {
        let label = object["schema"].as_str();
        let label = label.unwrap_or_else(|| panic!("{what}: no schema is named: {object:#}"));
        let (name, version) = label.split_once('/').unwrap();
        assert!(version.parse::<u32>().is_ok(), "{label}");
        let schema = self.0.entry(name.to_owned()).or_insert_with(|| {
            let printed = run(GONIOCTL, Path::new("."), &["schema", name]).expect(0).stdout;
            jsonschema::draft202012::new(&serde_json::from_str(&printed).unwrap()).unwrap()
        });
        let errors: Vec<_> = schema
            .iter_errors(object)
            .map(|error| format!("{}: {error}", error.instance_path()))
            .collect();
        assert!(errors.is_empty(), "{what}: {errors:#?}\n{object:#}");
        name.to_owned()
    }
}

#[test]
fn what_is_printed_without_a_daemon_is_of_its_schema() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    fs::write(here.join("job.toml"), JOB).unwrap();
    fs::write(here.join("fly.toml"), format!("{JOB}[sweep]\nmode = \"fly\"\n")).unwrap();
    fs::write(here.join("until.toml"), "[sweep]\nbudget_s = 30\n").unwrap();
    fs::write(here.join("bad.toml"), "speciment = 1\n").unwrap();
    fs::write(here.join("none.toml"), "bus.port = \"none\"\n").unwrap();
    fs::write(here.join("script.toml"), "seed = 3\n").unwrap();
    let mut schemas = Schemas(BTreeMap::new());
    let mut seen = BTreeSet::new();
    let mut runs = String::new();
    for (arguments, kind) in [
        (&["ports"][..], "ports"),
        (&["doctor"], "findings"),
        (&["doctor", "--rig", "none.toml"], "findings"),
        (&["plan", "job.toml"], "plan"),
        (&["plan", "fly.toml"], "plan"),
        (&["plan", "until.toml"], "plan"),
        (&["plan", "job.toml", "--hash"], "plan-hash"),
        (&["run", "job.toml", "--out", "runs"], "run"),
        (&["run", "fly.toml", "--out", "runs"], "run"),
        (&["reconstruct", "RUN"], "report"),
        (&["calibrate", "mirror"], "calibration"),
        (
            &["eval", "lambert:0.5", "mirror:0.4", "--fail-above", "male=1e-9"],
            "metrics",
        ),
        (&["eval", "lambert:0", "lambert:0"], "metrics"),
        (&["campaign", "--captures", "5", "--seed", "3"], "campaign"),
        (&["campaign", "--replay", "script.toml"], "replay"),
        (&["plan", "bad.toml"], "error"),
        (&["plan", "job.toml", "--rig", "bad.toml"], "error"),
        (&["run", "--resume", "nowhere"], "error"),
        (&["conform", "--rig", "none.toml"], "error"),
        (&["eval", "lambert:0.5", "nothing"], "error"),
        (&["jobs", "--daemon", "http://127.0.0.1:1"], "error"),
        (&["plan"], "error"),
        (&["plan", "job.toml", "--no-such-option"], "error"),
    ] {
        let arguments: Vec<&str> = arguments
            .iter()
            .map(|&word| if word == "RUN" { &runs } else { word })
            .collect();
        let finished = run(GONIOCTL, here, &[&arguments[..], &["--json"]].concat());
        let what = format!("{arguments:?} ends with {}: {}", finished.code, finished.stderr);
        let object: Value =
            serde_json::from_str(&finished.stdout).unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(schemas.check(&object, &what), kind, "{what}");
        seen.insert(kind);
        if kind == "run" {
            object["directory"].as_str().unwrap().clone_into(&mut runs);
        }
        if kind == "error" {
            assert_eq!(object["error"]["exit_status"], finished.code, "{what}");
            assert!(
                finished.stderr.contains(
                    object["error"]["message"]
                        .as_str()
                        .unwrap()
                        .lines()
                        .next()
                        .unwrap()
                )
            );
        }
    }
    assert_eq!(seen.len(), 11);
}

/// A daemon that is killed when dropped.
struct Daemon(Child);

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn what_is_printed_of_a_daemon_is_of_its_schema() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    fs::write(here.join("job.toml"), JOB).unwrap();
    fs::write(here.join("rig.toml"), "").unwrap();
    let child = Command::new(GONIOD)
        .args([
            "--config",
            "rig.toml",
            "--data",
            "data",
            "--listen",
            "127.0.0.1:0",
        ])
        .current_dir(here)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn();
    let mut daemon = Daemon(child.unwrap());
    let mut address = String::new();
    let mut stdout = BufReader::new(daemon.0.stdout.take().unwrap());
    stdout.read_line(&mut address).unwrap();
    let gonioctl = |arguments: &[&str]| {
        let mut command = Command::new(GONIOCTL);
        command.env("GONIOD_TOKEN_FILE", "data/tokens.toml");
        let where_it_is = ["--daemon", address.trim(), "--json"];
        run_by(command, here, &[arguments, &where_it_is].concat())
    };
    let mut schemas = Schemas(BTreeMap::new());
    let mut printed = |arguments: &[&str], kind: &str| {
        let finished = gonioctl(arguments);
        let what = format!("{arguments:?} ends with {}: {}", finished.code, finished.stderr);
        let values = serde_json::Deserializer::from_str(&finished.stdout).into_iter::<Value>();
        let values: Vec<Value> = values
            .map(|value| value.unwrap_or_else(|error| panic!("{what}: {error}")))
            .collect();
        assert!(!values.is_empty(), "{what}");
        for value in &values {
            assert_eq!(schemas.check(value, &what), kind, "{what}");
        }
        values
    };
    printed(&["jobs"], "queue");
    let submitted = printed(&["submit", "job.toml"], "queued-job");
    let id = submitted[0]["id"].as_str().unwrap();
    printed(&["ready", id], "queued-job");
    let events = printed(&["watch", id], "event");
    assert!(events.len() > 1, "{events:?}");
    let queue = printed(&["jobs", "--all"], "queue");
    assert_eq!(queue[0]["jobs"][0]["state"], "done");
    printed(&["jog", "light", "-40"], "rig-state");
    printed(&["park"], "rig-state");
    printed(&["run", "job.toml"], "run");
    let second = printed(&["submit", "job.toml"], "queued-job");
    printed(&["cancel", second[0]["id"].as_str().unwrap()], "queued-job");
    printed(&["stop"], "rig-state");
    let stopped = printed(&["estop"], "rig-state");
    printed(&["park"], "error");
    printed(
        &[
            "acknowledge",
            "--fault",
            stopped[0]["fault"]["id"].as_str().unwrap(),
        ],
        "rig-state",
    );
    printed(&["resume"], "error");
    printed(&["cancel", id], "error");
}

#[test]
fn what_is_wrong_in_a_file_is_told_by_file_line_and_key() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    fs::write(
        here.join("job.toml"),
        "[[plane]]\ntheta_r_deg = 89.0\nreadings = 10\n",
    )
    .unwrap();
    let told = run(GONIOCTL, here, &["plan", "job.toml", "--json"])
        .expect(2)
        .stdout;
    let error = &serde_json::from_str::<Value>(&told).unwrap()["error"];
    assert_eq!(error["kind"], "input");
    assert_eq!(error["file"], "job.toml");
    assert_eq!(error["line"], 2);
    assert_eq!(error["key"], "plane[0].theta_r_deg");
    let told = run(GONIOCTL, here, &["plan", "--json"]).expect(2).stdout;
    assert_eq!(
        serde_json::from_str::<Value>(&told).unwrap()["error"]["kind"],
        "arguments"
    );
}

#[test]
fn a_schema_that_there_is_not_is_answered_with_those_that_there_are() {
    let here = tempfile::tempdir().unwrap();
    let refused = run(GONIOCTL, here.path(), &["schema", "jobs"]).expect(2);
    for name in ["job", "rig", "error", "queue"] {
        assert!(refused.stderr.contains(name), "{name}: {}", refused.stderr);
    }
}
