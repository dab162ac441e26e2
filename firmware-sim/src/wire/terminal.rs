use std::ffi::OsStr;
use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags, open};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, ioctl_tiocnxcl, tcgetattr, tcsetattr};

/// A pseudo-terminal in raw mode: our side, and the client's side by path.
///
/// It keeps a descriptor of the client's side open, so that a client may come and go without the terminal hanging
/// up, and so that its exclusive flag can be cleared: a killed client leaves TIOCEXCL set, which would lock out
/// everyone else for as long as the terminal lives. A file lock is what says that the port is in use.
pub(super) struct Terminal {
    ours: OwnedFd,
    theirs: OwnedFd,
    path: PathBuf,
}

impl Terminal {
    /// Opens one, its speed set to `baud` until a client sets its own.
    pub(super) fn open(baud: u32) -> io::Result<Self> {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&ours)?;
        unlockpt(&ours)?;
        let path = PathBuf::from(OsStr::from_bytes(ptsname(&ours, Vec::new())?.to_bytes()));
        let theirs = open(
            &path,
            OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC,
            Mode::empty(),
        )?;
        // A client that does not read must not stop the simulator: what does not fit is lost, as on a wire.
        rustix::fs::fcntl_setfl(&ours, rustix::fs::fcntl_getfl(&ours)? | OFlags::NONBLOCK)?;
        let mut settings = tcgetattr(&theirs)?;
        settings.make_raw();
        settings.set_speed(baud)?;
        tcsetattr(&theirs, OptionalActions::Now, &settings)?;
        Ok(Self { ours, theirs, path })
    }

    /// What a client opens.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Baud rate that the client set.
    pub(super) fn baud(&self) -> io::Result<u32> {
        Ok(tcgetattr(&self.theirs)?.output_speed())
    }

    /// Lets others open the port again after a client that was killed.
    pub(super) fn clear_exclusive(&self) -> io::Result<()> {
        Ok(ioctl_tiocnxcl(&self.theirs)?)
    }

    /// What the client has written, as far as it fits; 0 where there is nothing.
    pub(super) fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        match rustix::io::read(&self.ours, buffer) {
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            other => Ok(other?),
        }
    }

    /// Writes for the client; what does not fit is lost.
    pub(super) fn write(&self, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            match rustix::io::write(&self.ours, bytes) {
                Ok(written) => bytes = &bytes[written..],
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => {
                    tracing::warn!(lost = bytes.len(), "the client does not read");
                    break;
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

impl AsFd for Terminal {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.ours.as_fd()
    }
}
