use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use hyper::body::{Body, Bytes, Frame, Incoming, SizeHint};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::{Sleep, sleep};

use super::connections::{Answering, Connection};

/// A client that is behind and takes fewer bytes than this within the time limit is as good as one that takes none.
const LEAST: usize = 16 * 1024;

/// A connection's socket: tells what passes over it, and fails where a client takes too little for too long.
pub(crate) struct Watched<S> {
    socket: S,
    connection: Arc<Connection>,
    limit: Duration,
    /// Runs while the client is behind.
    patience: Option<Pin<Box<Sleep>>>,
    /// Bytes that it took since that began to run.
    taken: usize,
}

impl<S> Watched<S> {
    /// Fails where a client that is behind takes too little within a time limit.
    pub(crate) fn new(socket: S, connection: Arc<Connection>, limit: Duration) -> Self {
        Self {
            socket,
            connection,
            limit,
            patience: None,
            taken: 0,
        }
    }

    /// Judges what became of a write.
    fn wrote(&mut self, cx: &mut Context<'_>, result: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        match result {
            Poll::Ready(Ok(bytes)) => {
                self.connection.progress();
                self.taken += bytes;
                if self.taken >= LEAST {
                    self.forgive();
                }
                Poll::Ready(Ok(bytes))
            }
            Poll::Ready(Err(error)) => Poll::Ready(Err(error)),
            Poll::Pending => {
                self.connection.blocked(true);
                let limit = self.limit;
                let patience = self.patience.get_or_insert_with(|| Box::pin(sleep(limit)));
                ready!(patience.as_mut().poll(cx));
                Poll::Ready(Err(io::Error::new(
                    io::ErrorKind::TimedOut,
                    "the client does not read its answer",
                )))
            }
        }
    }

    fn forgive(&mut self) {
        self.patience = None;
        self.taken = 0;
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Watched<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let result = Pin::new(&mut self.socket).poll_read(cx, buffer);
        if buffer.filled().len() > before {
            self.connection.progress();
        }
        result
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Watched<S> {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.socket).poll_write(cx, bytes);
        self.wrote(cx, result)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let result = Pin::new(&mut self.socket).poll_write_vectored(cx, parts);
        self.wrote(cx, result)
    }

    fn is_write_vectored(&self) -> bool {
        self.socket.is_write_vectored()
    }

    /// Called once all is written: the client is not behind any more.
    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        ready!(Pin::new(&mut self.socket).poll_flush(cx))?;
        self.connection.blocked(false);
        self.forgive();
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.socket).poll_shutdown(cx)
    }
}

/// A request's body: tells whether it is waited for.
pub(crate) struct Asked {
    pub(crate) body: Incoming,
    pub(crate) connection: Arc<Connection>,
}

impl Body for Asked {
    type Data = Bytes;
    type Error = hyper::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, hyper::Error>>> {
        let frame = Pin::new(&mut self.body).poll_frame(cx);
        self.connection.wants_body(frame.is_pending());
        frame
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

impl Drop for Asked {
    fn drop(&mut self) {
        self.connection.wants_body(false);
    }
}

/// An answer's body: its request is being answered until it was sent, or given up.
pub(crate) struct Answer {
    pub(crate) body: axum::body::Body,
    pub(crate) _answering: Answering,
}

impl Body for Answer {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt, AsyncWriteExt, duplex};
    use tokio::time::Instant;

    use super::*;
    use crate::http::connections::Connections;

    const LIMIT: Duration = Duration::from_secs(20);
    /// What fits between the daemon and a client that does not read.
    const ROOM: usize = 1024;

    /// Writes an answer to a client that takes so many bytes each second; returns how that ended, and after how long.
    async fn answer(bytes: usize, per_second: usize) -> (io::Result<()>, Duration) {
        let (ours, mut theirs) = duplex(ROOM);
        let connections = Connections::new(1);
        let (slot, _) = connections.take();
        let mut watched = Watched::new(ours, Arc::clone(&slot.connection), LIMIT);
        let begun = Instant::now();
        let client = tokio::spawn(async move {
            let mut buffer = vec![0; per_second];
            loop {
                sleep(Duration::from_secs(1)).await;
                if per_second > 0 && matches!(theirs.read(&mut buffer).await, Ok(0) | Err(_)) {
                    return;
                }
            }
        });
        let result = async {
            watched.write_all(&vec![0; bytes]).await?;
            watched.flush().await
        };
        let result = result.await;
        client.abort();
        (result, begun.elapsed())
    }

    #[tokio::test(start_paused = true)]
    async fn a_client_that_takes_nothing_is_given_up_after_the_limit() {
        let (result, after) = answer(64 * 1024, 0).await;
        assert_eq!(result.unwrap_err().kind(), io::ErrorKind::TimedOut);
        assert!(
            (LIMIT..LIMIT + Duration::from_secs(1)).contains(&after),
            "{after:?}"
        );
    }

    #[tokio::test(start_paused = true)]
    async fn a_client_that_takes_a_byte_a_second_is_given_up_too() {
        let (result, after) = answer(64 * 1024, 1).await;
        assert_eq!(result.unwrap_err().kind(), io::ErrorKind::TimedOut);
        assert!(after < 2 * LIMIT, "{after:?}");
    }

    #[tokio::test(start_paused = true)]
    async fn a_slow_client_that_goes_on_reading_gets_its_whole_answer() {
        let (result, after) = answer(1 << 20, 1000).await;
        result.unwrap();
        assert!(after > 10 * LIMIT, "{after:?}");
    }

    #[tokio::test(start_paused = true)]
    async fn an_answer_that_nobody_is_behind_with_has_no_limit() {
        let (ours, mut theirs) = duplex(ROOM);
        let connections = Connections::new(1);
        let (slot, _) = connections.take();
        let mut watched = Watched::new(ours, Arc::clone(&slot.connection), LIMIT);
        for _ in 0..100 {
            watched.write_all(&[0; 10]).await.unwrap();
            watched.flush().await.unwrap();
            theirs.read_exact(&mut [0; 10]).await.unwrap();
            sleep(LIMIT).await;
        }
    }
}
