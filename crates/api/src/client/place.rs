use std::io::{self, ErrorKind};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;

/// Where a daemon listens over TCP unless told otherwise.
const TCP: &str = "http://127.0.0.1:4664";
/// Name of its socket in the user's runtime folder.
const SOCKET: &str = "goniod.sock";
/// The socket of a system service.
const SYSTEM: &str = "/run/goniod/goniod.sock";

/// Where the daemon of this computer is looked for.
#[derive(Debug)]
pub(super) struct Place {
    /// A socket on which somebody listens, else the usual TCP address.
    pub(super) address: String,
    /// Sockets that were tried in vain, and why.
    in_vain: Vec<(PathBuf, io::Error)>,
}

impl Place {
    /// Looks for a socket on which a daemon listens: this user's own first, then that of the system service.
    pub(super) fn find() -> Self {
        let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
        let own = runtime.filter(|folder| folder.is_absolute());
        Self::among(
            own.map(|folder| folder.join(SOCKET))
                .into_iter()
                .chain([SYSTEM.into()]),
        )
    }

    fn among(sockets: impl IntoIterator<Item = PathBuf>) -> Self {
        let mut in_vain = Vec::new();
        for path in sockets {
            match UnixStream::connect(&path) {
                Ok(_) => {
                    let address = format!("unix:{}", path.display());
                    return Self { address, in_vain };
                }
                Err(error) => in_vain.push((path, error)),
            }
        }
        Self {
            address: TCP.to_owned(),
            in_vain,
        }
    }

    /// Says where else the daemon was looked for, and what can be done.
    pub(super) fn remedy(&self) -> String {
        let mut text = String::new();
        for (path, error) in &self.in_vain {
            let path = path.display();
            text += &match error.kind() {
                ErrorKind::NotFound => format!("; there is no socket {path}"),
                ErrorKind::ConnectionRefused => format!("; nobody listens on the socket {path}"),
                ErrorKind::PermissionDenied => format!(
                    "; this user may not use the socket {path}: join its group, which `ls -l {path}` shows, and log in again"
                ),
                _ => format!("; the socket {path} cannot be used ({error})"),
            };
        }
        text + "; start the daemon with `goniod` or `systemctl start goniod`, or say with --daemon where it is"
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixListener;

    use super::*;

    #[test]
    fn the_first_socket_on_which_somebody_listens_is_taken() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        drop(UnixListener::bind(at("dead")).unwrap());
        let _first = UnixListener::bind(at("first")).unwrap();
        let _second = UnixListener::bind(at("second")).unwrap();
        let place = Place::among(["missing", "dead", "first", "second"].map(at));
        assert_eq!(place.address, format!("unix:{}", at("first").display()));
    }

    #[test]
    fn where_nobody_listens_tcp_is_tried_and_what_can_be_done_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        drop(UnixListener::bind(at("dead")).unwrap());
        let place = Place::among(["missing", "dead"].map(at));
        assert_eq!(place.address, TCP);
        let remedy = place.remedy();
        for part in [
            "no socket",
            "nobody listens",
            "`goniod`",
            "systemctl start",
            "--daemon",
        ] {
            assert!(remedy.contains(part), "{remedy}");
        }
    }
}
