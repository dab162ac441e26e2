use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use async_trait::async_trait;
use capture::Record;
use serde::Serialize;
use serde::de::DeserializeOwned;
use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteRow, SqliteSynchronous,
};
use sqlx::{Row, SqlSafeStr};

use super::{Store, StoreError};
use crate::{FaultView, Job, JobId, RunView};

/// How long a statement waits for another program that holds the database.
const BUSY: Duration = Duration::from_secs(2);
/// Columns of a run, with what its journal says of it.
const RUN: &str = "SELECT runs.*, jobs.name, jobs.specimen, (SELECT COUNT(*) FROM records WHERE records.run = runs.id \
                   AND records.accepted = 1) AS accepted FROM runs JOIN jobs ON jobs.id = runs.job";

/// The store in one SQLite file, with a write-ahead log that is synced at every commit.
#[derive(Debug)]
pub struct Sqlite {
    /// One connection, so that the daemon never waits for a lock of its own.
    writer: SqlitePool,
    /// Another, so that whoever looks never keeps a reading from being stored.
    reader: SqlitePool,
    path: PathBuf,
}

impl Sqlite {
    /// Opens the file, makes it where it is missing, and brings its tables up to date.
    ///
    /// # Errors
    /// The file cannot be opened or written, is no database, or was made by a newer version.
    pub async fn open(path: &Path) -> Result<Self, StoreError> {
        Self::with(path, SqliteConnectOptions::new()).await
    }

    async fn with(path: &Path, options: SqliteConnectOptions) -> Result<Self, StoreError> {
        let options = options
            .filename(path)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(BUSY);
        let pool = || {
            SqlitePoolOptions::new()
                .max_connections(1)
                .acquire_timeout(2 * BUSY)
                .idle_timeout(None)
                .max_lifetime(None)
        };
        let cannot = |source| StoreError::Open {
            path: path.to_owned(),
            source,
        };
        let writer = pool().connect_with(options.clone()).await.map_err(cannot)?;
        migrations()
            .run(&writer)
            .await
            .map_err(|source| StoreError::Migrate {
                path: path.to_owned(),
                source,
            })?;
        let reader = pool().connect_with(options).await.map_err(cannot)?;
        Ok(Self {
            writer,
            reader,
            path: path.to_owned(),
        })
    }
}

fn migrations() -> Migrator {
    let queue = include_str!("0001_queue.sql").into_sql_str();
    let description = Cow::Borrowed("queue");
    Migrator::with_migrations(vec![Migration::new(
        1,
        description,
        MigrationType::Simple,
        queue,
        false,
    )])
}

#[async_trait]
impl Store for Sqlite {
    fn room(&self) -> Option<u64> {
        rig::doctor::room(&self.path).ok()
    }

    async fn begin_life(&self, at: &str) -> Result<u64, StoreError> {
        let row = sqlx::query(
            "INSERT INTO lives (life, started) VALUES ((SELECT COALESCE(MAX(life), 0) + 1 FROM lives), $1) \
             RETURNING life",
        )
        .bind(at)
        .fetch_one(&self.writer)
        .await
        .map_err(failed("count a start"))?;
        number(&row, "life")
    }

    async fn add_job(&self, job: &mut Job) -> Result<(), StoreError> {
        let row = sqlx::query(
            "INSERT INTO jobs (id, place, name, specimen, on_stage, body, state, why, run, submitted_by, submitted, \
             changed) VALUES ($1, (SELECT COALESCE(MAX(place), 0) + 1 FROM jobs), $2, $3, $4, $5, $6, $7, $8, $9, \
             $10, $11) RETURNING place",
        )
        .bind(job.id.to_string())
        .bind(&job.name)
        .bind(&job.specimen)
        .bind(i64::from(job.on_stage))
        .bind(&job.text)
        .bind(word(&job.state))
        .bind(&job.why)
        .bind(&job.run)
        .bind(&job.by)
        .bind(&job.submitted)
        .bind(&job.changed)
        .fetch_one(&self.writer)
        .await
        .map_err(failed("queue a job"))?;
        job.place = number(&row, "place")?;
        Ok(())
    }

    async fn change_job(&self, job: &Job) -> Result<(), StoreError> {
        sqlx::query("UPDATE jobs SET state = $2, why = $3, run = $4, changed = $5 WHERE id = $1")
            .bind(job.id.to_string())
            .bind(word(&job.state))
            .bind(&job.why)
            .bind(&job.run)
            .bind(&job.changed)
            .execute(&self.writer)
            .await
            .map_err(failed("change a job"))?;
        Ok(())
    }

    async fn job(&self, id: JobId) -> Result<Option<Job>, StoreError> {
        let row = sqlx::query("SELECT * FROM jobs WHERE id = $1")
            .bind(id.to_string())
            .fetch_optional(&self.reader)
            .await
            .map_err(failed("look up a job"))?;
        row.as_ref().map(job).transpose()
    }

    async fn jobs(&self, over: u32) -> Result<Vec<Job>, StoreError> {
        let waiting = sqlx::query(
            "SELECT * FROM jobs WHERE state NOT IN ('done', 'failed', 'cancelled') ORDER BY place",
        )
        .fetch_all(&self.reader)
        .await
        .map_err(failed("list the queue"))?;
        let over = sqlx::query(
            "SELECT * FROM jobs WHERE state IN ('done', 'failed', 'cancelled') ORDER BY place DESC LIMIT $1",
        )
        .bind(i64::from(over))
        .fetch_all(&self.reader)
        .await
        .map_err(failed("list jobs that are over"))?;
        waiting.iter().chain(&over).map(job).collect()
    }

    async fn begin_run(&self, run: &RunView, header: &Record) -> Result<(), StoreError> {
        let failed = || failed("begin a run");
        let mut transaction = self.writer.begin().await.map_err(failed())?;
        sqlx::query("INSERT INTO runs (id, job, directory, planned, started) VALUES ($1, $2, $3, $4, $5)")
            .bind(&run.id)
            .bind(run.job.to_string())
            .bind(run.directory.to_string_lossy().into_owned())
            .bind(run.planned as i64)
            .bind(&run.started)
            .execute(&mut *transaction)
            .await
            .map_err(failed())?;
        sqlx::query("INSERT INTO records (run, seq, kind, body) VALUES ($1, 0, $2, $3)")
            .bind(&run.id)
            .bind(kind(header))
            .bind(json(header))
            .execute(&mut *transaction)
            .await
            .map_err(failed())?;
        sqlx::query("UPDATE jobs SET run = $2 WHERE id = $1")
            .bind(run.job.to_string())
            .bind(&run.id)
            .execute(&mut *transaction)
            .await
            .map_err(failed())?;
        transaction.commit().await.map_err(failed())
    }

    async fn reported(&self, run: &str, at: &str) -> Result<(), StoreError> {
        sqlx::query("UPDATE runs SET reported = $2 WHERE id = $1")
            .bind(run)
            .bind(at)
            .execute(&self.writer)
            .await
            .map_err(failed("note a report"))?;
        Ok(())
    }

    async fn runs(&self, most: u32) -> Result<Vec<RunView>, StoreError> {
        const LATEST: &str = " ORDER BY jobs.place DESC LIMIT $1";
        let query = sqlx::AssertSqlSafe(format!("{RUN}{LATEST}"));
        let rows = sqlx::query(query)
            .bind(i64::from(most))
            .fetch_all(&self.reader)
            .await
            .map_err(failed("list the runs"))?;
        rows.iter().map(run).collect()
    }

    async fn run(&self, id: &str) -> Result<Option<RunView>, StoreError> {
        let query = sqlx::AssertSqlSafe(format!("{RUN} WHERE runs.id = $1"));
        let row = sqlx::query(query)
            .bind(id)
            .fetch_optional(&self.reader)
            .await
            .map_err(failed("look up a run"))?;
        row.as_ref().map(run).transpose()
    }

    async fn append(&self, run: &str, seq: u64, record: &Record) -> Result<(), StoreError> {
        let reading = match record {
            Record::Reading(reading) => Some(reading),
            _ => None,
        };
        let recorded = || failed("record a reading");
        let mut transaction = self.writer.begin().await.map_err(recorded())?;
        if let Record::Extension(extension) = record {
            sqlx::query("UPDATE runs SET planned = planned + $1 WHERE id = $2")
                .bind(extension.steps.len() as i64)
                .bind(run)
                .execute(&mut *transaction)
                .await
                .map_err(recorded())?;
        }
        sqlx::query(
            "INSERT INTO records (run, seq, kind, step, attempt, accepted, body) VALUES ($1, $2, $3, $4, $5, $6, $7)",
        )
        .bind(run)
        .bind(seq as i64)
        .bind(kind(record))
        .bind(reading.map(|reading| reading.step as i64))
        .bind(reading.map(|reading| i64::from(reading.attempt)))
        .bind(reading.map(|reading| i64::from(reading.accepted)))
        .bind(json(record))
        .execute(&mut *transaction)
        .await
        .map_err(recorded())?;
        transaction.commit().await.map_err(recorded())
    }

    async fn records(&self, run: &str) -> Result<Vec<Record>, StoreError> {
        let rows = sqlx::query("SELECT body FROM records WHERE run = $1 ORDER BY seq")
            .bind(run)
            .fetch_all(&self.reader)
            .await
            .map_err(failed("read a journal"))?;
        let record = |row: &SqliteRow| {
            let body: String = column(row, "body")?;
            serde_json::from_str(&body).map_err(|error| StoreError::Damaged {
                what: "record",
                why: error.to_string(),
            })
        };
        rows.iter().map(record).collect()
    }

    async fn latch(&self, fault: &FaultView) -> Result<(), StoreError> {
        sqlx::query(
            "INSERT INTO faults (seq, code, what, at, run) VALUES ((SELECT COALESCE(MAX(seq), 0) + 1 FROM faults), \
             $1, $2, $3, $4)",
        )
        .bind(word(&fault.code))
        .bind(&fault.text)
        .bind(&fault.at)
        .bind(&fault.run)
        .execute(&self.writer)
        .await
        .map_err(failed("latch a fault"))?;
        Ok(())
    }

    async fn latched(&self) -> Result<Option<FaultView>, StoreError> {
        let row = sqlx::query("SELECT * FROM faults WHERE acknowledged IS NULL ORDER BY seq DESC LIMIT 1")
            .fetch_optional(&self.reader)
            .await
            .map_err(failed("look up faults"))?;
        let fault = |row: &SqliteRow| {
            Ok(FaultView {
                code: of_word(&column::<String>(row, "code")?, "fault")?,
                text: column(row, "what")?,
                at: column(row, "at")?,
                run: column(row, "run")?,
            })
        };
        row.as_ref().map(fault).transpose()
    }

    async fn acknowledge(&self, by: &str, at: &str) -> Result<(), StoreError> {
        sqlx::query("UPDATE faults SET acknowledged = $1, acknowledged_by = $2 WHERE acknowledged IS NULL")
            .bind(at)
            .bind(by)
            .execute(&self.writer)
            .await
            .map_err(failed("acknowledge a fault"))?;
        Ok(())
    }

    async fn audit(&self, at: &str, who: &str, what: &str, outcome: &str) -> Result<(), StoreError> {
        sqlx::query(
            "INSERT INTO audit (seq, at, who, what, outcome) VALUES ((SELECT COALESCE(MAX(seq), 0) + 1 FROM audit), \
             $1, $2, $3, $4)",
        )
        .bind(at)
        .bind(who)
        .bind(what)
        .bind(outcome)
        .execute(&self.writer)
        .await
        .map_err(failed("note who asked"))?;
        Ok(())
    }

    async fn close(&self) {
        self.reader.close().await;
        self.writer.close().await;
    }
}

fn failed(what: &'static str) -> impl Fn(sqlx::Error) -> StoreError {
    move |source| StoreError::Query { what, source }
}

fn job(row: &SqliteRow) -> Result<Job, StoreError> {
    let id: String = column(row, "id")?;
    Ok(Job {
        id: id
            .parse()
            .map_err(|why| StoreError::Damaged { what: "job", why })?,
        place: number(row, "place")?,
        name: column(row, "name")?,
        specimen: column(row, "specimen")?,
        on_stage: column::<i64>(row, "on_stage")? != 0,
        text: column(row, "body")?,
        state: of_word(&column::<String>(row, "state")?, "job")?,
        why: column(row, "why")?,
        run: column(row, "run")?,
        by: column(row, "submitted_by")?,
        submitted: column(row, "submitted")?,
        changed: column(row, "changed")?,
    })
}

fn run(row: &SqliteRow) -> Result<RunView, StoreError> {
    let job: String = column(row, "job")?;
    Ok(RunView {
        id: column(row, "id")?,
        job: job
            .parse()
            .map_err(|why| StoreError::Damaged { what: "run", why })?,
        name: column(row, "name")?,
        specimen: column(row, "specimen")?,
        directory: column::<String>(row, "directory")?.into(),
        started: column(row, "started")?,
        reported: column(row, "reported")?,
        planned: number(row, "planned")?,
        accepted: number(row, "accepted")?,
    })
}

fn column<'r, T>(row: &'r SqliteRow, name: &'static str) -> Result<T, StoreError>
where
    T: sqlx::Decode<'r, sqlx::Sqlite> + sqlx::Type<sqlx::Sqlite>,
{
    row.try_get(name).map_err(failed("read a column"))
}

fn number(row: &SqliteRow, name: &'static str) -> Result<u64, StoreError> {
    let number: i64 = column(row, name)?;
    u64::try_from(number).map_err(|_| StoreError::Damaged {
        what: "number",
        why: format!("{name} is {number}"),
    })
}

/// How an enum is spelled in a column: as in JSON, without the quotes.
fn word(value: &impl Serialize) -> String {
    json(value).trim_matches('"').to_owned()
}

fn of_word<T: DeserializeOwned>(word: &str, what: &'static str) -> Result<T, StoreError> {
    serde_json::from_value(word.into()).map_err(|error| StoreError::Damaged {
        what,
        why: error.to_string(),
    })
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("our own types have string keys only")
}

fn kind(record: &Record) -> &'static str {
    match record {
        Record::Header(_) => "header",
        Record::Begin { .. } => "begin",
        Record::Reading(_) => "reading",
        Record::Extension(_) => "extension",
        Record::Repeat { .. } => "repeat",
        Record::Suspended { .. } => "suspended",
        Record::Released { .. } => "released",
        Record::End { .. } => "end",
    }
}

#[cfg(test)]
mod tests {
    use capture::Outcome;
    use tempfile::TempDir;

    use super::*;
    use crate::{FaultCode, JobState};

    fn end(text: &str) -> Record {
        Record::End {
            outcome: Outcome::Failed {
                fault: text.to_owned(),
            },
            device_ticks: Some(7),
            at: String::new(),
        }
    }

    async fn with_run(store: &Sqlite) -> RunView {
        let mut job = Job {
            id: JobId::generate(),
            place: 0,
            name: "job.toml".to_owned(),
            specimen: "gold".to_owned(),
            on_stage: true,
            text: "[[plane]]".to_owned(),
            state: JobState::AwaitingSpecimen,
            why: Some("so".to_owned()),
            run: None,
            by: "me".to_owned(),
            submitted: "then".to_owned(),
            changed: "now".to_owned(),
        };
        store.add_job(&mut job).await.unwrap();
        let run = RunView {
            id: "01".to_owned(),
            job: job.id,
            name: job.name.clone(),
            specimen: job.specimen.clone(),
            directory: "/runs/01".into(),
            started: "then".to_owned(),
            reported: None,
            planned: 3,
            accepted: 0,
        };
        store.begin_run(&run, &end("the header")).await.unwrap();
        job.run = Some(run.id.clone());
        assert_eq!(store.job(job.id).await.unwrap(), Some(job.clone()));
        assert_eq!(store.jobs(0).await.unwrap(), [job]);
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
        let fault = FaultView {
            code: FaultCode::NoReply,
            text: "silent".to_owned(),
            at: "then".to_owned(),
            run: Some(run.id.clone()),
        };
        store.latch(&fault).await.unwrap();
        store.audit("then", "me", "estop", "done").await.unwrap();
        store.close().await;
        let store = Sqlite::open(&path).await.unwrap();
        assert_eq!(store.begin_life("now").await.unwrap(), 2);
        assert_eq!(
            store.records(&run.id).await.unwrap(),
            [end("the header"), end("first")]
        );
        assert_eq!(store.runs(9).await.unwrap(), std::slice::from_ref(&run));
        assert_eq!(store.latched().await.unwrap(), Some(fault));
        store.acknowledge("me", "now").await.unwrap();
        assert_eq!(store.latched().await.unwrap(), None);
        store.reported(&run.id, "now").await.unwrap();
        let reported = store.run(&run.id).await.unwrap().unwrap().reported;
        assert_eq!(reported.as_deref(), Some("now"));
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
}
