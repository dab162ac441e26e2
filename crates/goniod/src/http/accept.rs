use std::io;
use std::time::Duration;

use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream, UnixStream};

use super::peer::Peer;
use super::socket_file::UnixSocket;

/// Bytes that the system keeps of an answer that a client has not read yet, so that one that reads nothing is noticed
/// and costs little.
const SEND_BUFFER: usize = 64 * 1024;

/// A socket that connections come from.
pub(crate) trait Accept {
    /// One of them.
    type Socket: AsyncRead + AsyncWrite + Unpin + Send + 'static;

    /// The next connection; one whose client does not acknowledge what it was sent for so long is closed.
    ///
    /// # Errors
    /// What the system says: nothing is wrong with the listener where it has no more open files, or where the client
    /// is gone already.
    async fn accept(&self, unacknowledged: Duration) -> io::Result<(Self::Socket, Peer)>;
}

impl Accept for TcpListener {
    type Socket = TcpStream;

    async fn accept(&self, unacknowledged: Duration) -> io::Result<(TcpStream, Peer)> {
        let (stream, address) = TcpListener::accept(self).await?;
        let socket = SockRef::from(&stream);
        // Without TCP_NODELAY a verb's answer may wait for an acknowledgement.
        noted(socket.set_tcp_nodelay(true));
        noted(socket.set_tcp_user_timeout(Some(unacknowledged)));
        noted(socket.set_send_buffer_size(SEND_BUFFER));
        Ok((stream, Peer::Tcp(address)))
    }
}

impl Accept for UnixSocket {
    type Socket = UnixStream;

    async fn accept(&self, _: Duration) -> io::Result<(UnixStream, Peer)> {
        let (stream, peer) = UnixSocket::accept(self).await?;
        noted(SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER));
        Ok((stream, peer))
    }
}

/// A connection without one of its options serves nearly as well.
fn noted(set: io::Result<()>) {
    if let Err(error) = set {
        tracing::debug!("an option of a connection is not set: {error}");
    }
}
