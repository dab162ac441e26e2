//! Rows of the tables and what they stand for.

use capture::Record;
use serde::Serialize;
use serde::de::DeserializeOwned;
use sqlx::Row;
use sqlx::sqlite::SqliteRow;

use crate::store::StoreError;
use crate::{Job, RecordView, RunView, VerdictView};

pub(super) fn failed(what: &'static str) -> impl Fn(sqlx::Error) -> StoreError {
    move |source| StoreError::Query { what, source }
}

pub(super) fn job(row: &SqliteRow) -> Result<Job, StoreError> {
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
        verdict: verdict(row)?,
        by: column(row, "submitted_by")?,
        whole: column::<i64>(row, "whole")? != 0,
        submitted: column(row, "submitted")?,
        changed: column(row, "changed")?,
    })
}

pub(super) fn run(row: &SqliteRow) -> Result<RunView, StoreError> {
    let job: String = column(row, "job")?;
    Ok(RunView {
        id: column(row, "id")?,
        job: job
            .parse()
            .map_err(|why| StoreError::Damaged { what: "run", why })?,
        name: column(row, "name")?,
        place: number(row, "place")?,
        state: of_word(&column::<String>(row, "state")?, "run")?,
        specimen: column(row, "specimen")?,
        record: record(row)?,
        archived: column(row, "archived")?,
        directory: column::<String>(row, "directory")?.into(),
        started: column(row, "started")?,
        reported: column(row, "reported")?,
        verdict: verdict(row)?,
        planned: number(row, "planned")?,
        accepted: number(row, "accepted")?,
    })
}

/// What is said of a run.
fn record(row: &SqliteRow) -> Result<RecordView, StoreError> {
    let tags: String = column(row, "tags")?;
    Ok(RecordView {
        specimen_id: column(row, "specimen_id")?,
        material: column(row, "material")?,
        tags: serde_json::from_str(&tags).map_err(|error| StoreError::Damaged {
            what: "list of tags",
            why: error.to_string(),
        })?,
        notes: column(row, "notes")?,
        operator: column(row, "operator")?,
        project: column(row, "project")?,
        edited: column(row, "edited")?,
        edited_by: column(row, "edited_by")?,
    })
}

/// What the checks said of a run.
fn verdict(row: &SqliteRow) -> Result<Option<VerdictView>, StoreError> {
    let word: Option<String> = column(row, "verdict")?;
    word.map(|word| of_word(&word, "verdict")).transpose()
}

pub(super) fn column<'r, T>(row: &'r SqliteRow, name: &'static str) -> Result<T, StoreError>
where
    T: sqlx::Decode<'r, sqlx::Sqlite> + sqlx::Type<sqlx::Sqlite>,
{
    row.try_get(name).map_err(failed("read a column"))
}

pub(super) fn number(row: &SqliteRow, name: &'static str) -> Result<u64, StoreError> {
    let number: i64 = column(row, name)?;
    u64::try_from(number).map_err(|_| StoreError::Damaged {
        what: "number",
        why: format!("{name} is {number}"),
    })
}

/// How an enum is spelled in a column: as in JSON, without the quotes.
pub(super) fn word(value: &impl Serialize) -> String {
    json(value).trim_matches('"').to_owned()
}

pub(super) fn of_word<T: DeserializeOwned>(word: &str, what: &'static str) -> Result<T, StoreError> {
    serde_json::from_value(word.into()).map_err(|error| StoreError::Damaged {
        what,
        why: error.to_string(),
    })
}

pub(super) fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("our own types have string keys only")
}

/// Checksum of a record: of its text, and of where it belongs.
pub(super) fn sum(run: &str, seq: u64, body: &str) -> i64 {
    let mut digest = SUM.digest();
    for part in [run.as_bytes(), &seq.to_le_bytes(), body.as_bytes()] {
        digest.update(part);
    }
    digest.finalize().into()
}

const SUM: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

pub(super) fn kind(record: &Record) -> &'static str {
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
