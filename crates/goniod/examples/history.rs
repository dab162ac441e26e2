//! How much longer a page of the history takes with 10,000 runs than with 100, and how much memory it takes.
//!
//! ```sh
//! cargo run --release -p goniod --example history
//! ```
//!
//! Both stores hold the same kinds of runs; each question is asked of both in turn, so that whatever else the machine does
//! meets both alike, and finds as many in both. Ends with 1 where a median takes more than twice as long.

use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use capture::{Outcome, Record};
use goniod::{Job, JobId, JobState, RecordView, RunQuery, RunView, Sqlite, Store};

/// Runs of the small store and of the large one.
const RUNS: [u64; 2] = [100, 10_000];
/// How often each question is asked.
const TIMES: usize = 200;
/// How much longer it may take.
const ALLOWED: f64 = 2.0;
/// Runs that answer a question; the small store has that many for each.
const FOUND: u32 = 5;

const SPECIMENS: [&str; 4] = ["blue paint", "gold leaf", "blue paper", "green cloth"];
const OPERATORS: [&str; 3] = ["Meier", "Okafor", "Li"];
const TAGS: [&str; 5] = ["paint", "metal", "paper", "cloth", "reference"];

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<ExitCode, Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let mut stores = Vec::new();
    for runs in RUNS {
        let path = folder.path().join(format!("{runs}.db"));
        fill(&path, runs).await?;
        stores.push(Sqlite::open(&path).await?);
    }
    let said = |text: &str| Some(text.to_owned());
    let some = RunQuery::latest(FOUND);
    #[rustfmt::skip]
    let questions = [
        ("the latest 50", RunQuery::latest(50)),
        ("the latest 5", some.clone()),
        ("a word", RunQuery { words: said("blu"), ..some.clone() }),
        ("two words", RunQuery { words: said("gold mei"), ..some.clone() }),
        ("a tag", RunQuery { tag: said("metal"), ..some.clone() }),
        ("an operator", RunQuery { operator: said("Okafor"), ..some.clone() }),
        ("a state", RunQuery { state: Some(JobState::Interrupted), ..some.clone() }),
        ("a specimen", RunQuery { specimen: said("blue paint"), ..some }),
    ];
    println!("{:<14} {:>9} {:>9} {:>6}", "question", "100", "10,000", "ratio");
    let mut worst: f64 = 0.0;
    for (name, query) in &questions {
        let mut times = [Vec::new(), Vec::new()];
        for _ in 0..TIMES {
            for (store, times) in stores.iter().zip(&mut times) {
                let begun = Instant::now();
                let found = store.runs(query).await?;
                times.push(begun.elapsed());
                assert_eq!(found.len() as u32, query.limit, "{name}");
            }
        }
        let [small, large] = times.map(median);
        let ratio = large.as_secs_f64() / small.as_secs_f64();
        worst = worst.max(ratio);
        println!("{name:<14} {small:>9.1?} {large:>9.1?} {ratio:>6.2}");
    }
    println!("medians of {TIMES}; resident {} kB", resident_kb());
    Ok(ExitCode::from(u8::from(worst > ALLOWED)))
}

fn median(mut times: Vec<Duration>) -> Duration {
    times.sort();
    times[times.len() / 2]
}

/// Memory that this process has resident, kB, where the system tells it.
fn resident_kb() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.unwrap_or("?").trim().trim_end_matches(" kB").to_owned()
}

/// Fills a store with runs, as a daemon would.
async fn fill(path: &Path, runs: u64) -> Result<(), Box<dyn std::error::Error>> {
    let store = Sqlite::open(path).await?;
    let pick = |of: &[&str], n: u64| of[usize::try_from(n).expect("an index") % of.len()].to_owned();
    for n in 0..runs {
        let state = match n % 17 {
            0 => JobState::Interrupted,
            _ => JobState::Done,
        };
        let mut job = Job {
            id: JobId::generate(),
            place: 0,
            name: format!("jobs/{n}.toml"),
            specimen: pick(&SPECIMENS, n),
            on_stage: false,
            text: "[[plane]]\ntheta_r_deg = 60\nreadings = 6\n".to_owned(),
            state,
            why: None,
            run: None,
            verdict: None,
            whole: false,
            by: "operator at 127.0.0.1".to_owned(),
            submitted: "2026-11-01T08:00:00Z".to_owned(),
            changed: "2026-11-01T08:00:00Z".to_owned(),
        };
        store.add_job(&mut job).await?;
        let mut run = RunView {
            id: format!("01KAGN4Z7Q3X9V5T8R2M{n:06}"),
            place: 0,
            job: job.id,
            state,
            name: job.name,
            specimen: job.specimen,
            record: RecordView {
                specimen_id: format!("L-{n}"),
                operator: pick(&OPERATORS, n),
                tags: vec![pick(&TAGS, n), pick(&TAGS, n / 7)],
                ..RecordView::default()
            },
            archived: None,
            directory: format!("/runs/{n}").into(),
            started: "2026-11-01T08:00:00Z".to_owned(),
            reported: None,
            verdict: None,
            planned: 72,
            accepted: 72,
        };
        let end = Record::End {
            outcome: Outcome::Done,
            device_ticks: None,
            at: String::new(),
        };
        store.begin_run(&mut run, &end).await?;
    }
    store.close().await;
    Ok(())
}
