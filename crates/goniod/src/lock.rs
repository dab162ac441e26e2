use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::Path;

use session::SessionError;

use crate::DaemonError;

/// Held as long as a daemon uses its data folder; the system releases it whatever ends the process.
#[derive(Debug)]
pub(crate) struct Lock(#[expect(dead_code, reason = "held, not read")] File);

impl Lock {
    /// Takes the lock of a data folder.
    ///
    /// # Errors
    /// Another daemon has it; the file cannot be made.
    pub(crate) fn take(data: &Path) -> Result<Self, DaemonError> {
        let unwritable = |source| SessionError::Out {
            path: data.to_owned(),
            source,
        };
        let mut file = OpenOptions::new()
            .create(true)
            .write(true)
            .truncate(false)
            .open(data.join("goniod.lock"))
            .map_err(unwritable)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(DaemonError::InUse {
                    path: data.to_owned(),
                });
            }
            Err(TryLockError::Error(source)) => return Err(unwritable(source).into()),
        }
        // For whoever looks who has it.
        let noted = file
            .set_len(0)
            .and_then(|()| writeln!(file, "{}", std::process::id()));
        noted.map_err(unwritable)?;
        Ok(Self(file))
    }
}
