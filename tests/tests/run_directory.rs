//! The command of the README: plan, capture over a pseudo-terminal, reconstruct, and a complete run directory.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use brdf::{MerlTable, Spherical};
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
        "brdf.uncertainty.json",
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

    let stated = json(&directory.join("brdf.uncertainty.json"));
    let median = stated["median_relative"].as_f64().unwrap();
    assert!((0.02..0.5).contains(&median), "{stated}");
    assert!(stated["flagged"].as_f64().unwrap() < 0.1, "{stated}");

    let run_json = json(&directory.join("run.json"));
    assert_eq!(run_json["state"], "done");
    assert_eq!(run_json["exit_status"], 0);
    assert_eq!(run_json["verdict"], "good", "{}", finished.stderr);
    assert_eq!(
        run_json["readings"]["planned"], 72,
        "three times 14, 6 and 24 dark ones"
    );
    assert_eq!(run_json["identities"].as_array().unwrap().len(), 3);
    let seconds = run_json["seconds"]["total"].as_f64().unwrap();
    assert!(
        (15.0..60.0).contains(&seconds),
        "a real rig takes about half a minute: {seconds} s"
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
    assert_eq!(
        html.matches("<svg").count(),
        4,
        "every plane and the arc are drawn"
    );
    assert!(html.contains("data:image/png;base64,"), "the picture is inside");
    assert!(
        !html.contains("http") && !html.contains("<script"),
        "nothing is fetched or run"
    );

    let report = json(&directory.join("report.json"));
    let male = report["errors"]["male"].as_f64().unwrap();
    assert!(
        (0.0..0.002).contains(&male),
        "gold-paint from three planes: {male}"
    );
    let median = report["errors"]["median_rel"].as_f64().unwrap();
    assert!(median < 0.02, "half of all pairs are within {median}");
    assert!(
        !report["left_out"].as_array().unwrap().is_empty(),
        "what was not measured is said"
    );

    let pace = |key: &str| report["pace"][key].as_f64().unwrap();
    println!("{}", report["pace"]);
    assert_eq!(pace("taken_s"), seconds);
    assert_eq!(pace("in_flight"), 0.0);
    assert!((pace("ratio") - seconds / pace("floor_s")).abs() < 1e-9);
    // What the bus adds to the 1.15 of a rig without one, in the simulator's own time.
    assert!((1.0..1.2).contains(&pace("ratio")), "{}", report["pace"]);
    assert!(html.contains(&format!("the {:.1} s that motion", pace("floor_s"))));
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
    assert_eq!(plan["steps"].as_array().unwrap().len(), 72);
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

/// Nothing lies on the stage, and the job is done all the same.
#[test]
fn what_was_measured_and_is_not_usable_says_so_last_and_by_its_exit_code() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    fs::write(here.join("rig.toml"), "[sim]\nspecimen = \"black\"\n").unwrap();
    let job = "[[plane]]\ntheta_r_deg = 45.0\nreadings = 12\n[arc]\nreadings = 6\n";
    fs::write(here.join("job.toml"), job).unwrap();
    let run_it = |more: &[&str]| {
        let arguments = ["run", "job.toml", "--rig", "rig.toml", "--out", "runs"];
        run(GONIOCTL, here, &[&arguments[..], more].concat()).expect(6)
    };
    let finished = run_it(&[]);
    let last = finished.stderr.lines().last().unwrap();
    assert!(last.contains("measured, but not usable"), "{}", finished.stderr);
    assert!(
        finished.stderr.contains("bad       reflectance:"),
        "{}",
        finished.stderr
    );
    let directory = here.join(finished.stdout.trim());
    let run_json = json(&directory.join("run.json"));
    assert_eq!(
        (&run_json["state"], &run_json["verdict"], &run_json["exit_status"]),
        (&"done".into(), &"bad".into(), &6.into())
    );
    let html = fs::read_to_string(directory.join("report.html")).unwrap();
    assert!(html.contains("measured, but not usable"));
    let again = run(GONIOCTL, here, &["reconstruct", directory.to_str().unwrap()]).expect(6);
    assert!(
        again.stderr.contains("measured, but not usable"),
        "{}",
        again.stderr
    );
    let summary: Value = serde_json::from_str(&run_it(&["--json"]).stdout).unwrap();
    assert_eq!(
        (&summary["state"], &summary["verdict"], &summary["exit_status"]),
        (&"done".into(), &"bad".into(), &6.into())
    );
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
    assert_eq!(before.len(), 11);
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

/// By a histogram of directions that lies beside the job file: light within 10 … 40°, viewer within 0 … 30°.
#[test]
fn what_the_scene_does_not_look_at_is_minus_one_in_the_merl_file() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let job = "[[plane]]\ntheta_r_deg = 20.0\nreadings = 24\n[[plane]]\ntheta_r_deg = 60.0\nreadings = 24\n[arc]\n\
        readings = 16\n[reconstruction]\nmodel = \"planes\"\n[scene]\ndirections = \"seen.csv\"\n\
        channels = [\"g\", \"b\"]\n";
    fs::write(here.join("job.toml"), job).unwrap();
    fs::write(here.join("rig.toml"), "").unwrap();
    let rows = (10..40)
        .step_by(5)
        .flat_map(|i| (0..30).step_by(5).map(move |o| format!("{}.5,{o}.5,1\n", i)));
    let table: String = std::iter::once("theta_i_deg,theta_o_deg,weight\n".to_owned())
        .chain(rows)
        .collect();
    fs::write(here.join("seen.csv"), table).unwrap();
    let planned = run(GONIOCTL, here, &["plan", "job.toml", "--rig", "rig.toml"]).expect(0);
    assert!(planned.stdout.contains("left out"), "{}", planned.stdout);
    let finished = run(GONIOCTL, here, &["run", "job.toml", "--rig", "rig.toml"]).expect(0);
    let directory = here.join(finished.stdout.trim());
    // The run says all that it needs.
    fs::remove_file(here.join("seen.csv")).unwrap();
    let again = run(GONIOCTL, here, &["reconstruct", directory.to_str().unwrap()]);
    let _ = again.expect(0);
    let found = MerlTable::read(&directory.join("brdf.binary")).unwrap();
    let within = |theta: f64, [low, high]: [f64; 2]| (low - 1e-6..=high + 1e-6).contains(&theta.to_degrees());
    let looked_at = |i: f64, o: f64| within(i, [10.0, 40.0]) && within(o, [0.0, 30.0]);
    let mut inside = 0;
    for (n, &[r, g, b]) in found.nodes().iter().enumerate() {
        let index = [n / (90 * 180), n / 180 % 90, n % 180];
        let (incident, exitant) = MerlTable::coordinates(index).directions();
        let [i, o] = [incident, exitant].map(|direction| Spherical::from_direction(direction).theta);
        // One entry holds a pair and the same pair swapped.
        if looked_at(i, o) || looked_at(o, i) {
            inside += 1;
            assert!(r < 0.0 && g >= 0.0 && b >= 0.0, "{index:?}: {r} {g} {b}");
        } else {
            assert!(
                [r, g, b].iter().all(|&value| value < 0.0),
                "{index:?}: {r} {g} {b}"
            );
        }
    }
    assert!(inside > 1000, "{inside} entries");
}
