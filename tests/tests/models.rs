//! Every family of servos, and two arms of different ones, measure over the wire.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;

use arms::Arm;
use rig::dynamixel::MODELS;
use tests::{Captured, Simulator, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

const JOB: &str = "
[reconstruction]
model = \"separable\"
[[plane]]
theta_r_deg = 60.0
readings = 8
[arc]
readings = 8
";

/// Keys of an arm with a servo; the P series counts from the middle of its turn.
fn arm(table: &str, model: &str) -> String {
    let zero_deg = if model.starts_with('P') { 0 } else { 180 };
    format!("[{table}]\nmodel = \"{model}\"\nzero_deg = {zero_deg}\n")
}

/// A simulated bus of two servos.
fn simulator(light: &str, sensor: &str, more: &str) -> Simulator {
    Simulator::new(&format!(
        "{}{}{more}[sim]\nspecimen = \"white-paint\"\nimperfections = \"none\"\n",
        arm("light", light),
        arm("sensor", sensor)
    ))
}

/// Runs a whole job on a rig of two servos: all readings are good, and each is what the material is.
fn measures(light: &str, sensor: &str, more: &str) {
    measures_on(&simulator(light, sensor, more), &format!("{light} and {sensor}"));
}

fn measures_on(simulator: &Simulator, what: &str) {
    let temporary = tempfile::tempdir().unwrap();
    let directory = temporary.path();
    fs::write(directory.join("job.toml"), JOB).unwrap();
    simulator.rig_file(directory);
    let finished = run(GONIOCTL, directory, &["run", "job.toml", "--rig", "rig.toml"]).expect(0);
    let captured = Captured::read(&directory.join(finished.stdout.trim()));
    let material = brdf::specimen("white-paint").unwrap();
    let lit: Vec<_> = captured
        .measurements
        .iter()
        .filter(|m| m.reading.accepted && m.reading.lamp)
        .collect();
    assert_eq!(lit.len(), 16, "{what}");
    for measured in lit {
        let truth = material.eval(measured.pose.incident(), measured.pose.exitant()).y;
        let found = measured.rgb().unwrap().y;
        // The counts are whole, and the arms stand on whole counts of their encoders.
        assert!((found / truth - 1.0).abs() < 0.01, "{what}: {found}, not {truth}");
    }
}

#[test]
fn the_x_series_at_24_v_and_watertight_measures() {
    measures("XH430-V350", "XW540-T260", "");
}

#[test]
fn servos_without_current_registers_measure() {
    measures("XL430-W250", "2XC430-W250", "");
}

#[test]
fn the_small_servos_measure_whose_indirect_data_are_elsewhere() {
    measures("XL330-M288", "XC330-T181", "");
}

#[test]
fn the_mx_with_protocol_2_measures() {
    measures("MX-28", "MX-106", "");
}

#[test]
fn the_p_series_measures_with_its_other_table() {
    measures("PH54-200-S500", "PM42-010-S260", "");
}

#[test]
fn one_arm_of_the_p_series_and_one_of_the_x_series_measure() {
    measures("PH42-020-S300", "XD540-T270", "");
}

#[test]
fn the_slowest_and_the_fastest_baud_rates_measure() {
    for baud in [9_600, 4_500_000] {
        measures("XM430-W350", "XM540-W150", &format!("[bus]\nbaud = {baud}\n"));
    }
}

#[test]
fn the_doctor_tells_which_servos_there_are_and_finds_nothing_wrong_with_them() {
    let simulator = simulator("PM54-060-S250", "XC330-M288", "");
    let temporary = tempfile::tempdir().unwrap();
    simulator.rig_file(temporary.path());
    let doctor = run(GONIOCTL, temporary.path(), &["doctor", "--rig", "rig.toml"]).expect(0);
    for servo in ["PM54-060-S250 (id 1), firmware", "XC330-M288 (id 2), firmware"] {
        assert!(doctor.stdout.contains(servo), "{}", doctor.stdout);
    }
}

/// Before firmware 52 their indirect data are elsewhere.
#[test]
fn a_small_servo_of_old_firmware_is_read_register_by_register_and_told() {
    let simulator = simulator("XL330-M288", "XL330-M077", "");
    simulator.server.bench(|bench| bench.set_firmware(Arm::Light, 51));
    let temporary = tempfile::tempdir().unwrap();
    simulator.rig_file(temporary.path());
    let doctor = run(GONIOCTL, temporary.path(), &["doctor", "--rig", "rig.toml"]).expect(0);
    let told =
        "the light servo (XL330-M288) has no indirect data at a known place before firmware 52, and has 51";
    assert!(doctor.stdout.contains(told), "{}", doctor.stdout);
    measures_on(&simulator, "an XL330-M288 of firmware 51");
}

/// Every model is told by the driver as what it is, holds as its torque comes on, and stands where it should.
#[test]
fn every_model_is_known_to_driver_and_simulator() {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    for model in MODELS {
        let text = arm("light", model.name);
        let file = rig::RigFile::parse(&text, "rig.toml".as_ref()).unwrap();
        let simulator = Simulator::new(&text);
        let bus = rig::Dynamixel::open(simulator.server.path(), &file).unwrap();
        let mut drive = rig::Drive::new(bus, file);
        runtime.block_on(async {
            let [light, ..] = drive.identify_all().await.unwrap();
            assert_eq!(light.model, model.name);
            drive.engage_all().await.unwrap();
            let at = drive.snapshot().await.unwrap().pose();
            assert!((at.light.deg() + 45.0).abs() < 0.1, "{}: {at:?}", model.name);
        });
    }
}
