//! What a CI server asks of the command line: gates, JUnit files, keys of a cache.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use roxmltree::Document;
use tests::run;

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

const JOB: &str = "specimen = \"x\"\n[[plane]]\ntheta_r_deg = 70.0\nreadings = 10\n[arc]\nreadings = 10\n";

/// Names of all cases of a JUnit file, and of those that failed or could not be tried.
fn cases(path: &Path) -> (Vec<String>, Vec<String>) {
    let text = fs::read_to_string(path).unwrap();
    let document = Document::parse(&text).unwrap();
    let cases = document
        .descendants()
        .filter(|node| node.has_tag_name("testcase"));
    let name = |node: roxmltree::Node<'_, '_>| node.attribute("name").unwrap().to_owned();
    let is_bad = |node: &roxmltree::Node<'_, '_>| {
        node.children()
            .any(|child| child.has_tag_name("failure") || child.has_tag_name("error"))
    };
    (
        cases.clone().map(name).collect(),
        cases.filter(is_bad).map(name).collect(),
    )
}

#[test]
fn an_error_above_its_bound_closes_the_gate_and_is_named() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let eval = |bounds: &str| {
        let arguments = ["eval", "lambert:0.5", "lambert:0.4", "--fail-above", bounds];
        run(
            GONIOCTL,
            here,
            &[&arguments[..], &["--junit", "junit.xml"]].concat(),
        )
    };
    let within = eval("male=0.5,median_rel=0.3").expect(0);
    assert_eq!(within.stderr, "");
    let (names, bad) = cases(&here.join("junit.xml"));
    assert!(
        names.contains(&"male is at most 0.5".to_owned()) && bad.is_empty(),
        "{names:?} {bad:?}"
    );

    let above = eval("male=0.5,median_rel=0.1").expect(1);
    assert!(
        above.stderr.contains("median_rel is 0.") && above.stderr.contains("above its bound of 0.1 by"),
        "{}",
        above.stderr
    );
    assert!(
        !above.stderr.contains("male is"),
        "only what is above is named: {}",
        above.stderr
    );
    assert_eq!(cases(&here.join("junit.xml")).1, ["median_rel is at most 0.1"]);

    let unknown = eval("mole=0.1").expect(2);
    assert!(
        unknown.stderr.contains("male, median_rel, p95_rel"),
        "{}",
        unknown.stderr
    );

    // Black has no relative error against black: there is no pair with a reference above 0.
    let arguments = ["eval", "lambert:0", "lambert:0", "--fail-above", "rel_rms=1e300"];
    let none = run(GONIOCTL, here, &arguments);
    let value = run(GONIOCTL, here, &["eval", "lambert:0", "lambert:0", "--json"])
        .expect(0)
        .stdout;
    let value: serde_json::Value = serde_json::from_str(&value).unwrap();
    assert_eq!(none.code, i32::from(value["rel_rms"].is_null()), "{value}");
}

#[test]
fn what_could_not_be_tried_has_not_passed() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let arguments = ["eval", "lambert:0.5", "none.binary", "--junit", "junit.xml"];
    let _ = run(GONIOCTL, here, &arguments).expect(2);
    let (_, bad) = cases(&here.join("junit.xml"));
    assert_eq!(bad, ["gonioctl eval"]);
    fs::write(here.join("rig.toml"), "bus.port = \"none\"\n").unwrap();
    let arguments = ["conform", "--rig", "rig.toml", "--junit", "junit.xml"];
    let _ = run(GONIOCTL, here, &arguments).expect(3);
    assert_eq!(cases(&here.join("junit.xml")).1, ["gonioctl conform"]);
    // Nothing is done of which nobody could be told.
    let arguments = ["campaign", "--captures", "3", "--junit", "none/junit.xml"];
    let refused = run(GONIOCTL, here, &arguments).expect(2);
    assert!(refused.stderr.contains("none/junit.xml"), "{}", refused.stderr);
    assert!(!refused.stderr.contains("captures, seed"), "{}", refused.stderr);
}

#[test]
fn doctor_and_campaign_tell_each_check_and_each_capture() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let doctor = run(GONIOCTL, here, &["doctor", "--junit", "doctor.xml", "--json"]);
    let told: serde_json::Value = serde_json::from_str(&doctor.stdout).unwrap();
    let findings = told["findings"].as_array().unwrap();
    let of = |wanted: &[&str]| -> Vec<String> {
        let wanted = findings
            .iter()
            .filter(|finding| wanted.contains(&finding["verdict"].as_str().unwrap()));
        wanted
            .map(|finding| finding["check"].as_str().unwrap().to_owned())
            .collect()
    };
    let (names, bad) = cases(&here.join("doctor.xml"));
    assert_eq!(names, of(&["ok", "warn", "fail"]));
    assert_eq!(bad, of(&["fail"]));

    let arguments = [
        "campaign",
        "--captures",
        "4",
        "--seed",
        "11",
        "--junit",
        "campaign.xml",
    ];
    let _ = run(GONIOCTL, here, &arguments).expect(0);
    let (names, bad) = cases(&here.join("campaign.xml"));
    assert_eq!(
        names,
        [11, 12, 13, 14].map(|seed| format!("capture of seed {seed}"))
    );
    assert!(bad.is_empty(), "{bad:?}");
}

#[test]
fn a_key_of_a_cache_depends_on_what_is_said_and_not_on_how() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let hash = |job: &str, rig: &str, name: &str| {
        fs::write(here.join(name), job).unwrap();
        fs::write(here.join("rig.toml"), rig).unwrap();
        let told = run(GONIOCTL, here, &["plan", name, "--rig", "rig.toml", "--hash"]).expect(0);
        told.stdout.trim().to_owned()
    };
    let first = hash(JOB, "", "job.toml");
    assert!(
        first.len() == 64 && first.bytes().all(|byte| byte.is_ascii_hexdigit()),
        "{first}"
    );
    let otherwise = "# The same\narc = { readings = 10 }\nplane = [ { readings = 10, theta_r_deg = 70 } ]\nspecimen = 'x'\n";
    assert_eq!(
        hash(otherwise, "[light]\n\n[bus] # nothing\n", "other.toml"),
        first
    );
    assert_ne!(hash(&JOB.replace("70.0", "69.0"), "", "job.toml"), first);
    assert_ne!(hash(JOB, "envelope.separation_deg = 6.0\n", "job.toml"), first);
}
