use std::path::Path;

use report::{Report, RunDirectory};

use crate::{DaemonError, Sqlite, Store};

/// Makes a run directory of a daemon's data folder again from the store that lies beside `runs`, also where nothing is
/// left of it. `None` where there is no store, or it does not know the run.
///
/// # Errors
/// A store that cannot be read; files that cannot be written.
pub async fn rebuild(directory: &Path) -> Result<Option<Report>, DaemonError> {
    let store = directory
        .parent()
        .and_then(Path::parent)
        .unwrap_or(Path::new("."));
    let store = store.join(crate::daemon::STORE);
    if !store.exists() {
        return Ok(None);
    }
    let store = Sqlite::open(&store).await?;
    // A directory is named for its time and its run.
    let name = directory
        .file_name()
        .map(|name| name.to_string_lossy().into_owned());
    let id = name
        .as_deref()
        .and_then(|name| name.rsplit('-').next())
        .unwrap_or_default();
    let records = match store.run(id).await? {
        Some(_) => store.records(id).await?,
        None => Vec::new(),
    };
    store.close().await;
    if records.is_empty() {
        return Ok(None);
    }
    Ok(Some(crate::daemon::write(
        &RunDirectory::at(directory),
        &records,
        report::Volume::Whole,
    )?))
}
