//! `gonioctl doctor` finds what is wrong with a rig, says what to do about it, and moves nothing.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;

use rig::{Device, Dynamixel, RigFile};
use serde_json::Value;
use tests::{Finished, Simulator, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

/// Register of the X series that says how it is driven, and the value that is none of ours.
const OPERATING_MODE: u16 = 11;
const VELOCITY: u8 = 1;
/// Torque Enable of the servos, Lamp Enable of the photometer.
const ENABLE: u16 = 64;

/// Examines a rig through a rig file that names its port; asserts that nothing moved and nothing is left on.
fn examined(simulator: &Simulator, rig: &str) -> Finished {
    let temporary = tempfile::tempdir().unwrap();
    let port = simulator.server.path().display();
    fs::write(
        temporary.path().join("rig.toml"),
        format!("bus.port = \"{port}\"\n{rig}"),
    )
    .unwrap();
    let before = simulator.server.bench(|bench| bench.pose());
    let arguments = ["doctor", "--rig", "rig.toml", "--json"];
    let finished = run(GONIOCTL, temporary.path(), &arguments);
    assert_eq!(simulator.server.counters().goals, 0, "an arm was told to move");
    assert_eq!(simulator.server.bench(|bench| bench.pose()), before);
    for device in [Device::Light, Device::Sensor, Device::Photometer] {
        let on = simulator
            .server
            .bench(|bench| bench.device(device).read(ENABLE, 1).unwrap());
        assert_eq!(on, [0], "{device} was left on");
    }
    finished
}

/// Verdict, text and remedy of the first finding of a check that is not ok, else of the first.
fn finding(finished: &Finished, check: &str) -> (String, String, String) {
    let told: Value = serde_json::from_str(&finished.stdout).unwrap();
    let all = told["findings"].as_array().unwrap();
    let mut of_check: Vec<_> = all.iter().filter(|finding| finding["check"] == check).collect();
    of_check.sort_by_key(|finding| finding["verdict"] == "ok");
    let first = of_check
        .first()
        .unwrap_or_else(|| panic!("no {check} in {told:#}"));
    let text = |key: &str| first[key].as_str().unwrap_or_default().to_owned();
    (text("verdict"), text("text"), text("remedy"))
}

#[test]
fn a_sound_rig_passes_every_check() {
    let finished = examined(&Simulator::new(""), "").expect(0);
    let told: Value = serde_json::from_str(&finished.stdout).unwrap();
    let checks: Vec<_> = told["findings"].as_array().unwrap().iter().collect();
    let names: Vec<_> = checks
        .iter()
        .map(|finding| finding["check"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "clock",
            "disk",
            "port",
            "permission",
            "lock",
            "latency timer",
            "devices",
            "light servo",
            "sensor servo",
            "photometer",
            "round trip",
            "pose",
            "dark",
            "lamp"
        ]
    );
    for finding in &checks {
        // How much disk there is and how fast this machine answers is not the rig's doing.
        if !["disk", "round trip"].contains(&finding["check"].as_str().unwrap()) {
            assert_eq!(finding["verdict"], "ok", "{finding:#}");
        }
    }
    let round_trip = checks.iter().find(|finding| finding["check"] == "round trip");
    let bins = &round_trip.unwrap()["histogram"];
    let asked: u64 = bins
        .as_array()
        .unwrap()
        .iter()
        .map(|bin| bin["count"].as_u64().unwrap())
        .sum();
    assert_eq!(asked, 200, "every reply is in the histogram: {bins:#}");
}

#[test]
fn the_built_in_simulator_is_a_rig_too() {
    let temporary = tempfile::tempdir().unwrap();
    let finished = run(GONIOCTL, temporary.path(), &["doctor"]).expect(0);
    for check in [
        "latency timer",
        "all three answer at 1000000 baud",
        "% of nominal by the monitor",
    ] {
        assert!(
            finished.stdout.contains(check),
            "{check} is missing in {}",
            finished.stdout
        );
    }
}

#[test]
fn another_baud_rate_is_found() {
    let finished = examined(&Simulator::new(""), "bus.baud = 115200\n").expect(3);
    let (verdict, text, remedy) = finding(&finished, "devices");
    assert_eq!(verdict, "fail");
    assert_eq!(text, "light servo (id 1) gives no reply at 115200 baud");
    assert!(remedy.contains("set bus.baud = 1000000"), "{remedy}");
}

#[test]
fn a_servo_under_another_id_is_found_and_the_others_are_still_looked_at() {
    let finished = examined(&Simulator::new(""), "sensor.id = 17\n").expect(3);
    let (verdict, text, remedy) = finding(&finished, "devices");
    assert_eq!(
        (verdict.as_str(), text.as_str()),
        ("fail", "sensor servo (id 17) gives no reply at 1000000 baud")
    );
    assert!(
        remedy.starts_with("XM430-W350 (id 2) answers under an id"),
        "{remedy}"
    );
    assert_eq!(finding(&finished, "light servo").0, "ok");
    assert_eq!(finding(&finished, "photometer").0, "ok");
}

#[test]
fn a_wrong_operating_mode_comes_with_the_register_to_write() {
    let simulator = Simulator::new("");
    simulator.server.bench(|bench| {
        bench
            .device(Device::Sensor)
            .write(OPERATING_MODE, &[VELOCITY])
            .unwrap();
    });
    let finished = examined(&simulator, "").expect(3);
    let (verdict, text, _) = finding(&finished, "sensor servo");
    assert_eq!(verdict, "fail");
    assert!(
        text.contains("operating mode is 1, not 3 (position): write 3 to address 11"),
        "{text}"
    );
    assert_eq!(
        finding(&finished, "lamp").0,
        "ok",
        "one device's fault hides none of another"
    );
}

#[test]
fn arms_too_close_and_a_room_too_bright_are_told() {
    let simulator = Simulator::new("[sim]\ndark_offset_counts = 90000.0\n");
    let finished = examined(
        &simulator,
        "[envelope]\nseparation_deg = 60.0\n[light]\nmin_deg = -40.0\n[motion]\npark_light_deg = -40.0\n",
    )
    .expect(3);
    let (verdict, text, _) = finding(&finished, "pose");
    assert_eq!(verdict, "fail");
    assert!(text.contains("outside its limits"), "{text}");
    let (verdict, _, remedy) = finding(&finished, "dark");
    assert_eq!(verdict, "fail");
    assert!(remedy.contains("shines in"), "{remedy}");
}

#[test]
fn whoever_holds_the_port_is_named() {
    let simulator = Simulator::new("");
    let _held = Dynamixel::open(simulator.server.path(), &RigFile::default()).unwrap();
    let finished = examined(&simulator, "").expect(3);
    let (verdict, text, remedy) = finding(&finished, "lock");
    assert_eq!(verdict, "fail");
    let me = format!("(process {})", std::process::id());
    assert!(text.contains(&me), "{text} lacks {me}");
    assert!(remedy.contains("systemctl stop goniod"), "{remedy}");
    assert_eq!(
        simulator.server.counters().packets,
        0,
        "nothing is sent on a bus that another drives"
    );
}

#[test]
fn a_bad_rig_file_is_refused_before_anything_is_looked_at() {
    let temporary = tempfile::tempdir().unwrap();
    fs::write(temporary.path().join("rig.toml"), "bus.baud = 12345\n").unwrap();
    let finished = run(GONIOCTL, temporary.path(), &["doctor", "--rig", "rig.toml"]).expect(2);
    assert!(
        finished.stderr.contains("bus.baud is 12345"),
        "{}",
        finished.stderr
    );
}

#[test]
fn a_device_that_answers_pings_alone_is_told_with_the_register_to_write_and_a_run_says_the_same() {
    const STATUS_RETURN_LEVEL: u16 = 68;
    for device in [Device::Light, Device::Sensor, Device::Photometer] {
        let simulator = Simulator::new("");
        simulator
            .server
            .bench(|bench| bench.device(device).write(STATUS_RETURN_LEVEL, &[0]).unwrap());
        let finished = examined(&simulator, "").expect(3);
        assert_eq!(finding(&finished, "devices").0, "ok", "it answers a ping");
        let (verdict, text, _) = finding(&finished, &device.to_string());
        assert_eq!(verdict, "fail");
        assert!(text.contains("write 2 to address 68"), "{text}");
        let told: Value = serde_json::from_str(&finished.stdout).unwrap();
        let pointing_elsewhere = told["findings"].as_array().unwrap().iter().find(|finding| {
            let remedy = finding["remedy"].as_str().unwrap_or_default();
            finding["verdict"] == "fail" && ["cable", "power"].iter().any(|word| remedy.contains(word))
        });
        assert_eq!(pointing_elsewhere, None);

        let temporary = tempfile::tempdir().unwrap();
        simulator.rig_file(temporary.path());
        fs::write(
            temporary.path().join("job.toml"),
            "[[plane]]\ntheta_r_deg = 60\nreadings = 6\n",
        )
        .unwrap();
        let run = run(
            GONIOCTL,
            temporary.path(),
            &["run", "job.toml", "--rig", "rig.toml"],
        )
        .expect(3);
        assert!(run.stderr.contains("write 2 to address 68"), "{}", run.stderr);
        assert_eq!(simulator.server.counters().goals, 0);
    }
}

#[test]
fn a_supply_at_which_every_run_would_be_held_fails() {
    let simulator = Simulator::new("[sim]\nfault = [{ device = \"sensor\", what = { sag_s = 36000.0 } }]\n");
    let finished = examined(&simulator, "").expect(3);
    let (verdict, text, remedy) = finding(&finished, "suspend");
    assert_eq!(verdict, "fail");
    assert!(text.contains("sensor servo is 10.0 V"), "{text}");
    assert!(
        remedy.contains("to 11 V") && remedy.contains("suspend.supply_v"),
        "{remedy}"
    );
    // Where nobody watches it, no run is held.
    let _ = examined(&simulator, "[suspend]\nsupply_v = [0.0, 0.0]\n").expect(0);
}

#[test]
fn two_devices_with_one_id_are_told_as_that() {
    let simulator = Simulator::new("[sim]\nfault = [{ device = \"sensor\", what = { id = 1 } }]\n");
    let finished = examined(&simulator, "").expect(3);
    let (verdict, text, remedy) = finding(&finished, "devices");
    assert_eq!(verdict, "fail", "{text}");
    assert!(remedy.contains("two devices with one id"), "{text}: {remedy}");
}
