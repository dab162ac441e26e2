//! Behind a relay on the same computer, as a TLS proxy is one: everybody comes from a loopback address.

use std::net::SocketAddr;

use tokio::io::{AsyncReadExt, AsyncWriteExt, copy_bidirectional};
use tokio::net::{TcpListener, TcpStream};

use crate::service::Service;

/// Passes each connection on to an address, with what it adds to the head of the first request.
async fn relay(to: SocketAddr, adds: &'static str) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move {
        while let Ok((mut client, _)) = listener.accept().await {
            tokio::spawn(async move {
                let mut daemon = TcpStream::connect(to).await.unwrap();
                let mut line = Vec::new();
                while !line.ends_with(b"\r\n") {
                    line.push(client.read_u8().await.unwrap());
                }
                daemon.write_all(&line).await.unwrap();
                daemon.write_all(adds.as_bytes()).await.unwrap();
                // Either side may close first.
                let _ = copy_bidirectional(&mut client, &mut daemon).await;
            });
        }
    });
    address
}

/// The status with which a request through a relay is answered.
async fn ask(relay: SocketAddr, host: SocketAddr, method: &str, path: &str, headers: &str) -> u16 {
    let mut stream = TcpStream::connect(relay).await.unwrap();
    let request = format!(
        "{method} {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: 0\r\n{headers}Connection: close\r\n\r\n"
    );
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    answer.split(' ').nth(1).unwrap().parse().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_gets_in_through_a_relay_on_this_computer_without_a_token() {
    let service = Service::start().await;
    for adds in [
        "",
        "X-Forwarded-For: 192.0.2.1\r\nX-Forwarded-Proto: https\r\n",
        // Nothing that a relay claims makes anybody trusted.
        "X-Forwarded-For: 127.0.0.1\r\nForwarded: for=127.0.0.1;host=localhost\r\nX-Real-IP: 127.0.0.1\r\n",
    ] {
        let relay = relay(service.address, adds).await;
        for (method, path) in [
            ("GET", "/api/v1/rig"),
            ("GET", "/api/v1/jobs"),
            ("GET", "/api/v1/events"),
            ("GET", "/metrics"),
            ("POST", "/api/v1/estop"),
            ("POST", "/api/v1/acknowledge"),
            ("POST", "/api/v1/park"),
        ] {
            assert_eq!(
                ask(relay, service.address, method, path, "").await,
                401,
                "{adds}{method} {path}"
            );
        }
        let bearer = service.bearer("operate");
        assert_eq!(
            ask(relay, service.address, "GET", "/api/v1/rig", &bearer).await,
            200,
            "{adds}"
        );
        assert_eq!(
            ask(relay, service.address, "GET", "/health", "").await,
            200,
            "{adds}"
        );
    }
    assert!(service.get("/api/v1/rig").await.json()["fault"].is_null());
    service.end().await;
}
