//! How much the daemon takes on.

use std::num::NonZeroU32;

use goniod::http::Limits;
use tokio::net::TcpStream;

use crate::service::Service;

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_is_too_large_is_refused_before_it_is_read() {
    let service = Service::start().await;
    for path in [
        "/api/v1/jobs",
        "/api/v1/plan",
        "/api/v1/jog",
        "/api/v1/acknowledge",
    ] {
        let head = format!(
            "POST {path} HTTP/1.1\r\nHost: {}\r\n{}Content-Type: application/toml\r\nContent-Length: 104857600\r\n",
            service.address,
            service.bearer("operate")
        );
        service.raw(&head, b"").await.problem(413);
    }
    // One that does not say how long it is, is cut off where it becomes too long.
    let head = format!(
        "POST /api/v1/jobs HTTP/1.1\r\nHost: {}\r\n{}Content-Type: application/toml\r\nTransfer-Encoding: chunked\r\n",
        service.address,
        service.bearer("operate")
    );
    let chunk = format!("40000\r\n{}\r\n", "#".repeat(0x40000));
    service
        .raw(&head, format!("{chunk}{chunk}0\r\n\r\n").as_bytes())
        .await
        .problem(413);
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn stopping_is_never_held_up_by_the_request_rate() {
    let limits = Limits {
        requests_per_s: NonZeroU32::MIN,
        ..Limits::default()
    };
    let service = Service::with(limits).await;
    let mut held_up = 0;
    for _ in 0..3 {
        let answer = service.get("/api/v1/rig").await;
        if answer.status == 429 {
            assert_eq!(answer.header("retry-after"), Some("1"));
            answer.problem(429);
            held_up += 1;
        }
    }
    assert!(held_up > 0);
    for _ in 0..20 {
        assert_eq!(service.post("/api/v1/estop").await.status, 204);
    }
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn only_so_many_streams_are_open_and_a_closed_one_makes_room() {
    let limits = Limits {
        streams: 2,
        ..Limits::default()
    };
    let service = Service::with(limits).await;
    let first = service.watch("").await;
    let second = service.watch("").await;
    assert_eq!((first.status, second.status), (200, 200));
    assert_eq!(service.watch("").await.status, 503);
    drop(first);
    // The daemon notices with the next thing that it has to say.
    service.post("/api/v1/estop").await;
    while service.watch("").await.status != 200 {
        tokio::task::yield_now().await;
    }
    drop(second);
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_end_with_the_daemon() {
    let service = Service::start().await;
    let mut watch = service.watch("").await;
    service.end().await;
    while watch.next().await.is_some() {}
}

/// Resident memory of this process, bytes (proc(5), statm), for pages of at least 4096.
fn resident() -> usize {
    let statm = std::fs::read_to_string("/proc/self/statm").unwrap();
    let pages: usize = statm.split(' ').nth(1).unwrap().parse().unwrap();
    pages * 4096
}

#[tokio::test(flavor = "multi_thread")]
async fn a_connection_costs_little_memory() {
    let service = Service::start().await;
    assert_eq!(service.get("/health").await.status, 200);
    let before = resident();
    let mut open = Vec::new();
    for _ in 0..300 {
        open.push(TcpStream::connect(service.address).await.unwrap());
    }
    // They are accepted in turn, so those are by now.
    assert_eq!(service.get("/health").await.status, 200);
    let each = resident().saturating_sub(before) / open.len();
    // Far more than one needs, because other tests run in this process too.
    assert!(each < 400_000, "{each} bytes for each connection");
    service.end().await;
}
