//! Whether a store's file is whole, as far as SQLite and the form of the records can tell.

use std::path::Path;

use sqlx::{Row, SqlitePool};

use super::row::failed;
use crate::store::StoreError;

/// Most flaws that are told of one store.
const MOST: usize = 5;

/// Checks every page and index of a store, that every record is what JSON may be, and that no row points at one that is
/// missing. The time it takes grows with the file; `path` is for the error.
///
/// # Errors
/// It is damaged, and where.
pub(super) async fn check(pool: &SqlitePool, path: &Path) -> Result<(), StoreError> {
    let rows = sqlx::query(sqlx::AssertSqlSafe(format!("PRAGMA integrity_check({MOST})")))
        .fetch_all(pool)
        .await
        .map_err(|error| damage(path, error))?;
    let mut flaws: Vec<String> = rows.iter().filter_map(|row| row.try_get(0).ok()).collect();
    flaws.retain(|flaw| flaw != "ok");
    if flaws.is_empty() {
        flaws.extend(orphans(pool, path).await?);
        flaws.extend(unreadable(pool, path).await?);
    }
    match flaws.is_empty() {
        true => Ok(()),
        false => Err(StoreError::Corrupt {
            path: path.to_owned(),
            why: flaws.join("; "),
        }),
    }
}

/// Rows whose run or job is missing.
async fn orphans(pool: &SqlitePool, path: &Path) -> Result<Option<String>, StoreError> {
    let rows = sqlx::query("PRAGMA foreign_key_check")
        .fetch_all(pool)
        .await
        .map_err(|error| damage(path, error))?;
    Ok((!rows.is_empty()).then(|| format!("{} rows belong to a run or job that is missing", rows.len())))
}

/// Records that are no JSON, in a store that has records.
async fn unreadable(pool: &SqlitePool, path: &Path) -> Result<Option<String>, StoreError> {
    let tables = sqlx::query("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'records'")
        .fetch_optional(pool)
        .await
        .map_err(|error| damage(path, error))?;
    if tables.is_none() {
        return Ok(None);
    }
    let row = sqlx::query("SELECT COUNT(*), MIN(run) FROM records WHERE NOT json_valid(body)")
        .fetch_one(pool)
        .await
        .map_err(|error| damage(path, error))?;
    let count: i64 = row.try_get(0).map_err(failed("check the records"))?;
    let run: Option<String> = row.try_get(1).map_err(failed("check the records"))?;
    Ok((count > 0).then(|| {
        format!(
            "{count} records cannot be read, the first of run {}",
            run.unwrap_or_default()
        )
    }))
}

/// An error while a store is opened or checked: damage in words where SQLite calls it that, else what it is.
pub(super) fn damage(path: &Path, source: sqlx::Error) -> StoreError {
    match StoreError::primary_code(&source) {
        Some(CORRUPT) => StoreError::Corrupt {
            path: path.to_owned(),
            why: source.to_string(),
        },
        Some(NOT_A_DATABASE) => StoreError::Corrupt {
            path: path.to_owned(),
            why: "it is no SQLite database".to_owned(),
        },
        _ => StoreError::Open {
            path: path.to_owned(),
            source,
        },
    }
}

/// SQLite's result codes for damage (SQLite, "Result and Error Codes").
const CORRUPT: u32 = 11;
const NOT_A_DATABASE: u32 = 26;
