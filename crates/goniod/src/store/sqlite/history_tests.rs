use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sqlx::Row;
use tempfile::TempDir;

use super::tests::{end, job_of, run_of};
use super::*;
use crate::{JobState, Memory};

const SPECIMENS: [&str; 4] = ["blue paint", "Gold leaf", "blue paper", "Grün, matt"];
const OPERATORS: [&str; 3] = ["Meier", "operator at 127.0.0.1", ""];
const TAGS: [&str; 4] = ["paint", "Reference", "metal", "to do"];
const WORDS: [&str; 8] = [
    "bl",
    "BLUE pa",
    "leaf",
    "grün",
    "meier blue",
    "acryl",
    "zzz",
    "l-1",
];
const STATES: [JobState; 3] = [JobState::Done, JobState::Interrupted, JobState::Cancelled];

struct Random(ChaCha8Rng);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0.next_u32() as usize % end
    }

    fn one<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    fn maybe<T>(&mut self, make: impl FnOnce(&mut Self) -> T) -> Option<T> {
        (self.below(3) == 0).then(|| make(self))
    }

    fn query(&mut self, runs: u64) -> RunQuery {
        let day = |random: &mut Self| format!("2026-11-{:02}", 1 + random.below(28));
        RunQuery {
            limit: 1 + self.below(20) as u32,
            before: self.maybe(|random| random.below(runs as usize) as u64),
            words: self.maybe(|random| random.one(&WORDS).to_owned()),
            tag: self.maybe(|random| random.one(&TAGS).to_uppercase()),
            operator: self.maybe(|random| random.one(&OPERATORS).to_owned()),
            project: self.maybe(|_| "P-17".to_owned()),
            specimen: self.maybe(|random| random.one(&["blue paint", "L-12", "Gold leaf"]).to_owned()),
            state: self.maybe(|random| random.one(&STATES)),
            from: self.maybe(day),
            to: self.maybe(day),
            archived: self.below(5) == 0,
        }
    }
}

/// Fills two stores with the same runs.
async fn filled(random: &mut Random, runs: u64, sqlite: &Sqlite, memory: &Memory) {
    for n in 0..runs {
        let mut job = job_of(&format!("jobs/{n}.toml"));
        job.state = JobState::Running;
        let mut run = run_of(&job, &format!("R{n}"));
        run.specimen = random.one(&SPECIMENS).to_owned();
        run.started = format!("2026-11-{:02}T08:00:00Z", 1 + random.below(28));
        run.record.specimen_id = format!("L-{}", random.below(20));
        run.record.operator = random.one(&OPERATORS).to_owned();
        run.record.project = random.one(&["P-17", ""]).to_owned();
        run.record.material = random.one(&["acrylic", ""]).to_owned();
        let tags = TAGS.iter().filter(|_| random.below(3) == 0);
        run.record.tags = tags.map(|&tag| tag.to_owned()).collect();
        let away = (random.below(4) == 0).then_some("then");
        let described = (random.below(4) == 0).then(|| random.one(&SPECIMENS).to_owned());
        let deleted = random.below(10) == 0;
        let ended = random.one(&STATES);
        for store in [sqlite as &dyn Store, memory] {
            let (mut job, mut run) = (job.clone(), run.clone());
            store.add_job(&mut job).await.unwrap();
            store.begin_run(&mut run, &end("the header")).await.unwrap();
            job.state = ended;
            job.run = Some(run.id.clone());
            store.change_job(&job).await.unwrap();
            store.archive_run(&run.id, away).await.unwrap();
            if let Some(specimen) = &described {
                run.specimen.clone_from(specimen);
                run.record.tags = vec!["edited".to_owned()];
                store.describe_run(&run).await.unwrap();
            }
            if deleted {
                store.delete_run(&run.id).await.unwrap();
            }
        }
    }
}

#[tokio::test]
async fn every_store_finds_the_same_runs() {
    const RUNS: u64 = 120;
    let seed = 20_261_201;
    println!("seed {seed}");
    let mut random = Random(ChaCha8Rng::seed_from_u64(seed));
    let folder = TempDir::new().unwrap();
    let sqlite = Sqlite::open(&folder.path().join("goniod.db")).await.unwrap();
    let memory = Memory::new();
    filled(&mut random, RUNS, &sqlite, &memory).await;
    let mut found = 0;
    for _ in 0..400 {
        let query = random.query(RUNS);
        let (ours, theirs) = (
            sqlite.runs(&query).await.unwrap(),
            memory.runs(&query).await.unwrap(),
        );
        let ids = |runs: &[RunView]| runs.iter().map(|run| run.id.clone()).collect::<Vec<_>>();
        assert_eq!(ids(&ours), ids(&theirs), "{query:?}");
        found += ours.len();
    }
    assert!(found > 200, "{found}");
    let jobs = sqlite.jobs_over(Some(50), 7).await.unwrap();
    assert_eq!(jobs.len(), memory.jobs_over(Some(50), 7).await.unwrap().len());
    sqlite.close().await;
}

#[tokio::test]
async fn pages_have_every_run_once_and_in_order() {
    let mut random = Random(ChaCha8Rng::seed_from_u64(7));
    let folder = TempDir::new().unwrap();
    let store = Sqlite::open(&folder.path().join("goniod.db")).await.unwrap();
    filled(&mut random, 60, &store, &Memory::new()).await;
    for words in [None, Some("blue".to_owned())] {
        let query = |limit, before| RunQuery {
            limit,
            before,
            words: words.clone(),
            ..RunQuery::default()
        };
        let all = store.runs(&query(200, None)).await.unwrap();
        let mut paged = Vec::new();
        loop {
            let before = paged.last().map(|run: &RunView| run.place);
            let page = store.runs(&query(7, before)).await.unwrap();
            if page.is_empty() {
                break;
            }
            paged.extend(page);
        }
        assert_eq!(all, paged);
        assert!(all.is_sorted_by(|a, b| a.place > b.place));
    }
    store.close().await;
}

/// However many runs there are, a page is read from an index and in its order: nothing is sorted, and no table is read
/// from one end to the other.
#[tokio::test]
async fn a_page_of_the_history_costs_what_it_holds() {
    let folder = TempDir::new().unwrap();
    let store = Sqlite::open(&folder.path().join("goniod.db")).await.unwrap();
    let said = |text: &str| Some(text.to_owned());
    let queries = [
        RunQuery::latest(50),
        RunQuery {
            before: Some(9),
            ..RunQuery::latest(50)
        },
        RunQuery {
            words: said("blue pa"),
            ..RunQuery::latest(50)
        },
        RunQuery {
            tag: said("paint"),
            ..RunQuery::latest(50)
        },
        RunQuery {
            words: said("blue"),
            tag: said("paint"),
            ..RunQuery::latest(50)
        },
        RunQuery {
            operator: said("Meier"),
            ..RunQuery::latest(50)
        },
        RunQuery {
            project: said("P-17"),
            ..RunQuery::latest(50)
        },
        RunQuery {
            state: Some(JobState::Interrupted),
            ..RunQuery::latest(50)
        },
        RunQuery {
            archived: true,
            ..RunQuery::latest(50)
        },
        RunQuery {
            from: said("2026-11-01"),
            to: said("2026-11-02"),
            ..RunQuery::latest(50)
        },
    ];
    for query in queries {
        let mut select = history::select(&query);
        let explained = format!("EXPLAIN QUERY PLAN {}", select.sql().as_str());
        // The values do not matter for the plan; they must only be there.
        let mut bound = sqlx::query(sqlx::AssertSqlSafe(explained.clone()));
        for _ in 0..explained.matches('?').count() {
            bound = bound.bind(1_i64);
        }
        let plan = bound.fetch_all(&store.reader).await.unwrap();
        let plan: Vec<String> = plan.iter().map(|row| row.get("detail")).collect();
        let _ = select.build();
        let plan = plan.join("; ");
        assert!(!plan.contains("TEMP B-TREE"), "{query:?}: {plan}");
        for line in plan.split("; ") {
            let whole =
                line.starts_with("SCAN") && !line.contains("INDEX") && !line.contains("VIRTUAL TABLE");
            assert!(!whole, "{query:?}: {plan}");
        }
    }
    store.close().await;
}

#[tokio::test]
async fn a_store_of_an_earlier_version_keeps_its_runs_and_finds_them() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("goniod.db");
    let options = SqliteConnectOptions::new()
        .filename(&path)
        .create_if_missing(true);
    let pool = SqlitePool::connect_with(options).await.unwrap();
    let mut before = migrations();
    before.migrations.to_mut().truncate(2);
    before.run(&pool).await.unwrap();
    for statement in [
        "INSERT INTO jobs VALUES ('01KAGN4Z7Q3X9V5T8R2M6C1D0B', 3, 'old.toml', 'blue paint', 0, '', 'done', NULL, 'R', 'me', 'then', 'then')",
        "INSERT INTO runs VALUES ('R', '01KAGN4Z7Q3X9V5T8R2M6C1D0B', '/runs/R', 9, '2026-11-01T00:00:00Z', NULL, NULL)",
        "INSERT INTO records VALUES ('R', 0, 'reading', 0, 0, 1, '{}')",
    ] {
        sqlx::query(statement).execute(&pool).await.unwrap();
    }
    pool.close().await;
    let store = Sqlite::open(&path).await.unwrap();
    let query = RunQuery {
        words: Some("blue old".to_owned()),
        state: Some(JobState::Done),
        operator: Some("me".to_owned()),
        ..RunQuery::latest(9)
    };
    let found = store.runs(&query).await.unwrap();
    assert_eq!(found.len(), 1);
    assert_eq!(
        (found[0].accepted, found[0].place, found[0].specimen.as_str()),
        (1, 3, "blue paint")
    );
    store.close().await;
}
