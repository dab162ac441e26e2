use std::ffi::OsString;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;

/// What the address of a socket file begins with.
const UNIX: &str = "unix:";
/// Name of the socket file where none is named.
const SOCKET: &str = "goniod.sock";
/// Folder of the socket file of a system service.
const SYSTEM: &str = "/run/goniod";

/// Where to listen.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// An IP address and a port; port 0 takes a free one.
    Tcp(SocketAddr),
    /// A socket file.
    Unix(PathBuf),
}

impl Address {
    /// Returns the socket file of this user's daemon: in the runtime folder that systemd gave a service, else in
    /// `$XDG_RUNTIME_DIR`, else, for root, in `/run/goniod`. `None` where there is no such folder.
    pub fn usual_socket() -> Option<Self> {
        let root = rustix::process::geteuid().is_root();
        usual_socket(|name| std::env::var_os(name), root).map(Self::Unix)
    }
}

fn usual_socket(variable: impl Fn(&str) -> Option<OsString>, root: bool) -> Option<PathBuf> {
    let folder = |name| {
        variable(name)
            .map(PathBuf::from)
            .filter(|folder| folder.is_absolute())
    };
    let folder = folder("RUNTIME_DIRECTORY")
        .or_else(|| folder("XDG_RUNTIME_DIR"))
        .or_else(|| root.then(|| SYSTEM.into()))?;
    Some(folder.join(SOCKET))
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "unix" {
            return Self::usual_socket().ok_or_else(|| {
                "there is no usual place for the socket here, since $XDG_RUNTIME_DIR is not set; name one with unix:PATH"
                    .to_owned()
            });
        }
        match text.strip_prefix(UNIX) {
            Some("") => Err("the path of the socket is missing; allowed is unix:PATH".to_owned()),
            Some(path) => Ok(Self::Unix(path.into())),
            None => text.parse().map(Self::Tcp).map_err(|_| {
                format!(
                    "{text:?} is no address; allowed are IP:PORT, such as 127.0.0.1:4664 or [::1]:0, unix:PATH, and unix \
                     for the usual socket"
                )
            }),
        }
    }
}

impl std::fmt::Display for Address {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Tcp(address) => write!(f, "http://{address}"),
            Self::Unix(path) => write!(f, "{UNIX}{}", path.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_socket_is_in_the_runtime_folder_of_the_service_or_the_user() {
        let with = |variables: &[(&str, &str)], root| {
            let variable = |name: &str| {
                let known = variables.iter().find(|(known, _)| *known == name);
                known.map(|(_, value)| OsString::from(value))
            };
            usual_socket(variable, root).map(|path| path.display().to_string())
        };
        let (service, user) = (
            ("RUNTIME_DIRECTORY", "/run/goniod"),
            ("XDG_RUNTIME_DIR", "/run/user/7"),
        );
        assert_eq!(with(&[user, service], false).unwrap(), "/run/goniod/goniod.sock");
        assert_eq!(with(&[user], true).unwrap(), "/run/user/7/goniod.sock");
        assert_eq!(with(&[], true).unwrap(), "/run/goniod/goniod.sock");
        assert_eq!(with(&[], false), None);
        assert_eq!(with(&[("XDG_RUNTIME_DIR", "")], false), None);
    }

    #[test]
    fn an_address_is_read_as_it_is_printed() {
        for text in [
            "127.0.0.1:4664",
            "[::1]:0",
            "unix:/run/goniod/goniod.sock",
            "unix:goniod.sock",
        ] {
            let address: Address = text.parse().unwrap();
            assert_eq!(address.to_string().trim_start_matches("http://"), text);
        }
        for text in ["", "localhost", "4664", "unix:", "http://127.0.0.1:4664"] {
            assert!(text.parse::<Address>().unwrap_err().contains("allowed"), "{text}");
        }
    }
}
