use std::io;
use std::path::{Path, PathBuf};

use crate::SimError;

/// A stable name for the pseudo-terminal: a symbolic link, gone when this is dropped.
pub(super) struct Link {
    path: PathBuf,
    target: PathBuf,
}

impl Link {
    /// Makes the link, in the place of one that a killed simulator left.
    ///
    /// # Errors
    /// Something other than a symbolic link is in the way, or the directory cannot be written.
    pub(super) fn make(path: &Path, target: &Path) -> Result<Self, SimError> {
        let fail = |source| SimError::Link {
            path: path.to_owned(),
            source,
        };
        match path.symlink_metadata() {
            Ok(found) if found.is_symlink() => std::fs::remove_file(path).map_err(fail)?,
            Ok(_) => {
                return Err(fail(io::Error::new(
                    io::ErrorKind::AlreadyExists,
                    "a file is in the way",
                )));
            }
            Err(_) => {}
        }
        std::os::unix::fs::symlink(target, path).map_err(fail)?;
        Ok(Self {
            path: path.to_owned(),
            target: target.to_owned(),
        })
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        // Another simulator may have taken the name over meanwhile.
        if std::fs::read_link(&self.path).is_ok_and(|target| target == self.target) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}
