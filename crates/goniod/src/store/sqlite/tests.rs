use capture::Outcome;
use tempfile::TempDir;

use super::*;
use crate::{FaultCode, JobState, RecordView, VerdictView};

pub(super) fn end(text: &str) -> Record {
    Record::End {
        outcome: Outcome::Failed {
            fault: text.to_owned(),
        },
        device_ticks: Some(7),
        at: String::new(),
    }
}

pub(super) fn job_of(name: &str) -> Job {
    Job {
        id: JobId::generate(),
        place: 0,
        name: name.to_owned(),
        specimen: "gold".to_owned(),
        on_stage: true,
        text: "[[plane]]".to_owned(),
        state: JobState::AwaitingSpecimen,
        why: Some("so".to_owned()),
        run: None,
        verdict: None,
        whole: true,
        by: "me".to_owned(),
        submitted: "then".to_owned(),
        changed: "now".to_owned(),
    }
}

pub(super) fn run_of(job: &Job, id: &str) -> RunView {
    RunView {
        id: id.to_owned(),
        place: 0,
        job: job.id,
        state: job.state,
        name: job.name.clone(),
        specimen: job.specimen.clone(),
        record: RecordView::default(),
        archived: None,
        directory: "/runs/01".into(),
        started: "then".to_owned(),
        reported: None,
        verdict: None,
        planned: 3,
        accepted: 0,
    }
}

async fn with_run(store: &Sqlite) -> RunView {
    let mut job = job_of("job.toml");
    store.add_job(&mut job).await.unwrap();
    let mut run = run_of(&job, "01");
    run.record.tags = vec!["Paint".to_owned(), "reference".to_owned()];
    store.begin_run(&mut run, &end("the header")).await.unwrap();
    job.run = Some(run.id.clone());
    assert_eq!(store.job(job.id).await.unwrap(), Some(job.clone()));
    assert_eq!(store.waiting_jobs().await.unwrap(), [job]);
    run
}

#[tokio::test]
async fn what_was_kept_is_there_after_it_is_opened_again() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("goniod.db");
    let store = Sqlite::open(&path).await.unwrap();
    assert_eq!(store.begin_life("then").await.unwrap(), 1);
    let run = with_run(&store).await;
    store.append(&run.id, 1, &end("first")).await.unwrap();
    // As a version did that had no file for faults.
    sqlx::query("INSERT INTO faults (seq, code, what, at, run) VALUES (1, 'no_reply', 'silent', 'then', $1)")
        .bind(&run.id)
        .execute(&store.writer)
        .await
        .unwrap();
    store.audit("then", "me", "estop", "done").await.unwrap();
    store.close().await;
    let store = Sqlite::open(&path).await.unwrap();
    assert_eq!(store.begin_life("now").await.unwrap(), 2);
    assert_eq!(
        store.records(&run.id).await.unwrap(),
        [end("the header"), end("first")]
    );
    assert_eq!(
        store.runs(&RunQuery::latest(9)).await.unwrap(),
        std::slice::from_ref(&run)
    );
    let fault = store.latched().await.unwrap().expect("it is latched");
    assert_eq!((fault.code, fault.text.as_str()), (FaultCode::NoReply, "silent"));
    assert_eq!(fault.run, Some(run.id.clone()));
    let bad = VerdictView::Bad;
    store.reported(&run.id, "now", bad).await.unwrap();
    let reported = store.run(&run.id).await.unwrap().unwrap();
    assert_eq!(reported.reported.as_deref(), Some("now"));
    assert_eq!(reported.verdict, Some(bad));
    let job = store.job(run.job).await.unwrap().unwrap();
    assert_eq!(job.verdict, Some(bad), "the job says it too");
    store.close().await;
}

#[tokio::test]
async fn a_place_in_a_journal_is_taken_once() {
    let folder = TempDir::new().unwrap();
    let store = Sqlite::open(&folder.path().join("goniod.db")).await.unwrap();
    let run = with_run(&store).await;
    store.append(&run.id, 1, &end("first")).await.unwrap();
    store.append(&run.id, 1, &end("second")).await.unwrap_err();
    assert_eq!(store.records(&run.id).await.unwrap().len(), 2);
    store.close().await;
}

/// SQLite's own limit on the size of its file stands for a full disk: it is the same error.
#[tokio::test]
async fn a_full_disk_is_told_as_such_and_keeps_what_was_there() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("goniod.db");
    let store = Sqlite::open(&path).await.unwrap();
    let run = with_run(&store).await;
    store.close().await;
    let small = SqliteConnectOptions::new().pragma("max_page_count", "40");
    let store = Sqlite::with(&path, small).await.unwrap();
    let long = "x".repeat(8_000);
    let mut kept = 1;
    let error = loop {
        match store.append(&run.id, kept, &end(&long)).await {
            Ok(()) => kept += 1,
            Err(error) => break error,
        }
    };
    assert_eq!(error.code(), FaultCode::DiskFull, "{error:?}");
    assert_eq!(store.records(&run.id).await.unwrap().len() as u64, kept);
    store.close().await;
    let store = Sqlite::open(&path).await.unwrap();
    store.append(&run.id, kept, &end(&long)).await.unwrap();
    store.close().await;
}

/// The pragma stands for a file that may not be written, which root may always: it is the same error.
#[tokio::test]
async fn a_store_that_may_not_be_written_is_told_as_such_and_can_be_read() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("goniod.db");
    let store = Sqlite::open(&path).await.unwrap();
    let run = with_run(&store).await;
    sqlx::query("PRAGMA query_only = 1")
        .execute(&store.writer)
        .await
        .unwrap();
    let error = store.append(&run.id, 1, &end("first")).await.unwrap_err();
    assert_eq!(error.code(), FaultCode::ReadOnly, "{error:?}");
    assert_eq!(store.records(&run.id).await.unwrap(), [end("the header")]);
    store.close().await;
}

#[tokio::test]
async fn what_is_no_database_is_not_opened() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("goniod.db");
    std::fs::write(&path, "a".repeat(5000)).unwrap();
    let error = Sqlite::open(&path).await.unwrap_err();
    assert_eq!(error.code(), FaultCode::Store, "{error:?}");
    let nowhere = folder.path().join("missing").join("goniod.db");
    assert!(matches!(
        Sqlite::open(&nowhere).await,
        Err(StoreError::Open { .. })
    ));
}

/// A closed store with a run of so many records more.
async fn kept(path: &std::path::Path, records: u64) -> Vec<Record> {
    let store = Sqlite::open(path).await.unwrap();
    let run = with_run(&store).await;
    for seq in 1..=records {
        store
            .append(&run.id, seq, &end(&format!("record {seq}")))
            .await
            .unwrap();
    }
    let records = store.records(&run.id).await.unwrap();
    store.close().await;
    records
}

#[tokio::test]
async fn forty_flipped_bits_are_told_or_touch_nothing_that_was_measured() {
    use rand::{RngExt, SeedableRng};
    let folder = TempDir::new().unwrap();
    let sound = folder.path().join("sound.db");
    let written = kept(&sound, 200).await;
    let mut told = 0;
    let bytes = std::fs::read(&sound).unwrap();
    let first: u64 = rand::rng().random_range(0..1 << 32);
    for seed in first..first + 20 {
        let mut random = rand::rngs::StdRng::seed_from_u64(seed);
        let mut flipped = bytes.clone();
        for _ in 0..40 {
            let at = random.random_range(0..flipped.len());
            flipped[at] ^= 1 << random.random_range(0..8);
        }
        let path = folder.path().join(format!("{seed}.db"));
        std::fs::write(&path, flipped).unwrap();
        match Sqlite::open(&path).await {
            Err(error) => {
                told += 1;
                let text = error.to_string();
                assert!(
                    text.contains(&seed.to_string()),
                    "seed {seed}: it names the file: {text}"
                );
            }
            // They lie where nothing is kept, or in a record, whose checksum tells.
            Ok(store) => {
                if let Ok(read) = store.records("01").await {
                    assert!(read.is_empty() || read == written, "seed {seed}");
                }
                store.close().await;
            }
        }
    }
    assert!(
        told >= 15,
        "seed {first}: {told} of 20 were told when the store was opened"
    );
}

#[tokio::test]
async fn a_record_that_is_not_what_was_written_or_is_missing_is_told() {
    let spoil = [
        (
            "UPDATE records SET body = replace(body, 'record 7', 'record 8') WHERE seq = 7",
            "record 7 of run 01",
        ),
        (
            "UPDATE records SET run = '02' WHERE seq = 9",
            "record 9 of run 01: it is missing",
        ),
        (
            "DELETE FROM records WHERE seq = 4",
            "record 4 of run 01: it is missing",
        ),
    ];
    for (statement, words) in spoil {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("goniod.db");
        kept(&path, 20).await;
        let store = Sqlite::open(&path).await.unwrap();
        sqlx::query("PRAGMA foreign_keys = OFF")
            .execute(&store.writer)
            .await
            .unwrap();
        sqlx::query(statement).execute(&store.writer).await.unwrap();
        let error = store.records("01").await.unwrap_err().to_string();
        assert!(error.contains(words), "{statement}: {error}");
    }
}

#[tokio::test]
async fn a_torn_or_foreign_file_is_damaged_and_left_as_it_is() {
    let folder = TempDir::new().unwrap();
    let sound = folder.path().join("sound.db");
    kept(&sound, 200).await;
    let bytes = std::fs::read(&sound).unwrap();
    let mut hole = bytes.clone();
    let middle = hole.len() / 2 / 4096 * 4096;
    hole[middle..middle + 4096].fill(0);
    for (name, bytes) in [
        ("torn", bytes[..bytes.len() / 2].to_vec()),
        ("hole", hole),
        (
            "text",
            b"this is no database, and longer than the head of one would be, to be sure of it".repeat(20),
        ),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, &bytes).unwrap();
        let error = Sqlite::open(&path).await.expect_err(name);
        assert!(matches!(error, StoreError::Corrupt { .. }), "{name}: {error:?}");
        assert!(error.to_string().contains("goniod restore"), "{error}");
        assert_eq!(std::fs::read(&path).unwrap(), bytes, "{name}");
    }
}

#[tokio::test]
async fn a_record_that_is_no_record_any_more_is_told_when_the_store_is_opened() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("goniod.db");
    kept(&path, 3).await;
    let options = SqliteConnectOptions::new().filename(&path);
    let pool = SqlitePool::connect_with(options).await.unwrap();
    sqlx::query("UPDATE records SET body = replace(body, '{', '[') WHERE seq = 2")
        .execute(&pool)
        .await
        .unwrap();
    pool.close().await;
    let error = Sqlite::open(&path).await.unwrap_err().to_string();
    assert!(
        error.contains("1 records cannot be read, the first of run 01"),
        "{error}"
    );
}

#[tokio::test]
async fn a_backup_holds_what_is_still_in_the_log_and_is_restored() {
    let folder = TempDir::new().unwrap();
    let (path, copy) = (folder.path().join("goniod.db"), folder.path().join("copy.db"));
    let store = Sqlite::open(&path).await.unwrap();
    let run = with_run(&store).await;
    store.append(&run.id, 1, &end("in the log")).await.unwrap();
    let before = store.records(&run.id).await.unwrap();
    // As a daemon has it: open, with a write-ahead log.
    backup(&path, &copy).await.unwrap();
    assert!(matches!(
        backup(&path, &copy).await,
        Err(StoreError::Exists { .. })
    ));
    store.append(&run.id, 2, &end("after the backup")).await.unwrap();
    store.close().await;

    let aside = restore(&copy, &path, "now")
        .await
        .unwrap()
        .expect("there was a store");
    let restored = Sqlite::open(&path).await.unwrap();
    assert_eq!(restored.records(&run.id).await.unwrap(), before);
    restored.close().await;
    let older = Sqlite::open(&aside).await.unwrap();
    assert_eq!(
        older.records(&run.id).await.unwrap().len(),
        before.len() + 1,
        "nothing is thrown away"
    );
    older.close().await;
}

#[tokio::test]
async fn a_damaged_store_makes_no_backup_and_a_damaged_backup_replaces_nothing() {
    let folder = TempDir::new().unwrap();
    let (path, bad) = (folder.path().join("goniod.db"), folder.path().join("bad.db"));
    kept(&path, 200).await;
    let sound = std::fs::read(&path).unwrap();
    std::fs::write(&bad, &sound[..sound.len() / 2]).unwrap();
    let to = folder.path().join("copy.db");
    assert!(matches!(backup(&bad, &to).await, Err(StoreError::Corrupt { .. })));
    assert!(!to.exists());
    assert!(backup(&folder.path().join("none.db"), &to).await.is_err());
    assert!(!folder.path().join("none.db").exists(), "none is made");
    assert!(matches!(
        restore(&bad, &path, "now").await,
        Err(StoreError::Corrupt { .. })
    ));
    assert_eq!(std::fs::read(&path).unwrap(), sound);
}
