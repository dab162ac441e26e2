use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use firmware_sim::Server;
use goniod::{Action, Daemon, Events, FaultCode, FaultView, Job, JobState, Settings};
use rig::RigFile;
use sqlx::{Connection, SqliteConnection};

use crate::bench::{Bench, SHORT, acknowledge, idle, on_stage, operator, readings, rig, state, submission};

/// Real time, so that there is time for a mishap.
const REAL: &str = "sim.clock = \"real\"\n";

/// The fault that ended a job, after it was interrupted.
async fn interrupted(daemon: &Daemon, events: &mut Events, job: &Job) -> FaultView {
    state(events, job.id, JobState::Interrupted).await;
    idle(daemon).await.fault.expect("a fault is latched")
}

/// Acknowledges and goes on; every step must be there once in the end.
async fn finish(daemon: &Daemon, events: &mut Events, job: &Job) {
    if daemon.rig().borrow().fault.is_some() {
        acknowledge(daemon).await;
    }
    daemon.act(&operator(), job.id, Action::Resume).await.unwrap();
    let done = state(events, job.id, JobState::Done).await;
    let run = done.run.unwrap();
    let mut steps: Vec<usize> = daemon
        .readings(&run)
        .await
        .unwrap()
        .iter()
        .filter(|reading| reading.accepted)
        .map(|reading| reading.step)
        .collect();
    steps.sort_unstable();
    let planned = daemon.run(&run).await.unwrap().planned as usize;
    assert_eq!(steps, (0..planned).collect::<Vec<_>>());
}

fn plug_in(link: &Path, rig: &str) -> Server {
    let mut server = Server::start(&RigFile::parse(rig, "rig.toml".as_ref()).unwrap()).unwrap();
    server.link(link).unwrap();
    server
}

#[tokio::test]
async fn a_port_that_is_pulled_and_comes_back_under_another_name() {
    let bench = Bench::new("");
    // As /dev/serial/by-id has it: one name, whatever the system calls the port today.
    let link = bench.folder.path().join("by-id");
    let bench = Bench {
        rig: format!("[bus]\nport = \"{}\"\n[sim]\nclock = \"real\"\n", link.display()),
        ..bench
    };
    let server = plug_in(&link, &bench.rig);
    let old_name = server.path().to_owned();
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let job = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    readings(&mut events, 3).await;
    drop(server);
    let fault = interrupted(&daemon, &mut events, &job).await;
    assert!(
        matches!(fault.code, FaultCode::Disconnected | FaultCode::NoReply),
        "{fault:?}"
    );
    rig(&daemon, |rig| !rig.connected).await;
    let mut taken = Vec::new();
    let _server = loop {
        let server = plug_in(&link, "");
        if server.path() != old_name {
            break server;
        }
        // Kept, so that the system does not give out this name again.
        taken.push(server);
    };
    rig(&daemon, |rig| rig.connected).await;
    finish(&daemon, &mut events, &job).await;
    daemon.shutdown().await;
}

#[tokio::test]
async fn a_database_that_another_program_locks() {
    let bench = Bench::new(REAL);
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let job = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    readings(&mut events, 2).await;
    let path = format!("sqlite://{}", bench.data().join("goniod.db").display());
    let mut other = SqliteConnection::connect(&path).await.unwrap();
    // Competes with the daemon for the lock until it has it.
    while sqlx::query("BEGIN IMMEDIATE").execute(&mut other).await.is_err() {}
    let view = rig(&daemon, |rig| rig.fault.is_some()).await;
    let fault = view.fault.expect("just seen");
    assert_eq!(fault.code, FaultCode::StoreLocked);
    assert!(fault.text.contains("locked"), "{fault:?}");
    // The store has it as running and may not be changed; who asks is told what is.
    idle(&daemon).await;
    let told = daemon.job(job.id).await.unwrap();
    assert_eq!(told.state, JobState::Interrupted);
    assert!(told.why.is_some_and(|why| why.contains("locked")));
    sqlx::query("ROLLBACK").execute(&mut other).await.unwrap();
    other.close().await.unwrap();
    daemon.shutdown().await;

    let bench = Bench {
        rig: String::new(),
        ..bench
    };
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    // The fault is latched still, since it has a file of its own.
    assert_eq!(
        daemon.rig().borrow().fault.as_ref().map(|fault| fault.code),
        Some(FaultCode::StoreLocked)
    );
    finish(&daemon, &mut events, &job).await;
    daemon.shutdown().await;
}

#[tokio::test]
async fn a_run_directory_that_cannot_be_written_is_made_from_the_store_later() {
    let bench = Bench::new("");
    let runs = bench.data().join("runs");
    std::fs::create_dir_all(bench.data()).unwrap();
    // Nothing can be made below a file, whoever asks.
    std::fs::write(&runs, "in the way").unwrap();
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let job = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    let fault = interrupted(&daemon, &mut events, &job).await;
    assert_eq!(fault.code, FaultCode::Report, "{fault:?}");
    assert!(fault.text.contains("runs"), "{fault:?}");
    std::fs::remove_file(&runs).unwrap();
    finish(&daemon, &mut events, &job).await;
    let run = daemon.job(job.id).await.unwrap().run.unwrap();
    let directory = daemon.run(&run).await.unwrap().directory;
    let made = daemon.make_file(&run, "brdf.binary").await.unwrap().unwrap();
    let brdf = std::fs::read(made).unwrap();
    std::fs::remove_dir_all(&runs).unwrap();
    daemon.rebuild(&run).await.unwrap();
    assert!(brdf == std::fs::read(directory.join("brdf.binary")).unwrap());
    daemon.shutdown().await;
    std::fs::remove_dir_all(&runs).unwrap();
    assert!(
        goniod::rebuild(&directory).await.unwrap().is_some(),
        "without a daemon too"
    );
    assert!(brdf == std::fs::read(directory.join("brdf.binary")).unwrap());
}

static BACK_S: AtomicU64 = AtomicU64::new(0);

fn clock() -> SystemTime {
    SystemTime::now() - Duration::from_secs(BACK_S.load(Ordering::Relaxed))
}

#[tokio::test]
async fn a_clock_that_steps_back_changes_no_order() {
    let bench = Bench::new("");
    let settings = Settings {
        clock,
        ..bench.settings()
    };
    let daemon = Daemon::open(settings.clone()).await.unwrap();
    let mut events = daemon.events(None);
    let first = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    readings(&mut events, 5).await;
    BACK_S.store(24 * 3600, Ordering::Relaxed);
    let second = daemon.submit(&operator(), submission(SHORT)).await.unwrap();
    assert!(second.submitted < first.submitted && second.place > first.place);
    state(&mut events, first.id, JobState::Done).await;
    state(&mut events, second.id, JobState::AwaitingSpecimen).await;
    daemon.act(&operator(), second.id, Action::Ready).await.unwrap();
    state(&mut events, second.id, JobState::Done).await;
    let last = daemon.events(Some(0)).next().await.unwrap().id;
    daemon.shutdown().await;
    let daemon = Daemon::open(settings).await.unwrap();
    daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    let next = daemon.events(Some(0)).next().await.unwrap().id;
    assert!(next > last, "event ids go on: {last}, {next}");
    daemon.shutdown().await;
}

#[tokio::test]
async fn a_store_that_was_deleted_emptied_or_replaced_beside_runs_is_noticed() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let job = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    state(&mut events, job.id, JobState::Done).await;
    daemon.shutdown().await;
    let store = bench.data().join("goniod.db");
    let kept = std::fs::read(&store).unwrap();
    let fresh = {
        let other = Bench::new("");
        other.open().await.shutdown().await;
        std::fs::read(other.data().join("goniod.db")).unwrap()
    };
    for (how, bytes) in [
        ("deleted", None),
        ("emptied", Some(Vec::new())),
        ("replaced", Some(fresh)),
    ] {
        std::fs::remove_file(&store).unwrap();
        if let Some(bytes) = &bytes {
            std::fs::write(&store, bytes).unwrap();
        }
        let refused = Daemon::open(bench.settings()).await.err().expect(how).to_string();
        for said in ["goniod restore", "--accept-runs", "runs"] {
            assert!(refused.contains(said), "{how}: {refused}");
        }
        let left = std::fs::read(&store).ok();
        assert_eq!(
            left.map(|left| left.is_empty()),
            bytes.map(|bytes| bytes.is_empty()),
            "{how}"
        );
        std::fs::write(&store, &kept).unwrap();
    }
    bench.open().await.shutdown().await;
}
