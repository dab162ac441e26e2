use std::fs::{self, Metadata, Permissions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use tokio::net::{UnixListener, UnixStream};

use super::listener::ListenError;
use super::peer::{LocalUser, Peer};

/// Owner and group may connect.
const MODE: u32 = 0o660;
/// A program that listens takes a connection at once, if only into its queue.
const KNOCK: Duration = Duration::from_secs(1);

/// A Unix socket that is listened on, and its file, which is removed when it is dropped.
#[derive(Debug)]
pub struct UnixSocket {
    listener: UnixListener,
    file: SocketFile,
}

impl UnixSocket {
    /// Listens on a path. A socket file that nobody listens on any more is replaced, nothing else is removed.
    pub(crate) async fn bind(path: &Path) -> Result<Self, ListenError> {
        let failed = |source| ListenError::Unix {
            path: path.to_owned(),
            source,
        };
        if let Some(folder) = missing_folder(path) {
            return Err(ListenError::NoFolder {
                path: path.to_owned(),
                folder,
            });
        }
        match fs::symlink_metadata(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(failed(error)),
            Ok(there) => remove_stale(path, &there).await?,
        }
        let listener = UnixListener::bind(path).map_err(failed)?;
        let made = fs::symlink_metadata(path).map_err(failed)?;
        let file = SocketFile {
            path: path.to_owned(),
            owner: made.uid(),
            group: made.gid(),
            id: id(&made),
        };
        fs::set_permissions(path, Permissions::from_mode(MODE)).map_err(failed)?;
        Ok(Self { listener, file })
    }

    /// Where it is.
    pub(crate) fn path(&self) -> &Path {
        &self.file.path
    }

    /// The next connection, and who is at its other end.
    pub(crate) async fn accept(&self) -> io::Result<(UnixStream, Peer)> {
        let (stream, _) = self.listener.accept().await?;
        let peer = self.file.peer(&stream);
        Ok((stream, peer))
    }
}

/// The file of a Unix socket; removed when dropped, if it is still there.
#[derive(Debug)]
pub(crate) struct SocketFile {
    path: PathBuf,
    owner: u32,
    group: u32,
    /// Device and number of the file.
    id: (u64, u64),
}

impl SocketFile {
    /// Tells who is at the other end of a connection: root, the file's owner and the members of its group may operate.
    /// Whoever cannot be told may not.
    pub(crate) fn peer(&self, stream: &UnixStream) -> Peer {
        let (owner, group) = self.owner_and_group();
        let user =
            LocalUser::of(stream).inspect_err(|error| tracing::warn!("cannot tell who connects: {error}"));
        Peer::Local {
            uid: user.as_ref().ok().map(|user| user.uid),
            operates: user.is_ok_and(|user| user.is_one_of(owner, group)),
        }
    }

    /// As the file says now: it may have been given to others since it was made.
    fn owner_and_group(&self) -> (u32, u32) {
        match fs::symlink_metadata(&self.path) {
            Ok(now) if id(&now) == self.id => (now.uid(), now.gid()),
            _ => (self.owner, self.group),
        }
    }
}

impl Drop for SocketFile {
    fn drop(&mut self) {
        if fs::symlink_metadata(&self.path).is_ok_and(|now| id(&now) == self.id) {
            // Whoever starts next would replace it.
            let _ = fs::remove_file(&self.path);
        }
    }
}

fn id(metadata: &Metadata) -> (u64, u64) {
    (metadata.dev(), metadata.ino())
}

/// The folder of a path, where there is none.
fn missing_folder(path: &Path) -> Option<PathBuf> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty())?;
    let missing = fs::metadata(folder).is_err_and(|error| error.kind() == ErrorKind::NotFound);
    missing.then(|| folder.to_owned())
}

/// Removes a socket file that nobody listens on; refuses where the path has anything else.
async fn remove_stale(path: &Path, there: &Metadata) -> Result<(), ListenError> {
    let kind = there.file_type();
    if !kind.is_socket() {
        let what = if kind.is_symlink() {
            "a symbolic link"
        } else if kind.is_dir() {
            "a folder"
        } else if kind.is_file() {
            "a file"
        } else {
            "something that is no socket"
        };
        return Err(ListenError::Taken {
            path: path.to_owned(),
            what,
        });
    }
    // Refused: the file is all that is left of it. All else, a full queue or a socket of another kind, may be in use.
    let answer = tokio::time::timeout(KNOCK, UnixStream::connect(path)).await;
    match answer {
        Ok(Err(error)) if error.kind() == ErrorKind::ConnectionRefused => remove(path),
        _ => Err(ListenError::InUse {
            path: path.to_owned(),
        }),
    }
}

fn remove(path: &Path) -> Result<(), ListenError> {
    match fs::remove_file(path) {
        // Another goniod may have removed it first; who of them listens is told by binding.
        Err(source) if source.kind() != ErrorKind::NotFound => Err(ListenError::Unix {
            path: path.to_owned(),
            source,
        }),
        _ => Ok(()),
    }
}
