//! What `[suspend]` watches holds a run over the wire and lets it go on, behind the daemon and in `gonioctl run`.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::time::Duration;

use capture::Record;
use firmware_sim::{Disturbance, Fault};
use rig::Device;
use serde_json::Value;
use tests::{Captured, Service, Simulator, run};

const JOB: &str = "on_stage = true\n[[plane]]\ntheta_r_deg = 60\nreadings = 60\n[arc]\nreadings = 60\n";
/// Time of the simulated rig for which the supply sags.
const SAG: Duration = Duration::from_secs(60);

fn sag(simulator: &Simulator, after: Duration) {
    simulator.server.bench(|bench| {
        bench.schedule(Fault {
            device: Device::Sensor,
            at: bench.now() + after,
            what: Disturbance::Sag(SAG),
        });
    });
}

/// Asserts that the only run in a directory held once, went on, and has every reading once.
fn assert_held_once(runs: &Path) {
    let found: Vec<_> = fs::read_dir(runs).unwrap().map(|e| e.unwrap().path()).collect();
    assert_eq!(found.len(), 1, "{found:?}");
    let captured = Captured::read(&found[0]);
    let count = |is: fn(&Record) -> bool| captured.records.iter().filter(|record| is(record)).count();
    assert_eq!(count(|record| matches!(record, Record::Suspended { .. })), 1);
    assert_eq!(count(|record| matches!(record, Record::Released { .. })), 1);
    let mut steps: Vec<usize> = captured
        .readings()
        .filter(|r| r.accepted)
        .map(|r| r.step)
        .collect();
    steps.sort_unstable();
    assert_eq!(steps, (0..steps.len()).collect::<Vec<_>>(), "each step once");
    let json: Value = serde_json::from_slice(&fs::read(found[0].join("run.json")).unwrap()).unwrap();
    let held_s = json["seconds"]["phases"]["suspended"].as_f64().unwrap();
    // Looked at every 2 s, and whoever is held looks at the rig meanwhile.
    assert!((held_s - SAG.as_secs_f64()).abs() < 5.0, "held for {held_s} s");
}

#[test]
fn the_daemon_holds_a_run_while_the_supply_sags() {
    let folder = tempfile::tempdir().unwrap();
    let simulator = Simulator::new("");
    let (rig, data) = (simulator.rig_file(folder.path()), folder.path().join("data"));
    let job = folder.path().join("job.toml");
    fs::write(&job, JOB).unwrap();
    let mut service = Service::start(env!("CARGO_BIN_EXE_e2e-daemon"), &rig, &data);
    service.ask(&format!("submit {}", job.display()));
    service.until(|said| (said["event"] == "reading").then_some(()));
    sag(&simulator, Duration::ZERO);

    let why = service.until(|said| {
        assert!(
            said["event"] != "fault" && said["job"]["state"] != "done",
            "{said}"
        );
        let text = said["text"].as_str().filter(|_| said["event"] == "warning");
        text.filter(|text| text.starts_with("the run holds"))
            .map(str::to_owned)
    });
    assert!(why.contains("sensor servo is 10.0 V"), "{why}");
    service.until(|said| {
        assert!(
            said["event"] != "reading" && said["event"] != "step",
            "while it holds: {said}"
        );
        let activity = said["activity"].as_str().filter(|_| said["event"] == "activity");
        activity.map(|activity| assert_eq!(activity, "running"))
    });
    service.until(|said| {
        assert!(said["event"] != "fault", "{said}");
        (said["event"] == "job" && said["job"]["state"] == "done").then_some(())
    });
    assert_held_once(&data.join("runs"));
}

#[test]
fn gonioctl_run_says_why_it_holds_and_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let simulator = Simulator::new("");
    simulator.rig_file(folder.path());
    fs::write(folder.path().join("job.toml"), JOB).unwrap();
    sag(&simulator, Duration::from_secs(8));
    let finished = run(
        env!("CARGO_BIN_EXE_e2e-gonioctl"),
        folder.path(),
        &["run", "job.toml", "--rig", "rig.toml"],
    )
    .expect(0);
    assert!(
        finished.stderr.contains("sensor servo is 10.0 V"),
        "{}",
        finished.stderr
    );
    assert_held_once(&folder.path().join("runs"));
}
