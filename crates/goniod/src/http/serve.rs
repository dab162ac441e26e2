use std::io;
use std::num::NonZeroU32;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::response::Response;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use tokio::sync::{Semaphore, watch};
use tower::ServiceExt;

use super::accept::Accept;
use super::access::{self, Access};
use super::connections::{Connection, Connections, Slot};
use super::listener::Listener;
use super::metrics::Metrics;
use super::peer::Peer;
use super::router::router;
use super::shared::{Parts, Shared, WORKING};
use super::watched::{Answer, Asked, Watched};
use crate::Daemon;

/// What is being answered when the daemon ends has so long.
const LAST_ANSWERS: Duration = Duration::from_secs(2);
/// Where the system has no more open files and nothing of ours can be closed, it is asked again after so long.
const NO_FILES: Duration = Duration::from_millis(20);
/// Most bytes of a request's head, and of an answer that is about to be sent.
const BUFFER: usize = 64 * 1024;

/// Path of the stream of events.
const EVENTS: &str = "/api/v1/events";

/// How much a listener takes on.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Requests in a second, all clients together. The verbs that stop the rig are not counted.
    pub requests_per_s: NonZeroU32,
    /// Streams of events that are open at a time.
    pub streams: usize,
    /// Connections that are open at a time. A new one always gets in: the one that makes the least progress is closed.
    pub connections: usize,
    /// Longest time that a client may keep the daemon waiting: for the head of its request, the first as any further
    /// one, or by not reading its answer.
    pub idle: Duration,
    /// Largest body, bytes.
    pub body: usize,
    /// Longest time that a request may take to arrive and be answered; streams may go on.
    pub answer: Duration,
}

impl Limits {
    /// Far more than a lab needs, and little enough that a small computer bears it.
    pub const DEFAULT: Self = Self {
        requests_per_s: NonZeroU32::new(1000).expect("1000 is not 0"),
        streams: 100,
        // On TCP and on a Unix socket together, below the 1024 files that a process may have open by default.
        connections: 400,
        idle: Duration::from_secs(20),
        body: 256 * 1024,
        answer: Duration::from_secs(30),
    };
}

impl Default for Limits {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Answers requests until `shutdown`, then ends all streams and finishes what is being answered.
///
/// # Errors
/// None so far; what goes wrong on one connection ends that one.
pub async fn serve(
    listener: Listener,
    access: Access,
    limits: Limits,
    daemon: Daemon,
    shutdown: impl Future<Output = ()>,
) -> io::Result<()> {
    let (close, closing) = watch::channel(false);
    let shared = Shared::new(Parts {
        daemon,
        access,
        metrics: Metrics::new(),
        working: Arc::new(Semaphore::new(WORKING)),
        streams: Arc::new(Semaphore::new(limits.streams)),
        closing,
    });
    let app = router(shared.clone(), &limits);
    let server = Server::new(shared, app, limits);
    let shutdown = async {
        shutdown.await;
        close.send_replace(true);
    };
    match listener {
        Listener::Tcp(listener) => server.accept(listener, shutdown).await,
        Listener::Unix(socket) => server.accept(socket, shutdown).await,
    }
    Ok(())
}

/// One listener's connections. As axum's own server, with what that lacks: limits on their number and their silence.
struct Server {
    shared: Shared,
    app: Router,
    limits: Limits,
    http: http1::Builder,
    connections: Arc<Connections>,
    graceful: GracefulShutdown,
}

impl Server {
    fn new(shared: Shared, app: Router, limits: Limits) -> Self {
        let mut http = http1::Builder::new();
        http.timer(TokioTimer::new())
            .header_read_timeout(limits.idle)
            .max_buf_size(BUFFER);
        Self {
            shared,
            app,
            limits,
            http,
            connections: Connections::new(limits.connections),
            graceful: GracefulShutdown::new(),
        }
    }

    async fn accept<L: Accept>(self, listener: L, shutdown: impl Future<Output = ()>) {
        let mut shutdown = pin!(shutdown);
        loop {
            let accepted = tokio::select! {
                accepted = listener.accept(self.limits.idle) => accepted,
                () = &mut shutdown => break,
            };
            match accepted {
                Ok((socket, peer)) => {
                    let (slot, made_room) = self.connections.take();
                    self.attend(socket, peer, slot);
                    if made_room {
                        self.shared.metrics.closed("connections");
                        // A burst of connections must not take the slots of those that came just before.
                        tokio::task::yield_now().await;
                    }
                }
                Err(error) => self.refused(&error).await,
            }
        }
        drop(listener);
        if tokio::time::timeout(LAST_ANSWERS, self.graceful.shutdown())
            .await
            .is_err()
        {
            tracing::warn!("some answers were not finished");
            self.connections.close_all();
        }
    }

    /// Answers what comes over a connection, in a task of its own.
    fn attend<S>(&self, socket: S, peer: Peer, slot: Slot)
    where
        S: tokio::io::AsyncRead + tokio::io::AsyncWrite + Unpin + Send + 'static,
    {
        let socket = Watched::new(socket, Arc::clone(&slot.connection), self.limits.idle);
        let (app, connection) = (self.app.clone(), Arc::clone(&slot.connection));
        let service = service_fn(move |request| answer(app.clone(), Arc::clone(&connection), peer, request));
        let served = self
            .graceful
            .watch(self.http.serve_connection(TokioIo::new(socket), service));
        tokio::spawn(async move {
            tokio::select! {
                ended = served => if let Err(error) = ended {
                    tracing::debug!("connection ended: {error}");
                },
                () = slot.connection.closed() => tracing::debug!("connection closed to make room"),
            }
            // Only now that its file is closed.
            drop(slot);
        });
    }

    /// The system gave no connection. Where it has no more open files, one of ours makes room; nothing else would, and
    /// whoever wants to stop the rig waits.
    async fn refused(&self, error: &io::Error) {
        if matches!(
            error.kind(),
            io::ErrorKind::ConnectionRefused
                | io::ErrorKind::ConnectionAborted
                | io::ErrorKind::ConnectionReset
        ) {
            return;
        }
        let closed = self.connections.one_closed();
        if self.connections.close_one() {
            self.shared.metrics.closed("open files");
        }
        tracing::debug!("no connection: {error}");
        // An error means the same: it is time to ask again.
        let _ = tokio::time::timeout(NO_FILES, closed).await;
    }
}

/// Answers a request.
async fn answer(
    app: Router,
    connection: Arc<Connection>,
    peer: Peer,
    request: hyper::Request<Incoming>,
) -> Result<Response, std::convert::Infallible> {
    let answering = connection.answer();
    connection.streams(request.uri().path() == EVENTS);
    let _stopping = access::never_held_up(request.uri().path()).then(|| connection.stop());
    // A client that sends one request after the other without waiting must not keep a thread to itself: others, and new
    // connections, are looked at in between.
    tokio::task::yield_now().await;
    let mut request = request.map(|body| Body::new(Asked { body, connection }));
    request.extensions_mut().insert(peer);
    let response = app.oneshot(request).await?;
    Ok(response.map(|body| {
        Body::new(Answer {
            body,
            _answering: answering,
        })
    }))
}
