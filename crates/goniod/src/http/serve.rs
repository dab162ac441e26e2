use std::fmt;
use std::io;
use std::num::NonZeroU32;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::http::Request;
use axum::serve::ListenerExt;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use hyper_util::service::TowerToHyperService;
use tokio::sync::{Semaphore, watch};
use tower::ServiceExt;

use super::access::Access;
use super::listener::Listener;
use super::metrics::Metrics;
use super::router::router;
use super::shared::{Parts, Shared};
use crate::Daemon;

/// A connection that says nothing for so long is closed.
const SILENT: Duration = Duration::from_secs(20);
/// What is being answered when the daemon ends has so long.
const LAST_ANSWERS: Duration = Duration::from_secs(2);

/// How much a listener takes on.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Requests in a second, all clients together. The verbs that stop the rig are not counted.
    pub requests_per_s: NonZeroU32,
    /// Streams of events that are open at a time.
    pub streams: usize,
    /// Connections that are open at a time.
    pub connections: usize,
    /// Largest body, bytes.
    pub body: usize,
    /// Longest time that a request may take to arrive and be answered; streams may go on.
    pub answer: Duration,
}

impl Default for Limits {
    /// Far more than a lab needs, and little enough that a small computer bears it.
    fn default() -> Self {
        Self {
            requests_per_s: NonZeroU32::new(1000).expect("1000 is not 0"),
            streams: 100,
            // Below the 1024 files that a process may have open by default.
            connections: 500,
            body: 256 * 1024,
            answer: Duration::from_secs(30),
        }
    }
}

/// Who is at the other end of a connection.
#[derive(Clone, Debug, Default)]
pub(crate) struct Peer(Option<std::net::SocketAddr>);

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(address) => address.ip().fmt(f),
            None => f.write_str("local socket"),
        }
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
        streams: Arc::new(Semaphore::new(limits.streams)),
        closing,
    });
    let app = router(shared, &limits);
    let shutdown = async {
        shutdown.await;
        close.send_replace(true);
    };
    match listener {
        Listener::Tcp(listener) => {
            // Without it a verb's answer may wait for an acknowledgement.
            let listener = listener.tap_io(|stream| {
                if let Err(error) = stream.set_nodelay(true) {
                    tracing::debug!("no TCP_NODELAY: {error}");
                }
            });
            accept(listener, |address| Peer(Some(address)), app, &limits, shutdown).await;
        }
        Listener::Unix(listener) => accept(listener, |_| Peer(None), app, &limits, shutdown).await,
    }
    Ok(())
}

/// As axum's own server, with what that lacks: a limit on connections and on their silence.
async fn accept<L: axum::serve::Listener>(
    mut listener: L,
    peer: impl Fn(L::Addr) -> Peer,
    app: Router,
    limits: &Limits,
    shutdown: impl Future<Output = ()>,
) {
    let slots = Arc::new(Semaphore::new(limits.connections));
    let graceful = GracefulShutdown::new();
    let mut server = http1::Builder::new();
    server.timer(TokioTimer::new()).header_read_timeout(SILENT);
    let mut shutdown = pin!(shutdown);
    loop {
        let (io, address) = tokio::select! {
            accepted = listener.accept() => accepted,
            () = &mut shutdown => break,
        };
        let peer = peer(address);
        let Ok(slot) = Arc::clone(&slots).try_acquire_owned() else {
            tracing::warn!(%peer, "refused: {} connections are open already", limits.connections);
            continue;
        };
        // A layer would make every route anew, more than a megabyte for each connection.
        let app = app.clone().map_request(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(peer.clone());
            request
        });
        let service = TowerToHyperService::new(app);
        let connection = graceful.watch(server.serve_connection(TokioIo::new(io), service));
        tokio::spawn(async move {
            let _slot = slot;
            if let Err(error) = connection.await {
                tracing::debug!("connection ended: {error}");
            }
        });
    }
    drop(listener);
    if tokio::time::timeout(LAST_ANSWERS, graceful.shutdown())
        .await
        .is_err()
    {
        tracing::warn!("some answers were not finished");
    }
}
