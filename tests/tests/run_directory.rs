//! The command of the README: plan, capture over a pseudo-terminal, reconstruct, and a complete run directory.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tests::run;

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

#[test]
fn quickstart_fills_a_run_directory() {
    let temporary = tempfile::tempdir().unwrap();
    let out = temporary.path().to_str().unwrap();
    let finished = run(
        GONIOCTL,
        &root(),
        &["run", "config/jobs/quickstart.toml", "--out", out],
    )
    .expect(0);
    let directory = PathBuf::from(finished.stdout.trim());
    assert!(
        directory.starts_with(temporary.path()),
        "stdout is the path alone: {}",
        finished.stdout
    );
    for said in ["rig time", "wall time", "retries", "male"] {
        assert!(
            finished.stderr.contains(said),
            "{said} is missing in: {}",
            finished.stderr
        );
    }

    let mut names: Vec<_> = fs::read_dir(&directory)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    let expected = [
        "brdf.binary",
        "brdf.uncertainty.binary",
        "factors.csv",
        "journal",
        "preview.exr",
        "preview.png",
        "readings.csv",
        "report.html",
        "report.json",
        "run.json",
        "slice.exr",
    ];
    assert_eq!(
        names, expected,
        "exactly what the design names, and no temporary file"
    );

    let run_json = json(&directory.join("run.json"));
    assert_eq!(run_json["state"], "done");
    assert_eq!(run_json["exit_status"], 0);
    assert_eq!(run_json["readings"]["planned"], 204, "90 + 90 and 24 dark ones");
    assert_eq!(run_json["identities"].as_array().unwrap().len(), 3);
    let seconds = run_json["seconds"]["total"].as_f64().unwrap();
    assert!(
        (20.0..120.0).contains(&seconds),
        "a real rig takes about a minute: {seconds} s"
    );
    let phases = run_json["seconds"]["phases"].as_object().unwrap();
    let sum: f64 = phases.values().map(|v| v.as_f64().unwrap()).sum();
    assert!((sum - seconds).abs() < 1e-6, "phases add up to the total");

    let readings = fs::read_to_string(directory.join("readings.csv")).unwrap();
    let mut lines = readings.lines();
    let head = "index,sweep,light_commanded_deg,sensor_commanded_deg,light_measured_deg,sensor_measured_deg,\
                theta_r_deg,d_p,phi_p_deg,counts_r,counts_g,counts_b,counts_monitor,gain,integration_us,time_s,\
                f_r,f_g,f_b,flags";
    assert!(
        lines.next().unwrap().starts_with(head),
        "columns stay in this order"
    );
    let taken = run_json["readings"]["taken"].as_u64().unwrap();
    assert_eq!(lines.count() as u64, taken);

    let html = fs::read_to_string(directory.join("report.html")).unwrap();
    assert_eq!(html.matches("<svg").count(), 2, "both factors are drawn");
    assert!(html.contains("data:image/png;base64,"), "the picture is inside");
    assert!(
        !html.contains("http") && !html.contains("<script"),
        "nothing is fetched or run"
    );

    let report = json(&directory.join("report.json"));
    let male = report["errors"]["male"].as_f64().unwrap();
    assert!((0.001..0.05).contains(&male), "gold-paint at 70°: {male}");
    assert!(
        !report["left_out"].as_array().unwrap().is_empty(),
        "what was not measured is said"
    );
}

#[test]
fn plan_says_what_run_does() {
    let plan = run(
        GONIOCTL,
        &root(),
        &["plan", "config/jobs/quickstart.toml", "--json"],
    )
    .expect(0);
    let plan: Value = serde_json::from_str(&plan.stdout).unwrap();
    assert_eq!(plan["steps"].as_array().unwrap().len(), 204);
    let temporary = tempfile::tempdir().unwrap();
    let out = temporary.path().to_str().unwrap();
    let arguments = ["run", "config/jobs/quickstart.toml", "--out", out, "--json"];
    let ran = run(GONIOCTL, &root(), &arguments).expect(0);
    let ran: Value = serde_json::from_str(&ran.stdout).unwrap();
    let (said, took) = (
        plan["seconds"].as_f64().unwrap(),
        ran["rig_seconds"].as_f64().unwrap(),
    );
    assert!((took / said - 1.0).abs() < 0.15, "said {said} s, took {took} s");
}

#[test]
fn reconstruct_makes_the_same_files_again_from_the_journal_alone() {
    let temporary = tempfile::tempdir().unwrap();
    let arguments = [
        "run",
        "config/jobs/quickstart.toml",
        "--out",
        temporary.path().to_str().unwrap(),
    ];
    let finished = run(GONIOCTL, &root(), &arguments).expect(0);
    let directory = PathBuf::from(finished.stdout.trim());
    let mut before = Vec::new();
    for entry in fs::read_dir(&directory).unwrap() {
        let path = entry.unwrap().path();
        if path.file_name().unwrap() != "journal" {
            before.push((path.clone(), fs::read(&path).unwrap()));
            fs::remove_file(&path).unwrap();
        }
    }
    let _ = run(GONIOCTL, &root(), &["reconstruct", directory.to_str().unwrap()]).expect(0);
    assert_eq!(before.len(), 10);
    for (path, mut bytes) in before {
        let mut again = fs::read(&path).unwrap();
        if path.extension().is_some_and(|extension| extension == "exr") {
            // The encoder keeps attributes in a hash map: their order in the header is chance.
            bytes.sort_unstable();
            again.sort_unstable();
        }
        assert!(again == bytes, "{} came out different", path.display());
    }
    let exported = temporary.path().join("exported.binary");
    let arguments = ["export", directory.to_str().unwrap(), "--format", "merl", "--to"];
    let arguments = [&arguments[..], &[exported.to_str().unwrap()]].concat();
    let _ = run(GONIOCTL, &root(), &arguments).expect(0);
    assert!(fs::read(exported).unwrap() == fs::read(directory.join("brdf.binary")).unwrap());
}
