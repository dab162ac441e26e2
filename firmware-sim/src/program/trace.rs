use std::fs::File;
use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, SystemTime};

use serde::Serialize;

use crate::{Server, SimError, Written};

/// A line of the file.
#[derive(Serialize)]
struct Line<'a> {
    /// When it was received, by the system's clock, s since 1970.
    unix_s: f64,
    /// When its packet had arrived, in the rig's time, s.
    rig_s: f64,
    id: u8,
    address: u16,
    bytes: &'a [u8],
}

/// Appends to a file what the host writes, as long as the server lives.
///
/// # Errors
/// A file that cannot be opened; no thread to be had.
pub(super) fn keep(path: &Path, server: &Server) -> Result<(), SimError> {
    let failed = |source| SimError::Trace {
        path: path.to_owned(),
        source,
    };
    let mut file = File::options()
        .append(true)
        .create(true)
        .open(path)
        .map_err(failed)?;
    let now = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
    let opened = now.saturating_sub(server.opened().elapsed());
    let written = server.trace();
    std::thread::Builder::new()
        .name("trace".to_owned())
        .spawn(move || {
            for written in written {
                if let Err(error) = append(&mut file, &written, opened) {
                    tracing::error!(%error, "the trace ends here");
                    return;
                }
            }
        })
        .map_err(failed)?;
    Ok(())
}

fn append(file: &mut File, written: &Written, opened: Duration) -> io::Result<()> {
    let line = Line {
        unix_s: (opened + written.received).as_secs_f64(),
        rig_s: written.at.as_secs_f64(),
        id: written.id,
        address: written.address,
        bytes: &written.bytes,
    };
    let mut text = serde_json::to_vec(&line)?;
    text.push(b'\n');
    // In one piece: whoever reads along sees whole lines.
    file.write_all(&text)
}
