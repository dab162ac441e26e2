//! Listening elsewhere than on TCP.

use goniod::http::{Access, Address, Limits, Listener, serve};
use goniod::{Daemon, Settings};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::UnixStream;
use tokio::sync::oneshot;

#[tokio::test(flavor = "multi_thread")]
async fn a_unix_socket_serves_the_same_and_replaces_one_that_is_dead() {
    let data = tempfile::tempdir().unwrap();
    let path = data.path().join("goniod.sock");
    // What a killed daemon leaves behind.
    drop(std::os::unix::net::UnixListener::bind(&path).unwrap());
    let settings = Settings {
        rig: String::new(),
        rig_name: "test rig".to_owned(),
        data: data.path().to_owned(),
        clock: std::time::SystemTime::now,
    };
    let daemon = Daemon::open(settings).await.unwrap();
    let address: Address = format!("unix:{}", path.display()).parse().unwrap();
    let listener = Listener::bind(&address).await.unwrap();
    assert_eq!(listener.address().unwrap(), address);
    let limits = Limits::default();
    let access = Access::new(None, [], None, &limits);
    let (close, closed) = oneshot::channel::<()>();
    let server = tokio::spawn(serve(listener, access, limits, daemon.clone(), async {
        let _ = closed.await;
    }));
    let mut stream = UnixStream::connect(&path).await.unwrap();
    let request = "GET /health HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    assert!(
        Listener::bind(&address).await.is_err(),
        "one that lives is not replaced"
    );
    daemon.shutdown().await;
    drop(close);
    server.await.unwrap().unwrap();
}
