//! A capture in flight over a pseudo-terminal, in wire time.

use std::fs;

use tests::{Captured, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

const JOB: &str = "
[[plane]]
theta_r_deg = 70.0
readings = 90
[arc]
readings = 90
[sweep]
mode = \"fly\"
";

#[test]
fn a_flight_over_the_wire_is_short_and_true() {
    let temporary = tempfile::tempdir().unwrap();
    let directory = temporary.path();
    fs::write(directory.join("job.toml"), JOB).unwrap();
    fs::write(directory.join("rig.toml"), "[sim]\nspecimen = \"gold-paint\"\n").unwrap();
    let finished = run(GONIOCTL, directory, &["run", "job.toml", "--rig", "rig.toml"]).expect(0);
    let captured = Captured::read(&directory.join(finished.stdout.trim()));
    let ticks: Vec<u64> = captured.readings().map(|reading| reading.device_ticks).collect();
    let seconds = (ticks.iter().max().unwrap() - ticks.iter().min().unwrap()) as f64 * 1e-5;
    let lit: Vec<_> = captured
        .measurements
        .iter()
        .filter(|m| m.reading.accepted && m.reading.lamp)
        .collect();
    let flown = lit.iter().filter(|m| m.reading.swept_rad.is_some()).count();
    let material = brdf::specimen("gold-paint").unwrap();
    let mut errors: Vec<f64> = lit
        .iter()
        .map(|m| m.rgb().unwrap().y / material.eval(m.pose.incident(), m.pose.exitant()).y - 1.0)
        .map(f64::abs)
        .collect();
    errors.sort_by(f64::total_cmp);
    let (median, p95) = (errors[errors.len() / 2], errors[errors.len() * 95 / 100]);
    println!(
        "{seconds:.1} s, {flown} of {} in flight, errors {median:.4} median, {p95:.4} p95",
        lit.len()
    );
    assert!(seconds < 40.0, "{seconds} s");
    assert!(flown * 10 > lit.len() * 8, "{flown} of {} in flight", lit.len());
    assert!(
        median < 0.01 && p95 < 0.04,
        "median {median}, 95th percentile {p95}"
    );
}
