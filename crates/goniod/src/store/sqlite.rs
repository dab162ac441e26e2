use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use async_trait::async_trait;
use capture::Record;
use sqlx::SqlSafeStr;
use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteRow, SqliteSynchronous,
};

use super::{Store, StoreError};
use crate::{FaultId, FaultView, Job, JobId, RunQuery, RunView, VerdictView};

mod copy;
mod history;
#[cfg(test)]
mod history_tests;
mod row;
mod soundness;
#[cfg(test)]
mod tests;

pub(crate) use copy::has_log;
pub use copy::{backup, restore};
use row::{column, failed, job, json, kind, number, of_word, run, sum, word};

/// How long a statement waits for another program that holds the database.
const BUSY: Duration = Duration::from_secs(2);
/// Columns of a run, with what its job's file is called.
const RUN: &str = "SELECT runs.*, jobs.name FROM ";

/// Columns of a job, with what its run came to.
const JOB: &str =
    "SELECT jobs.*, (SELECT verdict FROM runs WHERE runs.id = jobs.run) AS verdict FROM jobs WHERE ";

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
    /// Opens the file, makes it where it is missing, checks that it is whole, and brings its tables up to date.
    ///
    /// # Errors
    /// The file cannot be opened or written, is damaged, is no database, or was made by a newer version.
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
        let cannot = |source| soundness::damage(path, source);
        let writer = pool().connect_with(options.clone()).await.map_err(cannot)?;
        // Before anything is written: what is damaged must not be made worse.
        if let Err(error) = soundness::check(&writer, path).await {
            writer.close().await;
            return Err(error);
        }
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
    let steps = [
        ("queue", include_str!("0001_queue.sql")),
        ("verdict", include_str!("0002_verdict.sql")),
        ("history", include_str!("0003_history.sql")),
        ("sums", include_str!("0004_sums.sql")),
    ];
    let migration = |(version, (description, sql)): (i64, (&'static str, &'static str))| {
        let description = Cow::Borrowed(description);
        Migration::new(
            version,
            description,
            MigrationType::Simple,
            sql.into_sql_str(),
            false,
        )
    };
    Migrator::with_migrations((1..).zip(steps).map(migration).collect())
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
             changed, whole) VALUES ($1, (SELECT COALESCE(MAX(place), 0) + 1 FROM jobs), $2, $3, $4, $5, $6, $7, $8, \
             $9, $10, $11, $12) RETURNING place",
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
        .bind(i64::from(job.whole))
        .fetch_one(&self.writer)
        .await
        .map_err(failed("queue a job"))?;
        job.place = number(&row, "place")?;
        Ok(())
    }

    async fn change_job(&self, job: &Job) -> Result<(), StoreError> {
        let failed = || failed("change a job");
        let mut transaction = self.writer.begin().await.map_err(failed())?;
        sqlx::query("UPDATE jobs SET state = $2, why = $3, run = $4, changed = $5 WHERE id = $1")
            .bind(job.id.to_string())
            .bind(word(&job.state))
            .bind(&job.why)
            .bind(&job.run)
            .bind(&job.changed)
            .execute(&mut *transaction)
            .await
            .map_err(failed())?;
        sqlx::query("UPDATE runs SET state = $2 WHERE job = $1")
            .bind(job.id.to_string())
            .bind(word(&job.state))
            .execute(&mut *transaction)
            .await
            .map_err(failed())?;
        transaction.commit().await.map_err(failed())
    }

    async fn job(&self, id: JobId) -> Result<Option<Job>, StoreError> {
        let row = sqlx::query(sqlx::AssertSqlSafe(format!("{JOB}id = $1")))
            .bind(id.to_string())
            .fetch_optional(&self.reader)
            .await
            .map_err(failed("look up a job"))?;
        row.as_ref().map(job).transpose()
    }

    async fn waiting_jobs(&self) -> Result<Vec<Job>, StoreError> {
        const WAITING: &str = "state NOT IN ('done', 'failed', 'cancelled') ORDER BY place";
        let waiting = sqlx::query(sqlx::AssertSqlSafe(format!("{JOB}{WAITING}")))
            .fetch_all(&self.reader)
            .await
            .map_err(failed("list the queue"))?;
        waiting.iter().map(job).collect()
    }

    async fn jobs_over(&self, before: Option<u64>, most: u32) -> Result<Vec<Job>, StoreError> {
        const OVER: &str =
            "state IN ('done', 'failed', 'cancelled') AND place < $1 ORDER BY place DESC LIMIT $2";
        let over = sqlx::query(sqlx::AssertSqlSafe(format!("{JOB}{OVER}")))
            .bind(history::bound(before))
            .bind(i64::from(most))
            .fetch_all(&self.reader)
            .await
            .map_err(failed("list jobs that are over"))?;
        over.iter().map(job).collect()
    }

    async fn begin_run(&self, run: &mut RunView, header: &Record) -> Result<(), StoreError> {
        let failed = || failed("begin a run");
        let mut transaction = self.writer.begin().await.map_err(failed())?;
        let row = sqlx::query(
            "INSERT INTO runs (id, job, directory, planned, started, state, place) VALUES ($1, $2, $3, $4, $5, $6, \
             (SELECT COALESCE(MAX(place), 0) + 1 FROM runs)) RETURNING place",
        )
        .bind(&run.id)
        .bind(run.job.to_string())
        .bind(run.directory.to_string_lossy().into_owned())
        .bind(run.planned as i64)
        .bind(&run.started)
        .bind(word(&run.state))
        .fetch_one(&mut *transaction)
        .await
        .map_err(failed())?;
        run.place = number(&row, "place")?;
        history::describe(&mut transaction, run).await.map_err(failed())?;
        let body = json(header);
        sqlx::query("INSERT INTO records (run, seq, kind, body, sum) VALUES ($1, 0, $2, $3, $4)")
            .bind(&run.id)
            .bind(kind(header))
            .bind(&body)
            .bind(sum(&run.id, 0, &body))
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

    async fn reported(&self, run: &str, at: &str, verdict: VerdictView) -> Result<(), StoreError> {
        sqlx::query("UPDATE runs SET reported = $2, verdict = $3 WHERE id = $1")
            .bind(run)
            .bind(at)
            .bind(word(&verdict))
            .execute(&self.writer)
            .await
            .map_err(failed("note a report"))?;
        Ok(())
    }

    async fn describe_run(&self, run: &RunView) -> Result<(), StoreError> {
        let failed = || failed("describe a run");
        let mut transaction = self.writer.begin().await.map_err(failed())?;
        history::describe(&mut transaction, run).await.map_err(failed())?;
        transaction.commit().await.map_err(failed())
    }

    async fn archive_run(&self, run: &str, at: Option<&str>) -> Result<(), StoreError> {
        sqlx::query("UPDATE runs SET archived = $2 WHERE id = $1")
            .bind(run)
            .bind(at)
            .execute(&self.writer)
            .await
            .map_err(failed("put a run away"))?;
        Ok(())
    }

    async fn delete_run(&self, run: &str) -> Result<(), StoreError> {
        let failed = || failed("delete a run");
        let mut transaction = self.writer.begin().await.map_err(failed())?;
        history::delete(&mut transaction, run).await.map_err(failed())?;
        transaction.commit().await.map_err(failed())
    }

    async fn runs(&self, query: &RunQuery) -> Result<Vec<RunView>, StoreError> {
        let rows = history::select(query)
            .build()
            .fetch_all(&self.reader)
            .await
            .map_err(failed("list the runs"))?;
        rows.iter().map(run).collect()
    }

    async fn run(&self, id: &str) -> Result<Option<RunView>, StoreError> {
        let query = sqlx::AssertSqlSafe(format!(
            "{RUN}runs JOIN jobs ON jobs.id = runs.job WHERE runs.id = $1"
        ));
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
        let planned = match record {
            Record::Extension(extension) => extension.steps.len(),
            _ => 0,
        };
        let accepted = reading.is_some_and(|reading| reading.accepted);
        if planned > 0 || accepted {
            sqlx::query("UPDATE runs SET planned = planned + $1, accepted = accepted + $2 WHERE id = $3")
                .bind(planned as i64)
                .bind(i64::from(accepted))
                .bind(run)
                .execute(&mut *transaction)
                .await
                .map_err(recorded())?;
        }
        let body = json(record);
        sqlx::query(
            "INSERT INTO records (run, seq, kind, step, attempt, accepted, body, sum) \
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8)",
        )
        .bind(run)
        .bind(seq as i64)
        .bind(kind(record))
        .bind(reading.map(|reading| reading.step as i64))
        .bind(reading.map(|reading| i64::from(reading.attempt)))
        .bind(reading.map(|reading| i64::from(reading.accepted)))
        .bind(&body)
        .bind(sum(run, seq, &body))
        .execute(&mut *transaction)
        .await
        .map_err(recorded())?;
        transaction.commit().await.map_err(recorded())
    }

    async fn records(&self, run: &str) -> Result<Vec<Record>, StoreError> {
        let rows = sqlx::query("SELECT seq, body, sum FROM records WHERE run = $1 ORDER BY seq")
            .bind(run)
            .fetch_all(&self.reader)
            .await
            .map_err(failed("read a journal"))?;
        let record = |(place, row): (u64, &SqliteRow)| {
            let damaged = |why: String| StoreError::Damaged {
                what: "record",
                why: format!("record {place} of run {run}: {why}"),
            };
            let seq = number(row, "seq")?;
            let body: String = column(row, "body")?;
            let stored: Option<i64> = column(row, "sum")?;
            if seq != place {
                return Err(damaged(format!("it is missing, {seq} stands in its place")));
            }
            if stored.is_some_and(|stored| stored != sum(run, seq, &body)) {
                return Err(damaged("it is not what was written, by its checksum".to_owned()));
            }
            serde_json::from_str(&body).map_err(|error| damaged(error.to_string()))
        };
        (0..).zip(&rows).map(record).collect()
    }

    async fn latched(&self) -> Result<Option<FaultView>, StoreError> {
        let row = sqlx::query("SELECT * FROM faults WHERE acknowledged IS NULL ORDER BY seq DESC LIMIT 1")
            .fetch_optional(&self.reader)
            .await
            .map_err(failed("look up faults"))?;
        let fault = |row: &SqliteRow| {
            Ok(FaultView {
                remedy: None,
                id: FaultId::generate(),
                code: of_word(&column::<String>(row, "code")?, "fault")?,
                text: column(row, "what")?,
                at: column(row, "at")?,
                run: column(row, "run")?,
            })
        };
        row.as_ref().map(fault).transpose()
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
