use std::fs;
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
