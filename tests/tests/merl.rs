//! MERL in, MERL out: any MERL file is a specimen, and what comes out is the model to the last digit.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use brdf::{Brdf, MerlTable};
use glam::{DMat3, DVec3};
use serde_json::Value;
use tests::{Captured, entries, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

/// Writes a MERL file as the real ones are: negative below the horizon, and in a few places above it.
fn specimen(path: &Path) {
    let material = brdf::specimen("red-plastic").unwrap();
    let table = MerlTable::fill(&material);
    table.write(path).unwrap();
    let mut bytes = fs::read(path).unwrap();
    assert_eq!(bytes.len(), 34_992_012);
    for node in (0..3 * 1_458_000).step_by(997) {
        bytes[12 + 8 * node..20 + 8 * node].copy_from_slice(&(-0.25_f64).to_le_bytes());
    }
    fs::write(path, bytes).unwrap();
}

/// Incident and exitant direction of a node, by the description of the format and by nothing of ours.
fn directions(node: usize) -> (DVec3, DVec3) {
    let (k, j, i) = (node % 180, node / 180 % 90, node / 180 / 90);
    let theta_h = (i as f64 / 90.0).powi(2) * 90.0;
    let (theta_d, phi_d) = ((j as f64).to_radians(), (k as f64).to_radians());
    let d = DVec3::new(
        theta_d.sin() * phi_d.cos(),
        theta_d.sin() * phi_d.sin(),
        theta_d.cos(),
    );
    let mirrored = DVec3::new(-d.x, -d.y, d.z);
    let to_half = DMat3::from_rotation_y(theta_h.to_radians());
    (to_half * d, to_half * mirrored)
}

#[test]
fn a_merl_file_is_measured_and_the_model_is_written_as_it_is() {
    let temporary = tempfile::tempdir().unwrap();
    let directory = temporary.path();
    specimen(&directory.join("specimen.binary"));
    fs::write(
        directory.join("job.toml"),
        "[reconstruction]\nmodel = \"separable\"\n[[plane]]\ntheta_r_deg = 60.0\nreadings = 40\n[arc]\nreadings = 40\n",
    )
    .unwrap();
    fs::write(
        directory.join("rig.toml"),
        "[sim]\nspecimen = \"./specimen.binary\"\n",
    )
    .unwrap();
    let finished = run(GONIOCTL, directory, &["run", "job.toml", "--rig", "rig.toml"]).expect(0);
    let captured = Captured::read(&directory.join(finished.stdout.trim()));

    let stored = entries(&fs::read(captured.directory.join("brdf.binary")).unwrap());
    assert_eq!(stored.len(), 3 * 1_458_000);
    let model = captured.model();
    let mut checked = 0;
    for node in (0..1_458_000).step_by(7) {
        let (incident, exitant) = directions(node);
        let stored = [0, 1, 2].map(|channel| stored[channel * 1_458_000 + node]);
        // On the horizon itself rounding decides.
        if incident.z.min(exitant.z).abs() < 1e-9 {
            continue;
        }
        if incident.z < 0.0 || exitant.z < 0.0 {
            assert_eq!(stored, [-1.0; 3], "node {node} is below the horizon");
            continue;
        }
        let scale = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
        let expected = model.eval(incident, exitant).to_array();
        for channel in 0..3 {
            let value = stored[channel] * scale[channel];
            let error = (value - expected[channel]).abs() / expected[channel];
            assert!(
                error < 1e-12,
                "node {node}: {value} instead of {}",
                expected[channel]
            );
        }
        checked += 1;
    }
    assert!(checked > 100_000, "{checked} nodes were compared");
}

fn eval(directory: &Path, truth: &str, estimate: &str) -> Value {
    let finished = run(GONIOCTL, directory, &["eval", truth, estimate, "--json"]).expect(0);
    serde_json::from_str(&finished.stdout).unwrap()
}

#[test]
fn eval_of_a_file_against_itself_is_zero_and_against_black_is_the_black_score() {
    let temporary = tempfile::tempdir().unwrap();
    specimen(&temporary.path().join("a.binary"));
    let same = eval(temporary.path(), "a.binary", "a.binary");
    for key in ["male", "median_rel", "p95_rel", "rel_rms", "log_rel_rmse", "eq4"] {
        assert_eq!(same[key], 0.0, "{key}");
        assert_eq!(same["channels"]["g"][key], 0.0, "{key} of green");
    }
    let black = eval(temporary.path(), "a.binary", "black");
    let (eq4, eq4_black) = (
        black["eq4"].as_f64().unwrap(),
        black["eq4_black"].as_f64().unwrap(),
    );
    assert!((eq4 / eq4_black - 1.0).abs() < 1e-12, "{eq4} and {eq4_black}");
    assert!(black["pairs"].as_u64().unwrap() > 100_000);
}

#[test]
fn eval_takes_names_and_says_what_is_wrong_with_a_file() {
    let temporary = tempfile::tempdir().unwrap();
    let named = eval(temporary.path(), "gold-paint", "gold-paint");
    assert_eq!(named["male"], 0.0);
    fs::write(temporary.path().join("short.binary"), [0; 100]).unwrap();
    for (estimate, said) in [
        ("short.binary", "34992012"),
        ("./none.binary", "none.binary"),
        ("gold-pain", "gold-paint"),
    ] {
        let finished = run(GONIOCTL, temporary.path(), &["eval", "gold-paint", estimate]).expect(2);
        assert!(finished.stderr.contains(said), "{estimate}: {}", finished.stderr);
    }
}
