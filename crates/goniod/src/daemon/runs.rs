//! What was measured: the history, what is said of a run, its files.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use api::RecordEdit;
use report::RunDirectory;

use super::{Daemon, blocking};
use crate::refusal::chain;
use crate::{Caller, Refusal, RefusalKind, RunQuery, RunView};

/// Folder in the data folder of files that were made because somebody asked for them.
pub(super) const MADE: &str = "made";
/// Most of those that are kept: each may be made again.
const KEPT: usize = 4;

impl Daemon {
    /// The runs that somebody wants to see, newest first.
    ///
    /// # Errors
    /// A query that makes no sense; the store cannot be read.
    pub async fn runs(&self, query: &RunQuery) -> Result<Vec<RunView>, Refusal> {
        query.check()?;
        Ok(self.shared.store.runs(query).await?)
    }

    /// Changes what is said of a run. What was measured stays as it is, and so do the files that were written.
    ///
    /// # Errors
    /// There is none of that id; a text that is too long or holds control characters; the store cannot be written.
    pub async fn describe(&self, by: &Caller, id: &str, edit: RecordEdit) -> Result<RunView, Refusal> {
        let result = self.try_describe(by, id, edit).await;
        self.note(by, &format!("describe run {id}"), &result);
        result
    }

    async fn try_describe(&self, by: &Caller, id: &str, edit: RecordEdit) -> Result<RunView, Refusal> {
        let edit = checked(edit)?;
        let mut run = self.run(id).await?;
        let record = &mut run.record;
        for (text, new) in [
            (&mut run.specimen, edit.specimen),
            (&mut record.specimen_id, edit.specimen_id),
            (&mut record.material, edit.material),
            (&mut record.notes, edit.notes),
            (&mut record.operator, edit.operator),
            (&mut record.project, edit.project),
        ] {
            if let Some(new) = new {
                *text = new;
            }
        }
        if let Some(tags) = edit.tags {
            record.tags = tags;
        }
        record.edited = Some(self.shared.now());
        record.edited_by = Some(by.name.clone());
        self.shared.store.describe_run(&run).await?;
        Ok(run)
    }

    /// Puts a run away, so that the history does not show it unless asked, or takes it back.
    ///
    /// # Errors
    /// As [`Self::run`]; its job is not over.
    pub async fn archive(&self, by: &Caller, id: &str, away: bool) -> Result<RunView, Refusal> {
        let result = self.try_archive(id, away).await;
        let word = if away { "archive" } else { "unarchive" };
        self.note(by, &format!("{word} run {id}"), &result);
        result
    }

    async fn try_archive(&self, id: &str, away: bool) -> Result<RunView, Refusal> {
        over(&self.run(id).await?)?;
        let now = away.then(|| self.shared.now());
        self.shared.store.archive_run(id, now.as_deref()).await?;
        self.run(id).await
    }

    /// Deletes a run: its files, its journal, and that it was. It cannot be taken back.
    ///
    /// # Errors
    /// As [`Self::run`]; its job is not over; files that cannot be removed, and then it stays.
    pub async fn delete(&self, by: &Caller, id: &str) -> Result<(), Refusal> {
        let result = self.try_delete(id).await;
        self.note(by, &format!("delete run {id}"), &result);
        result
    }

    async fn try_delete(&self, id: &str) -> Result<(), Refusal> {
        let run = self.run(id).await?;
        over(&run)?;
        let folders = [run.directory, self.shared.settings.data.join(MADE).join(id)];
        // The files first: a run without files can be deleted again, a directory that the store does not know would
        // look like one of another store.
        blocking(move || {
            for folder in &folders {
                match fs::remove_dir_all(folder) {
                    Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                        return Err(Refusal::unavailable(format!(
                            "cannot remove {}: {error}",
                            folder.display()
                        )));
                    }
                    _ => {}
                }
            }
            Ok(())
        })
        .await??;
        Ok(self.shared.store.delete_run(id).await?)
    }

    /// Files of a run that are made when somebody asks for them, by name and size; none while it has no reconstruction.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub async fn files_to_make(&self, id: &str) -> Result<Vec<(&'static str, u64)>, Refusal> {
        let run = self.run(id).await?;
        // What says what is in them is written beside them.
        let made_of = run.directory.join(report::UNCERTAINTY);
        let complete = tokio::fs::try_exists(&made_of).await.unwrap_or(false);
        Ok(match complete {
            true => report::LARGE.map(|name| (name, report::LARGE_BYTES)).to_vec(),
            false => Vec::new(),
        })
    }

    /// Path of a file of a run that is made when somebody asks for it; `None` where it is none of those.
    ///
    /// # Errors
    /// As [`Self::run`]; it cannot be written.
    pub async fn make_file(&self, id: &str, name: &str) -> Result<Option<PathBuf>, Refusal> {
        let Some((name, _)) = self
            .files_to_make(id)
            .await?
            .into_iter()
            .find(|(n, _)| *n == name)
        else {
            return Ok(None);
        };
        // One at a time: whoever asks for the same at the same time gets what the first one made.
        let _alone = self.shared.making.lock().await;
        let folder = self.shared.settings.data.join(MADE);
        let path = folder.join(id).join(name);
        if tokio::fs::try_exists(&path).await.unwrap_or(false) {
            return Ok(Some(path));
        }
        let records = self.records(id).await?;
        let (directory, made) = (RunDirectory::at(folder.join(id)), path.clone());
        blocking(move || {
            fs::create_dir_all(directory.path()).map_err(|error| Refusal::unavailable(error.to_string()))?;
            make_room(&folder);
            report::write_large(&directory, &records, name)
                .map_err(|error| Refusal::unavailable(chain(&error)))
        })
        .await??;
        Ok(Some(made))
    }
}

/// Removes the oldest of the files that were made, so that one more may be.
fn make_room(folder: &Path) {
    let entries = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<(SystemTime, PathBuf)> = entries(folder)
        .flat_map(|run| entries(&run.path()).collect::<Vec<_>>())
        .filter_map(|file| Some((file.metadata().ok()?.modified().ok()?, file.path())))
        .collect();
    files.sort();
    let surplus = (files.len() + 1).saturating_sub(KEPT);
    for (_, file) in files.iter().take(surplus) {
        // One that cannot be removed is tried again the next time; whoever reads it has it open.
        let _ = fs::remove_file(file);
        if let Some(run) = file.parent() {
            let _ = fs::remove_dir(run);
        }
    }
}

/// Refuses what cannot be done to a run whose job may go on.
fn over(run: &RunView) -> Result<(), Refusal> {
    match run.state.over() {
        true => Ok(()),
        false => Err(Refusal::conflict(format!(
            "the job of run {} is {}: it must be over, cancel it first",
            run.id, run.state
        ))),
    }
}

/// The texts of an edit as they are kept: within the bounds of a job file.
fn checked(edit: RecordEdit) -> Result<RecordEdit, Refusal> {
    let refused = |flaw: sweep::RecordFlaw| Refusal::new(RefusalKind::Invalid, flaw.to_string());
    let line = |key, text: Option<String>| text.map(|text| sweep::line(key, &text)).transpose();
    let specimen = sweep::Specimen {
        tags: edit.tags.clone().unwrap_or_default(),
        notes: edit.notes.clone().unwrap_or_default(),
        ..sweep::Specimen::default()
    };
    let specimen = specimen.checked().map_err(refused)?;
    Ok(RecordEdit {
        specimen: line("specimen", edit.specimen).map_err(refused)?,
        specimen_id: line("specimen_id", edit.specimen_id).map_err(refused)?,
        material: line("material", edit.material).map_err(refused)?,
        tags: edit.tags.map(|_| specimen.tags),
        notes: edit.notes,
        operator: line("operator", edit.operator).map_err(refused)?,
        project: line("project", edit.project).map_err(refused)?,
    })
}

/// Removes what an earlier life of the daemon made.
pub(super) fn clear(data: &Path) {
    // What stays is replaced or removed later.
    let _ = fs::remove_dir_all(data.join(MADE));
}
