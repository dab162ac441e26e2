//! A noisy bus costs retries and no result; a dead one ends safely, and the run goes on later.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::time::Duration;

use capture::{Outcome, Record};
use firmware_sim::{Disturbance, Fault};
use rig::Device;
use tests::{Captured, Simulator, difference, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

const JOB: &str = "[[plane]]\ntheta_r_deg = 70.0\nreadings = 60\n[arc]\nreadings = 60\n";
const RUN: [&str; 4] = ["run", "job.toml", "--rig", "rig.toml"];

/// Lamp Enable of the photometer (docs/photometer.md) and Moving of the X series.
const LAMP: u16 = 64;
const MOVING: u16 = 122;

/// The only run in a directory.
fn only_run(directory: &Path) -> Captured {
    let runs: Vec<_> = fs::read_dir(directory.join("runs"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    assert_eq!(runs.len(), 1, "{runs:?}");
    Captured::read(&runs[0])
}

#[test]
fn a_noisy_bus_gives_the_same_brdf_and_a_count_of_retries() {
    let rig = |wire: &str| format!("[sim]\nimperfections = \"none\"\n[sim.wire]\n{wire}\n");
    let [clean, noisy] = ["", "corrupt_byte = 0.002\ndrop_reply = 0.005"].map(|wire| {
        let temporary = tempfile::tempdir().unwrap();
        let simulator = Simulator::new(&rig(wire));
        simulator.rig_file(temporary.path());
        fs::write(temporary.path().join("job.toml"), JOB).unwrap();
        let _ = run(GONIOCTL, temporary.path(), &RUN).expect(0);
        let counters = simulator.server.counters();
        (temporary, counters.hurt + counters.dropped)
    });
    assert_eq!(clean.1, 0);
    assert!(noisy.1 > 0, "the bus was noisy");
    let [clean, noisy] = [clean, noisy].map(|(temporary, _)| (only_run(temporary.path()), temporary));
    let retries = |run: &Captured| {
        run.readings()
            .map(|reading| u64::from(reading.retries))
            .sum::<u64>()
    };
    assert_eq!(retries(&clean.0), 0);
    assert!(retries(&noisy.0) > 0);
    let [a, b] = [&clean.0, &noisy.0].map(|run| run.directory.join("brdf.binary"));
    let (median, p99) = difference(&b, &a);
    assert!(median < 0.002 && p99 < 0.01, "median {median}, p99 {p99}");
}

/// Runs a job until a fault ends it, asserts that it ended well, clears the fault and resumes.
fn fault_and_resume(at: Duration, arm: &Simulator, fault: impl FnOnce(), clear: impl FnOnce(), says: &str) {
    let simulator = arm;
    let temporary = tempfile::tempdir().unwrap();
    simulator.rig_file(temporary.path());
    fs::write(temporary.path().join("job.toml"), JOB).unwrap();
    fault();
    let finished = run(GONIOCTL, temporary.path(), &RUN).expect(3);
    assert!(
        finished.stderr.contains(says),
        "\"{says}\" is missing in: {}",
        finished.stderr
    );

    let (now, lamp, moving) = simulator.server.bench(|bench| {
        let lamp = bench.device(Device::Photometer).read(LAMP, 1).unwrap()[0];
        let moving = bench.device(Device::Light).read(MOVING, 1).unwrap()[0];
        (bench.now(), lamp, moving)
    });
    assert_eq!(lamp, 0, "the lamp is off");
    assert_eq!(moving, 0, "the other arm stands");
    let late = now.saturating_sub(at);
    assert!(
        late < Duration::from_secs(2),
        "it took {late:?} of the rig's time to end"
    );

    let broken = only_run(temporary.path());
    let before = broken.readings().filter(|reading| reading.accepted).count();
    assert!(before > 30, "{before} readings are on disk");
    let ended = broken.records.last();
    assert!(
        matches!(
            ended,
            Some(Record::End {
                outcome: Outcome::Failed { .. },
                ..
            })
        ),
        "{ended:?}"
    );

    clear();
    let directory = broken.directory.to_str().unwrap();
    let _ = run(GONIOCTL, temporary.path(), &["run", "--resume", directory]).expect(0);
    let whole = only_run(temporary.path());
    let accepted = whole.accepted();
    assert!(
        accepted.iter().all(|&n| n == 1),
        "each pose is measured once: {accepted:?}"
    );
    assert_eq!(
        &whole.records[..broken.records.len()],
        &broken.records[..],
        "nothing was lost"
    );
    assert!(whole.directory.join("brdf.binary").exists());
}

#[test]
fn a_servo_that_goes_silent_ends_the_run_safely() {
    let simulator = Simulator::new("");
    let at = Duration::from_secs(12);
    fault_and_resume(
        at,
        &simulator,
        || {
            simulator.server.faults(|faults| {
                faults.silent.insert(2, at);
            });
        },
        || simulator.server.faults(|faults| faults.silent.clear()),
        "sensor servo",
    );
}

#[test]
fn a_servo_that_trips_overload_ends_the_run_safely() {
    let simulator = Simulator::new("");
    let at = Duration::from_secs(12);
    let overload = Fault {
        device: Device::Sensor,
        at,
        what: Disturbance::OVERLOAD,
    };
    fault_and_resume(
        at,
        &simulator,
        || simulator.server.bench(|bench| bench.schedule(overload)),
        || {
            simulator.server.bench(|bench| {
                bench.device(Device::Sensor).reboot();
                let booted = bench.now() + Duration::from_secs(2);
                bench.advance_to(booted);
            });
        },
        "overload",
    );
}
