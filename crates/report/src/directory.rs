use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::ReportError;

/// A run directory: the journal and everything that is derived from it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunDirectory(PathBuf);

impl RunDirectory {
    /// The run directory at a path, which need not exist yet.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self(path.into())
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Path of the journal, the only file that is not derived.
    pub fn journal(&self) -> PathBuf {
        self.file("journal")
    }

    /// Writes a file under a temporary name, syncs it and renames it, so that nobody ever sees half of it.
    ///
    /// # Errors
    /// What `fill` or the medium says; an older file of that name is then still there, untouched.
    pub fn write(
        &self,
        name: &str,
        fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), ReportError> {
        let path = self.file(name);
        let part = self.file(&format!(".{name}.part"));
        let attempt = || -> io::Result<()> {
            let mut file = BufWriter::new(File::create(&part)?);
            fill(&mut file)?;
            file.flush()?;
            file.get_ref().sync_all()?;
            fs::rename(&part, &path)
        };
        attempt().map_err(|source| {
            // The cause is worth more than a failure to clear up behind it.
            let _ = fs::remove_file(&part);
            ReportError::Write { path, source }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_no_rubbish() {
        let temporary = tempfile::tempdir().unwrap();
        let directory = RunDirectory::at(temporary.path());
        directory
            .write("run.json", |file| file.write_all(b"old"))
            .unwrap();
        let error = directory
            .write("run.json", |file| {
                file.write_all(b"half of the n")?;
                Err(io::ErrorKind::StorageFull.into())
            })
            .unwrap_err();
        let ReportError::Write { source, .. } = &error else {
            panic!("{error:?}");
        };
        assert!(crate::is_full(source), "{error:?}");
        assert_eq!(fs::read(directory.file("run.json")).unwrap(), b"old");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
