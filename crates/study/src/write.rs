use std::fs;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use crate::Error;

/// Writes a file under a temporary name and renames it, so that nobody sees half of it.
///
/// # Errors
/// The medium refuses.
pub(crate) fn file(directory: &Path, name: &str, bytes: &[u8]) -> Result<(), Error> {
    let path = directory.join(name);
    let part = directory.join(format!(".{name}.part"));
    fs::write(&part, bytes)
        .and_then(|()| fs::rename(&part, &path))
        .map_err(|source| Error::Io {
            what: "write",
            path,
            source,
        })
}

/// Writes a file unless there is one by that name, whole or not at all, whoever else does the same at the same time.
///
/// # Errors
/// The medium refuses.
pub(crate) fn new_file(directory: &Path, name: &str, bytes: &[u8]) -> Result<(), Error> {
    let path = directory.join(name);
    if path.exists() {
        return Ok(());
    }
    // For as many eyes as any other file: temporary ones are their owner's alone unless said otherwise.
    let readable = fs::Permissions::from_mode(0o666);
    let part = tempfile::Builder::new()
        .permissions(readable)
        .tempfile_in(directory);
    let written = part.and_then(|mut part| {
        part.write_all(bytes)?;
        match part.persist_noclobber(&path) {
            Err(error) if error.error.kind() == std::io::ErrorKind::AlreadyExists => Ok(()),
            persisted => persisted.map(drop).map_err(|error| error.error),
        }
    });
    written.map_err(|source| Error::Io {
        what: "write",
        path,
        source,
    })
}
