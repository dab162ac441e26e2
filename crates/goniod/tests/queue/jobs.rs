use capture::{FileJournal, Record};
use goniod::{Action, JobState, RefusalKind, RunQuery, VerdictView, What};
use rig::RigFile;

use crate::bench::{Bench, SHORT, idle, on_stage, operator, readings, rig, state, submission, until};

#[tokio::test]
async fn a_job_waits_for_its_specimen_and_leaves_a_whole_run() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let job = daemon.submit(&operator(), submission(SHORT)).await.unwrap();
    state(&mut events, job.id, JobState::AwaitingSpecimen).await;
    let second = daemon.submit(&operator(), submission(SHORT)).await.unwrap();
    let refusal = daemon
        .act(&operator(), second.id, Action::Resume)
        .await
        .unwrap_err();
    assert_eq!(refusal.kind, RefusalKind::Conflict, "{refusal}");
    daemon.act(&operator(), job.id, Action::Ready).await.unwrap();
    let done = state(&mut events, job.id, JobState::Done).await;
    state(&mut events, second.id, JobState::AwaitingSpecimen).await;
    let run = daemon.run(&done.run.unwrap()).await.unwrap();
    assert_eq!(run.accepted, run.planned);
    for file in [
        "journal",
        "run.json",
        "readings.csv",
        "brdf.uncertainty.json",
        "report.html",
    ] {
        assert!(run.directory.join(file).exists(), "{file}");
    }
    assert_eq!(
        daemon
            .readings(&run.id)
            .await
            .unwrap()
            .iter()
            .filter(|r| r.accepted)
            .count() as u64,
        run.planned
    );
    daemon.act(&operator(), second.id, Action::Cancel).await.unwrap();
    let states: Vec<_> = daemon.jobs().await.unwrap().iter().map(|job| job.state).collect();
    assert_eq!(states, [JobState::Cancelled, JobState::Done]);
    daemon.shutdown().await;
    assert!(events.next().await.is_some(), "what was told is still there");
}

#[tokio::test]
async fn that_a_specimen_is_on_the_stage_holds_for_the_stage_as_it_was() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let first = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    // Said while another specimen lies there: somebody is asked once it may have been exchanged, or not.
    let second = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    state(&mut events, first.id, JobState::Done).await;
    state(&mut events, second.id, JobState::AwaitingSpecimen).await;
    assert_eq!(daemon.runs(&RunQuery::latest(9)).await.unwrap().len(), 1);
    daemon.act(&operator(), second.id, Action::Ready).await.unwrap();
    state(&mut events, second.id, JobState::Done).await;
    // Said of an empty queue it holds at once.
    let third = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    state(&mut events, third.id, JobState::Done).await;
    daemon.shutdown().await;
}

/// Nothing lies on the stage: the job is done, and nobody may take what it measured for a specimen.
#[tokio::test]
async fn a_job_whose_result_is_none_is_done_and_bad() {
    let bench = Bench::new("sim.specimen = \"black\"");
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let job = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    let done = state(&mut events, job.id, JobState::Done).await;
    assert_eq!(done.verdict, Some(VerdictView::Bad), "who watches is told");
    let run = &daemon.runs(&RunQuery::latest(9)).await.unwrap()[0];
    assert_eq!(run.verdict, Some(VerdictView::Bad));
    let kept = daemon.jobs().await.unwrap();
    assert_eq!(kept[0].verdict, Some(VerdictView::Bad), "and who asks later");
    daemon.shutdown().await;
}

/// What is shown while a run goes on is what its report would say of the readings until then, also where the dark level
/// was read more than once.
#[tokio::test]
async fn a_live_reading_is_what_a_report_at_that_moment_would_say() {
    let bench = Bench::new("calibration.dark_every_min = 0.02");
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let job = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    let mut live = Vec::new();
    let run = until(&mut events, |event| match &event.what {
        What::Reading { reading, .. } => {
            live.push((**reading).clone());
            None
        }
        What::Job { job: now } if now.id == job.id && now.state == JobState::Done => now.run.clone(),
        _ => None,
    })
    .await;
    let directory = daemon.run(&run).await.unwrap().directory;
    let records = FileJournal::read(directory.join("journal")).unwrap();
    let rig = RigFile::parse(&bench.rig, "rig.toml".as_ref()).unwrap();
    let ends = (0..records.len()).filter(|&i| matches!(records[i], Record::Reading(_)));
    let reported: Vec<_> = ends
        .map(|i| report::measurements(&records[..=i], &rig).pop().unwrap())
        .collect();
    let sets = reported.chunk_by(|a, b| a.reading.lamp == b.reading.lamp);
    assert!(sets.count() > 4, "several series of dark readings");
    assert_eq!(live.len(), reported.len());
    for (live, reported) in live.iter().zip(&reported) {
        assert_eq!(
            live.f,
            reported.rgb().map(|rgb| rgb.to_array()),
            "step {}",
            live.step
        );
    }
    daemon.shutdown().await;
}

#[tokio::test]
async fn a_job_that_is_wrong_is_refused_with_its_line() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    let wrong = submission("[[plane]]\ntheta_r_deg = 95\nreadings = 1\n");
    let refusal = daemon.submit(&operator(), wrong).await.unwrap_err();
    assert_eq!(refusal.kind, RefusalKind::Invalid);
    assert!(
        refusal.why.contains("line 2") && refusal.why.contains("85"),
        "{refusal}"
    );
    assert!(daemon.jobs().await.unwrap().is_empty());
    daemon.shutdown().await;
}

#[tokio::test]
async fn a_shutdown_finishes_the_reading_and_the_run_goes_on_later() {
    let bench = Bench::new("sim.clock = \"real\"");
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let job = daemon.submit(&operator(), submission(&on_stage())).await.unwrap();
    readings(&mut events, 3).await;
    daemon.shutdown().await;
    let taken = {
        let daemon = bench.open().await;
        let again = daemon.job(job.id).await.unwrap();
        assert_eq!(again.state, JobState::Interrupted, "{again:?}");
        let view = rig(&daemon, |rig| rig.connected).await;
        assert!(!view.lamp && view.job.is_none());
        let taken = daemon.run(again.run.as_deref().unwrap()).await.unwrap().accepted;
        daemon.shutdown().await;
        taken
    };
    assert!(taken >= 3);
    // The rest in simulated time.
    let bench = Bench {
        rig: String::new(),
        ..bench
    };
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    daemon.act(&operator(), job.id, Action::Resume).await.unwrap();
    let done = state(&mut events, job.id, JobState::Done).await;
    let run = daemon.run(&done.run.unwrap()).await.unwrap();
    assert_eq!(run.accepted, run.planned);
    idle(&daemon).await;
    daemon.shutdown().await;
}

#[tokio::test]
async fn a_data_folder_has_one_daemon() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    let error = goniod::Daemon::open(bench.settings())
        .await
        .err()
        .expect("refused");
    assert!(error.to_string().contains("in use by another goniod"), "{error}");
    daemon.shutdown().await;
    bench.open().await.shutdown().await;
}
