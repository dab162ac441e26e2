//! A rig that is not what its file says is refused with exit 3 before anything moves.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;

use rig::Device;
use tests::{Simulator, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

const JOB: &str = "[[plane]]\ntheta_r_deg = 70.0\nreadings = 10\n[arc]\nreadings = 10\n";

/// Operating Mode of the X series, and its value for velocity control.
const OPERATING_MODE: u16 = 11;
const VELOCITY: u8 = 1;

/// Runs a job with a rig file against a bench that `meddle` was let at; asserts exit 3 and that nothing moved.
fn refused(rig: &str, meddle: impl FnOnce(&Simulator), says: &[&str]) {
    let temporary = tempfile::tempdir().unwrap();
    let simulator = Simulator::new("");
    meddle(&simulator);
    let before = simulator.server.bench(|bench| bench.pose());
    let port = simulator.server.path().display();
    fs::write(
        temporary.path().join("rig.toml"),
        format!("bus.port = \"{port}\"\n{rig}"),
    )
    .unwrap();
    fs::write(temporary.path().join("job.toml"), JOB).unwrap();
    let arguments = ["run", "job.toml", "--rig", "rig.toml"];
    let finished = run(GONIOCTL, temporary.path(), &arguments).expect(3);
    for said in says {
        assert!(
            finished.stderr.contains(said),
            "\"{said}\" is missing in: {}",
            finished.stderr
        );
    }
    assert_eq!(simulator.server.counters().goals, 0, "an arm was told to move");
    assert_eq!(simulator.server.bench(|bench| bench.pose()), before);
    let runs = fs::read_dir(temporary.path().join("runs")).map_or(0, Iterator::count);
    assert_eq!(runs, 0, "a run was begun");
}

#[test]
fn a_servo_that_is_absent() {
    refused("sensor.id = 17\n", |_| {}, &["sensor servo", "17"]);
}

#[test]
fn a_servo_of_another_model() {
    refused(
        "light.model = \"XM540-W270\"\n",
        |_| {},
        &["light servo", "XM540-W270", "XM430-W350"],
    );
}

#[test]
fn another_baud_rate() {
    refused("bus.baud = 57600\n", |_| {}, &["light servo"]);
}

#[test]
fn another_operating_mode() {
    let meddle = |simulator: &Simulator| {
        let written = simulator
            .server
            .bench(|bench| bench.device(Device::Sensor).write(OPERATING_MODE, &[VELOCITY]));
        written.unwrap();
    };
    refused("", meddle, &["sensor servo", "mode"]);
}

#[test]
fn a_photometer_that_is_absent() {
    refused("photometer.id = 30\n", |_| {}, &["photometer"]);
}
