//! Run directories that lie beside a store and are not in it.

use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use ulid::Ulid;

use crate::store::has_log;
use crate::{DaemonError, Store};

/// Run directories of a data folder that its store does not know, which were accepted: ids, one a line.
const ACCEPTED: &str = "accepted-runs";

/// The run directories of a data folder, by which it is seen that its store was emptied, deleted or replaced.
///
/// A run is in the store before its directory is made, so a directory that the store does not know means that the store
/// is not the one with which it was measured.
#[derive(Debug)]
pub(crate) struct RunDirectories {
    data: PathBuf,
    /// Ids and names of all that hold a journal.
    found: Vec<(String, String)>,
}

impl RunDirectories {
    /// Looks which there are below `runs` of a data folder.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub(crate) fn of(data: &Path) -> Result<Self, DaemonError> {
        let runs = data.join("runs");
        let failed = |source| session::SessionError::Read {
            what: "folder of runs",
            path: runs.clone(),
            source,
        };
        let entries = match fs::read_dir(&runs) {
            Ok(entries) => entries.collect::<Result<Vec<_>, _>>().map_err(failed)?,
            // A file in its place holds no runs either; that none can be written is told where one is.
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                Vec::new()
            }
            Err(error) => return Err(failed(error).into()),
        };
        let mut found: Vec<_> = entries
            .iter()
            .filter(|entry| entry.path().join("journal").is_file())
            .filter_map(|entry| {
                let name = entry.file_name().to_string_lossy().into_owned();
                let id = name.rsplit('-').next()?.to_owned();
                Ulid::from_string(&id).is_ok().then_some((id, name))
            })
            .collect();
        found.sort();
        Ok(Self {
            data: data.to_owned(),
            found,
        })
    }

    /// Refuses to make a new store where one must have been: beside run directories, or beside the log of a store. To be
    /// asked before SQLite opens the file, since it throws away a log whose database is missing or empty.
    ///
    /// # Errors
    /// The store is missing or empty, and somebody must say whether that is meant.
    pub(crate) fn check_file(&self, store: &Path) -> Result<(), DaemonError> {
        let empty = fs::metadata(store).map_or(true, |file| file.len() == 0);
        let accepted = self.accepted()?;
        let unknown: Vec<_> = self.unknown(&BTreeSet::new(), &accepted);
        match empty && (has_log(store) || !unknown.is_empty()) {
            true => Err(self.refuse(store, "is missing or empty", &unknown)),
            false => Ok(()),
        }
    }

    /// Refuses a store that does not know all run directories that were not accepted.
    ///
    /// # Errors
    /// There are some that it does not know, and somebody must say whether that is meant.
    pub(crate) async fn check_store(&self, path: &Path, store: &dyn Store) -> Result<(), DaemonError> {
        let mut known = BTreeSet::new();
        for (id, _) in &self.found {
            if store.run(id).await?.is_some() {
                known.insert(id.clone());
            }
        }
        let accepted = self.accepted()?;
        match self.unknown(&known, &accepted).as_slice() {
            [] => Ok(()),
            unknown => Err(self.refuse(path, "does not know", unknown)),
        }
    }

    /// Accepts all that are there now, also those that the store does not know, and returns how many there are.
    ///
    /// # Errors
    /// The folder cannot be written.
    pub(crate) fn accept(&self) -> Result<usize, DaemonError> {
        let mut ids = self.accepted()?;
        ids.extend(self.found.iter().map(|(id, _)| id.clone()));
        let text: String = ids.iter().map(|id| format!("{id}\n")).collect();
        let folder = report::RunDirectory::at(&self.data);
        folder.write(ACCEPTED, |file| std::io::Write::write_all(file, text.as_bytes()))?;
        Ok(self.found.len())
    }

    fn accepted(&self) -> Result<BTreeSet<String>, DaemonError> {
        let path = self.data.join(ACCEPTED);
        match config::read_text(&path) {
            Ok(text) => Ok(text.lines().map(str::to_owned).collect()),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(BTreeSet::new()),
            Err(source) => Err(session::SessionError::Read {
                what: "list of accepted runs",
                path,
                source,
            }
            .into()),
        }
    }

    fn unknown(&self, known: &BTreeSet<String>, accepted: &BTreeSet<String>) -> Vec<&str> {
        let strange = |id: &String| !known.contains(id) && !accepted.contains(id);
        let found = self.found.iter().filter(|(id, _)| strange(id));
        found.map(|(_, name)| name.as_str()).collect()
    }

    fn refuse(&self, store: &Path, how: &'static str, unknown: &[&str]) -> DaemonError {
        DaemonError::StrangeRuns {
            store: store.to_owned(),
            how,
            runs: self.data.join("runs"),
            count: unknown.len(),
            such_as: unknown
                .first()
                .copied()
                .unwrap_or("its write-ahead log")
                .to_owned(),
        }
    }
}
