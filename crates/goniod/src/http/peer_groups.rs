//! The supplementary groups of whoever connected to a Unix socket.

// No library that is in use here has SO_PEERGROUPS. Other ways are no ways: /proc tells the groups of whoever has the
// process id by now, and the user database those of the account, not of the process.
#![allow(unsafe_code)]

use std::io;
use std::os::fd::{AsFd, AsRawFd};

/// The most groups that Linux lets a process have (NGROUPS_MAX).
const MOST: usize = 65_536;
/// Enough for nearly everybody.
const USUAL: usize = 64;

/// Returns the supplementary groups that the peer had when it connected (Linux, socket(7), SO_PEERGROUPS).
pub(crate) fn peer_groups(socket: impl AsFd) -> io::Result<Vec<u32>> {
    match groups(&socket, USUAL) {
        Err(error) if error.raw_os_error() == Some(libc::ERANGE) => groups(&socket, MOST),
        other => other,
    }
}

fn groups(socket: &impl AsFd, room: usize) -> io::Result<Vec<u32>> {
    let mut groups = vec![0_u32; room];
    let size = size_of::<u32>();
    let mut bytes = libc::socklen_t::try_from(room * size).expect("256 kB fit");
    // SAFETY: the descriptor is open for as long as it is borrowed, and the buffer has as many bytes as is said.
    let answer = unsafe {
        libc::getsockopt(
            socket.as_fd().as_raw_fd(),
            libc::SOL_SOCKET,
            libc::SO_PEERGROUPS,
            groups.as_mut_ptr().cast(),
            &raw mut bytes,
        )
    };
    if answer != 0 {
        return Err(io::Error::last_os_error());
    }
    groups.truncate(bytes as usize / size);
    Ok(groups)
}
