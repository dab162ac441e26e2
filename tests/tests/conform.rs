//! `gonioctl conform`: the same suite on the simulator as on the bench.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use rig::Device;
use serde_json::Value;
use tests::{Simulator, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

/// Torque Enable of the servos, Lamp Enable of the photometer.
const ENABLE: u16 = 64;

/// Runs the suite against a simulator; gives the exit code and the findings.
fn suite(simulator: &Simulator) -> (i32, Vec<Value>) {
    let temporary = tempfile::tempdir().unwrap();
    simulator.rig_file(temporary.path());
    let finished = run(
        GONIOCTL,
        temporary.path(),
        &["conform", "--rig", "rig.toml", "--restart", "--json"],
    );
    let told: Value = serde_json::from_str(&finished.stdout).unwrap_or_else(|_| panic!("{finished:?}"));
    (finished.code, told["findings"].as_array().unwrap().clone())
}

fn verdict(findings: &[Value], check: &str) -> String {
    let found = findings.iter().find(|finding| finding["check"] == check);
    found.unwrap_or_else(|| panic!("no {check}: {findings:#?}"))["verdict"]
        .as_str()
        .unwrap()
        .to_owned()
}

#[test]
fn the_simulator_passes_and_is_left_at_rest() {
    let simulator = Simulator::new("");
    let (code, findings) = suite(&simulator);
    for finding in &findings {
        // How fast this machine answers is not the rig's doing.
        if finding["check"] != "round trip" {
            assert_eq!(finding["verdict"], "ok", "{finding:#}");
        }
    }
    assert_eq!(code, 0);
    let checks: Vec<_> = findings
        .iter()
        .map(|finding| finding["check"].as_str().unwrap())
        .collect();
    for check in [
        "light profile",
        "sensor profile",
        "light repeat",
        "sensor repeat",
        "watchdogs",
        "light restart",
        "sensor restart",
        "dark ×1",
        "dark ×256",
        "linearity",
    ] {
        assert!(checks.contains(&check), "{check} is missing in {checks:?}");
    }
    let lamp = simulator
        .server
        .bench(|bench| bench.device(Device::Photometer).read(ENABLE, 1).unwrap());
    assert_eq!(lamp, [0], "the lamp was left on");
    let pose = simulator.server.bench(|bench| bench.pose());
    assert!(
        // Near enough, half a degree, by encoders that have half of a play of 0.25° beside them.
        (pose.light.deg() + 45.0).abs() < 0.65 && (pose.sensor.deg() - 45.0).abs() < 0.65,
        "{pose:?}"
    );
}

/// At rest the specimen is seen by its mirror direction or from beside it: the exposures are found either way.
#[test]
fn a_bent_photometer_is_told_from_a_straight_one() {
    for specimen in ["gold-paint", "lambert:0.5"] {
        for (lost, expected, code) in [(0.0, "ok", 0), (0.05, "warn", 0), (0.2, "fail", 3)] {
            let simulator = Simulator::new(&format!(
                "[sim]\nspecimen = \"{specimen}\"\nnonlinearity = {lost}\n"
            ));
            let (exit, findings) = suite(&simulator);
            let found = findings.iter().find(|finding| finding["check"] == "linearity");
            println!("{specimen}, {lost} lost at full scale: {found:?}");
            assert_eq!(verdict(&findings, "linearity"), expected, "{specimen}, {lost}");
            assert_eq!(exit, code, "{specimen}, {lost}: {findings:#?}");
        }
    }
}

#[test]
fn a_specimen_too_dark_to_tell_is_no_proof_of_linearity() {
    let simulator = Simulator::new("[sim]\nspecimen = \"black\"\n");
    let (_, findings) = suite(&simulator);
    assert_eq!(verdict(&findings, "linearity"), "warn", "{findings:#?}");
}

#[test]
fn an_arm_that_lags_behind_its_profile_is_found() {
    let simulator = Simulator::new("[motion]\ntimeout_ms = 3000\n[sim]\nfollowing_lag_ms = 200.0\n");
    let (code, findings) = suite(&simulator);
    assert_eq!(code, 3, "{findings:#?}");
    assert_eq!(verdict(&findings, "light profile"), "fail");
}

#[test]
fn nothing_moves_where_a_device_is_not_as_the_rig_file_says() {
    let simulator = Simulator::new("");
    simulator.server.bench(|bench| {
        bench.device(Device::Light).write(11, &[1]).unwrap();
    });
    let (code, findings) = suite(&simulator);
    assert_eq!(code, 3);
    assert_eq!(verdict(&findings, "light servo"), "fail");
    assert_eq!(simulator.server.counters().goals, 0, "an arm was told to move");
}
