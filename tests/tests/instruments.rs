//! A picoammeter on a TCP port in the place of the photometer: whole captures, and what may go wrong with it.

// Set-up outside the test functions, which clippy does not take for tests.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::time::Duration;

use firmware_sim::{Instrument, Server};
use rig::{Drive, Dynamixel, Exposure, FaultKind, Gain, RigFile};
use tests::{Captured, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

/// A rig whose detector is the simulated picoammeter.
const RIG: &str = "
[detector]
kind = \"scpi\"
address = \"sim\"
profile = \"keithley-6485\"
[photometer]
integration_min_us = 20000
integration_max_us = 200000
[calibration]
lamp = \"visits\"
";

const JOB: &str = "
[[plane]]
theta_r_deg = 45.0
readings = 12
distribution = \"lobe\"
[arc]
readings = 4
";

const EXPOSURE: Exposure = Exposure {
    integration_us: 20_000,
    gain: Gain::X1,
};

/// The simulator, its picoammeter, and a rig in front of both.
fn connected(more: &str) -> (Server, Instrument, Drive<Dynamixel>) {
    let text = RIG.replace("profile =", &format!("{more}\nprofile ="));
    let text = format!("{text}\n[sim]\nimperfections = \"none\"\n");
    let mut file = RigFile::parse(&text, Path::new("test.toml")).unwrap();
    let server = Server::start(&file).unwrap();
    let instrument = server.instrument(&file, "127.0.0.1:0").unwrap();
    file.detector.address = format!("tcp:{}", instrument.address());
    let rig = Dynamixel::open(server.path(), &file).unwrap();
    (server, instrument, Drive::new(rig, file))
}

fn captured(rig: &str) -> (Captured, String) {
    let temporary = tempfile::tempdir().unwrap();
    let directory = temporary.path();
    fs::write(directory.join("job.toml"), JOB).unwrap();
    fs::write(directory.join("rig.toml"), rig).unwrap();
    let finished = run(GONIOCTL, directory, &["run", "job.toml", "--rig", "rig.toml"]).expect(0);
    let captured = Captured::read(&directory.join(finished.stdout.trim()));
    (captured, finished.stderr)
}

/// Errors of the green channel against the true material, ascending.
fn errors(captured: &Captured, material: &str) -> Vec<f64> {
    let material = brdf::specimen(material).unwrap();
    let lit = captured.measurements.iter();
    let lit = lit.filter(|m| m.reading.accepted && m.reading.lamp);
    let mut errors: Vec<f64> = lit
        .map(|m| m.rgb().unwrap().y / material.eval(m.pose.incident(), m.pose.exitant()).y - 1.0)
        .map(f64::abs)
        .collect();
    errors.sort_by(f64::total_cmp);
    errors
}

#[test]
fn a_picoammeter_measures_what_the_node_measures() {
    for material in ["lambert:0.5", "gold-paint"] {
        let sim = format!("\n[sim]\nspecimen = \"{material}\"\n");
        let (by_meter, _) = captured(&format!("{RIG}{sim}"));
        let (by_node, _) = captured(&sim);
        let [meter, node] = [errors(&by_meter, material), errors(&by_node, material)];
        let median = |errors: &[f64]| errors[errors.len() / 2];
        println!(
            "{material}: {} readings by the picoammeter, {:.4} median, {:.4} at most; {} by the node, {:.4}, {:.4}",
            meter.len(),
            median(&meter),
            meter.last().unwrap(),
            node.len(),
            median(&node),
            node.last().unwrap(),
        );
        assert!(meter.len() >= 16, "{} readings", meter.len());
        assert!(median(&meter) < 0.01, "{meter:?}");
        let grey = by_meter.readings().all(|reading| {
            let [red, green, blue] = reading.counts.rgb;
            red == green && green == blue && reading.counts.monitor == 0
        });
        assert!(grey, "one channel is written to all three");
    }
}

#[test]
fn a_plan_and_the_doctor_say_what_it_cannot_do() {
    let temporary = tempfile::tempdir().unwrap();
    let directory = temporary.path();
    let fly = format!("{JOB}[sweep]\nmode = \"fly\"\n");
    fs::write(directory.join("job.toml"), fly).unwrap();
    fs::write(directory.join("rig.toml"), RIG).unwrap();
    let plan = run(GONIOCTL, directory, &["plan", "job.toml", "--rig", "rig.toml"]).expect(0);
    for said in [
        "grey",
        "no lamp monitor",
        "the arms stop for each reading",
        "cannot be read while the arms move",
    ] {
        assert!(
            plan.stdout.contains(said),
            "{said} is missing in: {}",
            plan.stdout
        );
    }
    let doctor = run(GONIOCTL, directory, &["doctor", "--rig", "rig.toml"]).expect(0);
    let told = format!("{}{}", doctor.stdout, doctor.stderr);
    assert!(
        told.contains("MODEL 6485") && told.contains("no monitor tells its output"),
        "{told}"
    );
    let always = RIG.replace("profile =", "lamp = \"always\"\nprofile =");
    fs::write(directory.join("always.toml"), always).unwrap();
    let doctor = run(GONIOCTL, directory, &["doctor", "--rig", "always.toml"]).expect(0);
    let told = format!("{}{}", doctor.stdout, doctor.stderr);
    assert!(told.contains("puts this lamp out"), "{told}");
}

#[tokio::test]
async fn a_lost_connection_and_a_late_answer_cost_a_reading_and_no_more() {
    let (_server, instrument, mut drive) = connected("timeout_ms = 500.0");
    drive.identify_all().await.unwrap();
    drive.lamp(true).await.unwrap();
    drive.wait(Duration::from_secs(1)).await.unwrap();
    let sound = drive.expose(EXPOSURE).await.unwrap();
    assert!(sound.rgb[0] > 1000 && !sound.saturated, "{sound:?}");
    let near = |counts: u32| (f64::from(counts) / f64::from(sound.rgb[0]) - 1.0).abs() < 0.01;

    instrument.faults(|faults| faults.drops = 1);
    let again = drive.expose(EXPOSURE).await.unwrap();
    assert!(near(again.rgb[0]), "{again:?} after {sound:?}");

    instrument.faults(|faults| {
        faults.late = 1;
        faults.late_by = Duration::from_millis(700);
        faults.answers = ["+1.000000E-12".to_owned()].into();
    });
    let again = drive.expose(EXPOSURE).await.unwrap();
    assert!(
        near(again.rgb[0]),
        "the late answer is not taken for this one: {again:?}"
    );
}

#[tokio::test]
async fn an_overflow_is_a_saturated_reading_and_no_number_is_a_fault() {
    let (server, instrument, mut drive) = connected("");
    drive.identify_all().await.unwrap();
    drive.lamp(true).await.unwrap();
    drive.expose(EXPOSURE).await.unwrap();
    instrument.faults(|faults| faults.answers = ["+9.900000E+37".to_owned()].into());
    let full = drive.expose(EXPOSURE).await.unwrap();
    assert!(
        full.saturated && full.rgb[0] == drive.file().photometer.full_scale,
        "{full:?}"
    );
    for nonsense in ["+9.910000E+37", "NaN", "what?"] {
        instrument.faults(|faults| faults.answers = [nonsense.to_owned()].into());
        let error = drive.expose(EXPOSURE).await.unwrap_err();
        assert_eq!(error.kind(), FaultKind::Refused, "{error}");
        drive.identify_all().await.unwrap();
    }
    assert!(drive.make_safe(false).await.is_empty());
    let lamp = server.bench(|bench| bench.device(rig::Device::Photometer).read(64, 1).unwrap()[0]);
    assert_eq!(lamp, 0);
}

#[tokio::test]
async fn a_command_that_it_refuses_is_told_with_its_own_words() {
    let (_server, _instrument, mut drive) = connected("setup = \"CURR:RNG 1\"");
    let error = drive.identify_all().await.unwrap_err();
    let source = std::error::Error::source(&error).unwrap().to_string();
    assert!(source.contains("-113,\"Undefined header\""), "{source}");
}

#[tokio::test]
async fn the_instrument_may_switch_the_lamp_itself() {
    let lamp = "lamp = \"scpi\"\nlamp_on = \"SOUR2:TTL 1\"\nlamp_off = \"SOUR2:TTL 0\"";
    let (_server, _instrument, mut drive) = connected(lamp);
    drive.identify_all().await.unwrap();
    drive.lamp(true).await.unwrap();
    drive.wait(Duration::from_secs(1)).await.unwrap();
    let lit = drive.expose(EXPOSURE).await.unwrap();
    drive.lamp(false).await.unwrap();
    drive.wait(Duration::from_secs(1)).await.unwrap();
    let dark = drive.expose(EXPOSURE).await.unwrap();
    assert!(lit.rgb[0] > 10 * dark.rgb[0], "{lit:?}, {dark:?}");
}
