//! Whoever wants to stop the rig gets in, whatever other clients do with their connections.

use goniod::Daemon;
use goniod::http::{Access, Address, Limits, Listener, Tokens, serve};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::{TcpStream, UnixStream};
use tokio::sync::oneshot;

use crate::service::{Service, settings, token};

/// What a client does with its connection that does no good.
#[derive(Clone, Copy, Debug)]
enum Nuisance {
    SaysNothing,
    SendsHalfAHead,
    SendsHalfABody,
    NeverReads,
    NeverReadsManyAnswers,
    NeverReadsEvents,
    KeepsItsConnectionIdle,
    SendsAByteAtATime,
    ClosesItsSide,
}

use Nuisance::*;

const NUISANCES: [Nuisance; 9] = [
    SaysNothing,
    SendsHalfAHead,
    SendsHalfABody,
    NeverReads,
    NeverReadsManyAnswers,
    NeverReadsEvents,
    KeepsItsConnectionIdle,
    SendsAByteAtATime,
    ClosesItsSide,
];

const FEW: Limits = Limits {
    connections: 16,
    streams: 4,
    ..Limits::DEFAULT
};

impl Nuisance {
    /// Does it once more. A connection that the daemon has closed is one nuisance less.
    async fn act(self, mut stream: impl AsyncRead + AsyncWrite + Unpin, token: &str) {
        let authorization = format!("Host: localhost\r\nAuthorization: Bearer {token}\r\n");
        let get = |path: &str| format!("GET {path} HTTP/1.1\r\n{authorization}\r\n");
        let bytes = match self {
            SaysNothing => String::new(),
            SendsHalfAHead => format!("GET / HTTP/1.1\r\n{authorization}"),
            SendsHalfABody => format!(
                "POST /api/v1/jobs HTTP/1.1\r\n{authorization}Content-Type: application/toml\r\nContent-Length: 1000\r\n\r\n#"
            ),
            NeverReads => "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n".to_owned(),
            // Far more than fits between the two.
            NeverReadsManyAnswers => "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(500),
            NeverReadsEvents => get("/api/v1/events"),
            KeepsItsConnectionIdle => get("/health"),
            SendsAByteAtATime => "G".to_owned(),
            ClosesItsSide => get("/health"),
        };
        if stream.write_all(bytes.as_bytes()).await.is_err() {
            return;
        }
        match self {
            KeepsItsConnectionIdle => {
                let _ = stream.read(&mut [0; 4096]).await;
            }
            ClosesItsSide => {
                let _ = stream.shutdown().await;
            }
            _ => {}
        }
    }
}

/// Answer to an emergency stop on a connection of its own.
async fn estop(mut stream: impl AsyncRead + AsyncWrite + Unpin, token: &str) -> String {
    let request = format!(
        "POST /api/v1/estop HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\nContent-Length: 0\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = vec![0; 1024];
    let read = stream.read(&mut answer).await.unwrap();
    String::from_utf8_lossy(&answer[..read]).into_owned()
}

/// Opens useless connections of each kind, far more than there are slots, and stops the rig over new ones meanwhile.
async fn stops_get_through<S>(connect: impl AsyncFn() -> S, token: &str)
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    for nuisance in NUISANCES {
        let mut open = Vec::new();
        for _ in 0..3 * FEW.connections {
            let mut stream = connect().await;
            nuisance.act(&mut stream, token).await;
            open.push(stream);
        }
        for _ in 0..10 {
            let answer = estop(connect().await, token).await;
            assert!(answer.starts_with("HTTP/1.1 204"), "{nuisance:?}: {answer:?}");
            for stream in &mut open {
                if matches!(nuisance, SendsAByteAtATime) {
                    nuisance.act(stream, token).await;
                }
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_is_answered_while_useless_connections_take_all_slots() {
    let service = Service::with(FEW).await;
    let token = service.token("operate");
    stops_get_through(
        async || TcpStream::connect(service.address).await.unwrap(),
        &token,
    )
    .await;
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_over_a_unix_socket_is_answered_while_useless_connections_take_all_slots() {
    let data = tempfile::tempdir().unwrap();
    let path = data.path().join("goniod.sock");
    let daemon = Daemon::open(settings(data.path())).await.unwrap();
    let address: Address = format!("unix:{}", path.display()).parse().unwrap();
    let listener = Listener::bind(&address).await.unwrap();
    let tokens = data.path().join("tokens.toml");
    let access = Access::new(None, [], Some(Tokens::open(&tokens).unwrap()), &FEW);
    let token = token(data.path(), "operate");
    let (close, closed) = oneshot::channel::<()>();
    let server = tokio::spawn(serve(listener, access, FEW, daemon.clone(), async {
        let _ = closed.await;
    }));
    stops_get_through(async || UnixStream::connect(&path).await.unwrap(), &token).await;
    daemon.shutdown().await;
    drop(close);
    server.await.unwrap().unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stop_is_answered_while_520_sockets_have_asked_for_the_page_and_never_read() {
    // Both ends are in this process.
    let files = rustix::process::getrlimit(rustix::process::Resource::Nofile);
    rustix::process::setrlimit(
        rustix::process::Resource::Nofile,
        rustix::process::Rlimit {
            current: files.maximum,
            ..files
        },
    )
    .unwrap();
    let service = Service::with(Limits::DEFAULT).await;
    let token = service.token("operate");
    let mut open = Vec::new();
    for _ in 0..520 {
        let mut stream = TcpStream::connect(service.address).await.unwrap();
        NeverReads.act(&mut stream, "").await;
        open.push(stream);
    }
    for _ in 0..20 {
        let stream = TcpStream::connect(service.address).await.unwrap();
        let answer = estop(stream, &token).await;
        assert!(answer.starts_with("HTTP/1.1 204"), "{answer:?}");
    }
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_of_events_that_is_read_outlives_useless_connections() {
    let service = Service::with(FEW).await;
    let token = service.token("operate");
    let mut watch = service.watch("").await;
    for nuisance in NUISANCES {
        // These would take the streams instead.
        if matches!(nuisance, NeverReadsEvents) {
            continue;
        }
        let mut open = Vec::new();
        for _ in 0..3 * FEW.connections {
            let mut stream = TcpStream::connect(service.address).await.unwrap();
            nuisance.act(&mut stream, &token).await;
            open.push(stream);
        }
    }
    service.post("/api/v1/estop").await;
    while watch.next().await.expect("the stream goes on").1["event"] != "fault" {}
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_never_reads_is_given_up() {
    let limits = Limits {
        idle: std::time::Duration::from_millis(50),
        ..Limits::DEFAULT
    };
    let service = Service::with(limits).await;
    let mut stream = TcpStream::connect(service.address).await.unwrap();
    let request = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";
    // Goes on until the daemon has closed the connection.
    while stream.write_all(request.as_bytes()).await.is_ok() {}
    service.end().await;
}
