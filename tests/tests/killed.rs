//! The daemon is killed at random moments, or runs out of disk, and loses nothing.
//! `cargo build -p tests && cargo run -p tests --bin kills -- 200` kills it 200 times.

use std::time::{SystemTime, UNIX_EPOCH};

use tests::{Captured, Service, Simulator};

const DAEMON: &str = env!("CARGO_BIN_EXE_e2e-daemon");
const JOB: &str = "on_stage = true\n[[plane]]\ntheta_r_deg = 60\nreadings = 100\n[arc]\nreadings = 100\n";

#[test]
fn twenty_kills_lose_and_double_nothing() {
    let seed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs();
    println!("seed {seed}");
    let tally = tests::kills(DAEMON, seed, 20);
    println!("{tally:?}");
}

#[test]
fn a_full_disk_is_a_fault_and_the_run_goes_on_later() {
    let folder = tempfile::tempdir().unwrap();
    let simulator = Simulator::new("");
    let (rig, data) = (simulator.rig_file(folder.path()), folder.path().join("data"));
    let job = folder.path().join("job.toml");
    std::fs::write(&job, JOB).unwrap();
    let mut service = Service::start_by(tests::on_a_full_disk(DAEMON, 1500), &rig, &data);
    let id = service.ask(&format!("submit {}", job.display()))["id"].clone();
    let mut told = Vec::new();
    let fault = service.until(|said| {
        if said["event"] == "reading" {
            told.push(said["reading"]["step"].as_u64().unwrap());
        }
        (said["event"] == "fault").then(|| said["fault"].clone())
    });
    assert!(
        // A limit on a file's size is told as the one or the other, by which of SQLite's files meets it.
        ["disk_full", "disk_error"].contains(&fault["code"].as_str().unwrap()),
        "{fault}"
    );
    assert!(told.len() > 3, "{} readings before the disk was full", told.len());
    service.kill();
    let mut service = Service::start(DAEMON, &rig, &data);
    service.until(|said| said.get("open").cloned());
    // Refused where the disk was too full to keep the fault as well.
    service.tell("acknowledge");
    service.until(|said| said.get("answer").or(said.get("refusal")).cloned());
    service.ask(&format!("resume {}", id.as_str().unwrap()));
    service.until(|said| {
        assert!(said["event"] != "fault", "{said}");
        (said["event"] == "job" && said["job"]["state"] == "done").then_some(())
    });
    let run = std::fs::read_dir(data.join("runs"))
        .unwrap()
        .next()
        .unwrap()
        .unwrap()
        .path();
    let captured = Captured::read(&run);
    let mut steps: Vec<u64> = captured
        .readings()
        .filter(|reading| reading.accepted)
        .map(|reading| reading.step as u64)
        .collect();
    assert!(
        told.iter()
            .all(|step| captured.readings().any(|reading| reading.step as u64 == *step))
    );
    steps.sort_unstable();
    assert_eq!(
        steps,
        (0..steps.len() as u64).collect::<Vec<_>>(),
        "each step once"
    );
}
