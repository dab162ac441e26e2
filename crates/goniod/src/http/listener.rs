use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use tokio::net::TcpListener;

use super::address::Address;
use super::socket_file::UnixSocket;

/// Why an address cannot be listened on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ListenError {
    /// The system refuses a TCP address.
    #[error(
        "cannot listen on http://{address}; is another goniod running, or is the address not of this computer? name another one with --listen"
    )]
    Tcp {
        /// Which address.
        address: SocketAddr,
        /// What the system says.
        source: io::Error,
    },
    /// Something else than a socket has the path of the socket. It is left as it is.
    #[error("cannot listen on unix:{}: there is {what}, which is left as it is; name another path with --listen", .path.display())]
    Taken {
        /// Which path.
        path: PathBuf,
        /// What there is.
        what: &'static str,
    },
    /// A program listens on the socket, or might.
    #[error("cannot listen on unix:{}: another program has this socket; end it, or name another path with --listen", .path.display())]
    InUse {
        /// Which path.
        path: PathBuf,
    },
    /// There is no folder for the socket.
    #[error("cannot listen on unix:{}: there is no folder {}; make it, or name another path with --listen", .path.display(), .folder.display())]
    NoFolder {
        /// Which path.
        path: PathBuf,
        /// The folder that is missing.
        folder: PathBuf,
    },
    /// The system refuses the socket.
    #[error("cannot listen on unix:{}", .path.display())]
    Unix {
        /// Which path.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// A socket that is listened on.
#[derive(Debug)]
pub enum Listener {
    /// TCP.
    Tcp(TcpListener),
    /// A Unix socket.
    Unix(UnixSocket),
}

impl Listener {
    /// Listens. A socket file that nobody listens on any more is replaced; nothing else is ever removed.
    ///
    /// # Errors
    /// An address that is in use, or not to be had; a path that something else has, or whose folder is missing.
    pub async fn bind(address: &Address) -> Result<Self, ListenError> {
        match address {
            &Address::Tcp(address) => match TcpListener::bind(address).await {
                Ok(listener) => Ok(Self::Tcp(listener)),
                Err(source) => Err(ListenError::Tcp { address, source }),
            },
            Address::Unix(path) => UnixSocket::bind(path).await.map(Self::Unix),
        }
    }

    /// The address, with the port that was taken.
    ///
    /// # Errors
    /// What the system says.
    pub fn address(&self) -> io::Result<Address> {
        match self {
            Self::Tcp(listener) => listener.local_addr().map(Address::Tcp),
            Self::Unix(socket) => Ok(Address::Unix(Path::to_owned(socket.path()))),
        }
    }
}
