//! Copies of a store, and bringing one back.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use sqlx::Row;
use sqlx::migrate::MigrateError;
use sqlx::sqlite::{SqliteConnectOptions, SqlitePool, SqlitePoolOptions};

use super::row::failed;
use super::{BUSY, migrations, soundness};
use crate::store::StoreError;

/// What SQLite keeps beside a database: its write-ahead log, and the index of that.
const BESIDE: [&str; 2] = ["-wal", "-shm"];

/// Copies a store into a new file, as it is at one moment, with what is still in its write-ahead log. A daemon may write
/// it meanwhile. The copy is complete, synced and checked when this returns, or not there.
///
/// # Errors
/// There is no store, or it is damaged; the copy exists already, or cannot be written.
pub async fn backup(store: &Path, to: &Path) -> Result<(), StoreError> {
    if to.exists() {
        return Err(StoreError::Exists { path: to.to_owned() });
    }
    let source = open(store).await?;
    let copied = copy(&source, store, to).await;
    source.close().await;
    copied
}

async fn copy(source: &SqlitePool, store: &Path, to: &Path) -> Result<(), StoreError> {
    soundness::check(source, store).await?;
    let part = with_suffix(to, ".part");
    let failed = |source| StoreError::Copy {
        path: to.to_owned(),
        source,
    };
    // What an attempt before this one left behind.
    remove(&part).map_err(failed)?;
    let vacuum = sqlx::query("VACUUM INTO $1").bind(part.to_string_lossy().into_owned());
    let made = async {
        vacuum
            .execute(source)
            .await
            .map_err(|error| soundness::damage(store, error))?;
        verify(&part).await?;
        File::open(&part)
            .and_then(|file| file.sync_all())
            .and_then(|()| fs::rename(&part, to))
            .and_then(|()| sync_folder(to))
            .map_err(failed)
    };
    let made = made.await;
    if made.is_err() {
        // The cause is worth more than a failure to clear up behind it.
        let _ = remove(&part);
    }
    made
}

/// Checks that a file is a whole store of this version or an older one. Changes nothing.
///
/// # Errors
/// It is missing, damaged, no store, or of a newer version.
pub(super) async fn verify(path: &Path) -> Result<(), StoreError> {
    let pool = open(path).await?;
    let checked = async {
        soundness::check(&pool, path).await?;
        let tables = sqlx::query("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = 'lives'")
            .fetch_optional(&pool)
            .await
            .map_err(|error| soundness::damage(path, error))?;
        if tables.is_none() {
            return Err(StoreError::Corrupt {
                path: path.to_owned(),
                why: "it holds no queue: it was not made by goniod".to_owned(),
            });
        }
        let row = sqlx::query("SELECT COALESCE(MAX(version), 0) AS version FROM _sqlx_migrations")
            .fetch_one(&pool)
            .await
            .map_err(|error| soundness::damage(path, error))?;
        let version: i64 = row.try_get("version").map_err(failed("look up its version"))?;
        let newest = migrations().iter().map(|migration| migration.version).max();
        match Some(version) > newest {
            true => Err(StoreError::Migrate {
                path: path.to_owned(),
                source: MigrateError::VersionMissing(version),
            }),
            false => Ok(()),
        }
    };
    let checked = checked.await;
    pool.close().await;
    checked
}

/// Puts a copy of a store in the place of the store. What stood there is kept under another name, which is returned.
/// Nobody may use the store meanwhile.
///
/// # Errors
/// The copy is damaged or no store, and nothing was changed; the folder cannot be written.
pub async fn restore(copy: &Path, store: &Path, at: &str) -> Result<Option<PathBuf>, StoreError> {
    verify(copy).await?;
    let failed = |source| StoreError::Copy {
        path: store.to_owned(),
        source,
    };
    let part = with_suffix(store, ".part");
    // A copy that was made by hand may have a write-ahead log beside it, which belongs to it.
    remove(&part).map_err(failed)?;
    let source = open(copy).await?;
    let copied = sqlx::query("VACUUM INTO $1")
        .bind(part.to_string_lossy().into_owned())
        .execute(&source)
        .await
        .map_err(|error| soundness::damage(copy, error));
    source.close().await;
    copied?;
    File::open(&part)
        .and_then(|file| file.sync_all())
        .map_err(failed)?;
    let aside = set_aside(store, at).map_err(failed)?;
    fs::rename(&part, store)
        .and_then(|()| sync_folder(store))
        .map_err(failed)?;
    Ok(aside)
}

/// Renames a store and what SQLite keeps beside it, the log first: a store without its log is an older one, and a log
/// without its store is nothing. Returns the new name where there was a store or a log.
fn set_aside(store: &Path, at: &str) -> std::io::Result<Option<PathBuf>> {
    let aside = with_suffix(store, &format!(".before-{at}"));
    let mut moved = None;
    for suffix in BESIDE.into_iter().chain([""]) {
        let from = with_suffix(store, suffix);
        if from.exists() {
            fs::rename(&from, with_suffix(&aside, suffix))?;
            moved = Some(aside.clone());
        }
    }
    Ok(moved)
}

/// Opens a database that is there; makes none.
async fn open(path: &Path) -> Result<SqlitePool, StoreError> {
    let options = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(false)
        .busy_timeout(BUSY);
    SqlitePoolOptions::new()
        .max_connections(1)
        .acquire_timeout(2 * BUSY)
        .connect_with(options)
        .await
        .map_err(|error| soundness::damage(path, error))
}

fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

fn remove(path: &Path) -> std::io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        removed => removed,
    }
}

/// A name is durable once its folder is.
fn sync_folder(path: &Path) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}

/// Whether the write-ahead log of a store holds something.
pub(crate) fn has_log(store: &Path) -> bool {
    fs::metadata(with_suffix(store, "-wal")).is_ok_and(|log| log.len() > 0)
}
