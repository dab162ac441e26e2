use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use atomic_write_file::AtomicWriteFile;
use serde::{Deserialize, Serialize};
use tokio::sync::watch;

use super::NotKept;
use crate::FaultView;

/// Name of the file in the data folder.
const NAME: &str = "operator.json";
/// Time after which a medium that refused is tried again.
const AGAIN: Duration = Duration::from_secs(1);

/// What of the operator's word must survive the program.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct OperatorRecord {
    /// Whether a stop holds the queue.
    pub(super) queue_held: bool,
    /// The faults that nobody has acknowledged, newest last.
    pub(super) faults: Vec<FaultView>,
}

/// The record in a file of its own beside the store, so that no other program's lock on the store is between an operator
/// and the arms. It is replaced as a whole and synced; what is asked for while it is written is written once.
pub(super) struct RecordFile {
    wanted: watch::Sender<(u64, OperatorRecord)>,
    written: watch::Receiver<(u64, Result<(), NotKept>)>,
}

impl RecordFile {
    /// The file of a data folder and what it says; where it says nothing, why: `None` where there is no file yet.
    pub(super) fn open(directory: &Path) -> (Self, Result<OperatorRecord, Option<String>>) {
        let path = directory.join(NAME);
        let record = read(&path);
        let kept = record.clone().unwrap_or_default();
        let (wanted, changes) = watch::channel((0, kept));
        let (done, written) = watch::channel((0, Ok(())));
        tokio::spawn(write_changes(path, changes, done));
        (Self { wanted, written }, record)
    }

    /// Has a record written. Returns at once.
    pub(super) fn keep(&self, record: &OperatorRecord) {
        self.wanted.send_if_modified(|(revision, wanted)| {
            let changed = wanted != record;
            if changed {
                wanted.clone_from(record);
                *revision += 1;
            }
            changed
        });
    }

    /// Waits until what was to be kept is on disk.
    ///
    /// # Errors
    /// The medium refuses.
    pub(super) async fn kept(&self) -> Result<(), NotKept> {
        let revision = self.wanted.borrow().0;
        let mut written = self.written.clone();
        let result = written.wait_for(|(written, _)| *written >= revision).await;
        result.map_or_else(
            |_| Err(NotKept("the daemon has ended".to_owned())),
            |result| result.1.clone(),
        )
    }
}

fn read(path: &Path) -> Result<OperatorRecord, Option<String>> {
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(None),
        Err(error) => return Err(Some(unusable(path, &error))),
    };
    serde_json::from_str(&text).map_err(|error| Some(unusable(path, &error)))
}

fn unusable(path: &Path, error: &dyn std::error::Error) -> String {
    format!(
        "cannot read {}, which says whether the rig may move: {error}; look at the rig and acknowledge this, and the \
         file is made anew",
        path.display()
    )
}

/// Writes every change, the latest at a time, until nobody is left who could make one.
async fn write_changes(
    path: PathBuf,
    mut changes: watch::Receiver<(u64, OperatorRecord)>,
    done: watch::Sender<(u64, Result<(), NotKept>)>,
) {
    while changes.changed().await.is_ok() {
        loop {
            let (revision, record) = changes.borrow_and_update().clone();
            let file = path.clone();
            let result = tokio::task::spawn_blocking(move || write(&file, &record)).await;
            let result = result.map_err(io::Error::other).flatten();
            let result = result.map_err(|error| NotKept(format!("cannot write {}: {error}", path.display())));
            let failed = result.is_err();
            let _earlier = done.send_replace((revision, result));
            if !failed {
                break;
            }
            // A newer record is tried at once.
            if let Ok(Err(_)) = tokio::time::timeout(AGAIN, changes.changed()).await {
                return;
            }
        }
    }
}

fn write(path: &Path, record: &OperatorRecord) -> io::Result<()> {
    let mut file = AtomicWriteFile::open(path)?;
    serde_json::to_writer_pretty(&mut file, record)?;
    file.flush()?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FaultCode, FaultId};

    fn pressed() -> OperatorRecord {
        OperatorRecord {
            queue_held: true,
            faults: vec![FaultView {
                remedy: None,
                id: FaultId::generate(),
                code: FaultCode::Estop,
                text: "emergency stop by a test".to_owned(),
                at: "then".to_owned(),
                run: None,
            }],
        }
    }

    #[tokio::test]
    async fn what_was_kept_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let (file, nothing) = RecordFile::open(folder.path());
        assert_eq!(nothing, Err(None), "there is no file yet");
        let record = pressed();
        file.keep(&record);
        file.kept().await.unwrap();
        assert_eq!(RecordFile::open(folder.path()).1, Ok(record));
    }

    #[tokio::test]
    async fn a_file_that_says_nothing_is_no_leave_to_move() {
        for text in [
            "",
            "{",
            "{\"queue_held\":true}",
            "{\"faults\":[],\"queue_held\":false,\"more\":1}",
            "\u{1b}",
        ] {
            let folder = tempfile::tempdir().unwrap();
            std::fs::write(folder.path().join(NAME), text).unwrap();
            let (_, record) = RecordFile::open(folder.path());
            let why = record.unwrap_err().expect("there is a file");
            assert!(
                why.contains(NAME) && why.contains("acknowledge"),
                "{text:?}: {why}"
            );
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_medium_that_refuses_is_tried_again() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("missing");
        let (file, _) = RecordFile::open(&missing);
        let record = pressed();
        file.keep(&record);
        assert!(file.kept().await.unwrap_err().0.contains("missing"));
        std::fs::create_dir(&missing).unwrap();
        while file.kept().await.is_err() {
            tokio::time::advance(AGAIN).await;
        }
        assert_eq!(RecordFile::open(&missing).1, Ok(record));
    }
}
