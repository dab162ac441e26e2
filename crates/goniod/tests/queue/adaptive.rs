//! Jobs that stop when good enough.

use capture::{FileJournal, Record};
use goniod::{JobState, RunView};

use crate::bench::{Bench, operator, readings, state, submission};

/// 48 readings first, 24 of them dark, and about as many again as fit into the budget.
const JOB: &str = "on_stage = true\n[[plane]]\ntheta_r_deg = 30\nreadings = 8\n[[plane]]\ntheta_r_deg = 70\nreadings = 8\n\
    [arc]\nreadings = 8\n[reconstruction]\nmodel = \"planes\"\n[sweep]\nbudget_s = 45\n";

fn records(run: &RunView) -> Vec<Record> {
    FileJournal::read(run.directory.join("journal")).unwrap()
}

fn added(records: &[Record]) -> Vec<usize> {
    let added = records.iter().filter_map(|record| match record {
        Record::Extension(extension) => Some(extension.steps.len()),
        _ => None,
    });
    added.collect()
}

#[tokio::test]
async fn what_is_added_is_in_the_journal_and_survives_a_restart() {
    let bench = Bench::new("");
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    let plan = daemon.plan(JOB).await.unwrap();
    assert!(plan.open);
    let job = daemon.submit(&operator(), submission(JOB)).await.unwrap();
    // Into what was added.
    readings(&mut events, plan.readings + 3).await;
    daemon.shutdown().await;
    let daemon = bench.open().await;
    let mut events = daemon.events(None);
    if daemon.job(job.id).await.unwrap().state != JobState::Done {
        daemon
            .act(&operator(), job.id, goniod::Action::Resume)
            .await
            .unwrap();
        state(&mut events, job.id, JobState::Done).await;
    }
    let run = daemon.job(job.id).await.unwrap().run.unwrap();
    let run = daemon.run(&run).await.unwrap();
    assert_eq!(run.accepted, run.planned);
    let records = records(&run);
    let added = added(&records);
    assert!(
        added.len() > 1 && added.iter().rev().skip(1).all(|&steps| steps > 0),
        "{added:?}"
    );
    assert_eq!(added.last(), Some(&0), "it ends with the last word: {added:?}");
    assert_eq!(run.planned as usize, plan.readings + added.iter().sum::<usize>());
    let begun = records
        .iter()
        .filter(|record| matches!(record, Record::Begin { .. }))
        .count();
    assert_eq!(begun, 2, "it was interrupted");
    let report = std::fs::read_to_string(run.directory.join("report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!(report["adapted"]["expected_male"].is_f64(), "{report}");
    assert!(report["adapted"]["stopped"].is_string(), "{report}");
    let whole = serde_json::from_str::<serde_json::Value>(
        &std::fs::read_to_string(run.directory.join("run.json")).unwrap(),
    )
    .unwrap();
    assert!(
        whole["seconds"]["total"].as_f64().unwrap() < 50.0,
        "{}",
        whole["seconds"]
    );
    daemon.shutdown().await;
}
