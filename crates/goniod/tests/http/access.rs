//! Who may use the daemon, and from where.

use crate::service::Service;

const VERBS: [&str; 6] = ["estop", "stop", "pause", "proceed", "acknowledge", "park"];

#[tokio::test(flavor = "multi_thread")]
async fn strangers_are_refused_and_change_nothing() {
    let service = Service::start().await;
    let host = service.address;
    // Each has a good token, as a browser would send it: that alone lets nobody in.
    let ours = format!("Host: {host}\r\n{}", service.bearer("operate"));
    for (what, head) in [
        ("no host", "POST /api/v1/estop HTTP/1.1\r\n".to_owned()),
        (
            "a name pointed at us",
            "POST /api/v1/estop HTTP/1.1\r\nHost: evil.example\r\n".to_owned(),
        ),
        (
            "two hosts",
            format!("POST /api/v1/estop HTTP/1.1\r\n{ours}Host: evil.example\r\n"),
        ),
        (
            "another target",
            format!("POST http://evil.example/api/v1/estop HTTP/1.1\r\n{ours}"),
        ),
        (
            "reading for another name",
            "GET /api/v1/rig HTTP/1.1\r\nHost: evil.example\r\n".to_owned(),
        ),
        (
            "another site",
            format!("POST /api/v1/estop HTTP/1.1\r\n{ours}Origin: http://evil.example\r\n"),
        ),
        (
            "another port",
            format!("POST /api/v1/estop HTTP/1.1\r\n{ours}Origin: http://127.0.0.1:1\r\n"),
        ),
        (
            "a local file",
            format!("POST /api/v1/estop HTTP/1.1\r\n{ours}Origin: null\r\n"),
        ),
        (
            "reading by another site",
            format!("GET /api/v1/rig HTTP/1.1\r\n{ours}Origin: http://evil.example\r\n"),
        ),
        (
            "what a browser says",
            format!("POST /api/v1/estop HTTP/1.1\r\n{ours}Sec-Fetch-Site: cross-site\r\n"),
        ),
    ] {
        let answer = service.raw(&head, b"").await;
        assert!(matches!(answer.status, 400 | 403), "{what}: {answer:?}");
        assert_eq!(answer.header("access-control-allow-origin"), None, "{what}");
    }
    let rig = service.get("/api/v1/rig").await.json();
    assert!(rig["fault"].is_null(), "{rig}");
    let metrics = service.get("/metrics").await;
    let metrics = String::from_utf8_lossy(&metrics.body);
    assert!(
        metrics.contains("goniod_http_refused_total{reason=\"site\"}"),
        "{metrics}"
    );
    let own = service
        .ask(
            "POST",
            "/api/v1/estop",
            &format!("Origin: http://{host}\r\nSec-Fetch-Site: same-origin\r\n"),
            "",
        )
        .await;
    assert_eq!(own.status, 204, "{own:?}");
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_changes_by_getting() {
    let service = Service::start().await;
    for verb in VERBS {
        let answer = service.get(&format!("/api/v1/{verb}")).await;
        answer.problem(405);
        assert_eq!(answer.header("allow"), Some("POST"), "{verb}");
    }
    assert!(service.get("/api/v1/rig").await.json()["fault"].is_null());
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_is_needed_and_says_what_its_bearer_may_do() {
    let service = Service::start().await;
    let (watch, operate) = (service.token("watch"), service.token("operate"));
    let bearer = |token: &str| format!("Authorization: Bearer {token}\r\n");
    let ask = async |method: &str, path: &str, headers: &str| {
        service.ask_as_stranger(method, path, headers, "").await
    };
    for wrong in [
        String::new(),
        bearer("x"),
        bearer(""),
        format!("Authorization: Basic {operate}\r\n"),
        bearer(&operate[1..]),
    ] {
        for (method, path) in [
            ("GET", "/api/v1/rig"),
            ("GET", "/metrics"),
            ("GET", "/api/v1/openapi.json"),
            ("POST", "/api/v1/estop"),
            ("GET", "/nowhere"),
        ] {
            let answer = ask(method, path, &wrong).await;
            assert!(answer.problem(401).contains("token"), "{method} {path}");
            assert!(
                answer
                    .header("www-authenticate")
                    .is_some_and(|how| how.starts_with("Bearer"))
            );
        }
    }
    // The page has nothing to hide, and must be there to sign in with.
    assert_eq!(ask("GET", "/", "").await.status, 200);
    assert_eq!(ask("GET", "/health", "").await.status, 200);
    let watcher = bearer(&watch);
    assert_eq!(ask("GET", "/api/v1/rig", &watcher).await.status, 200);
    for verb in VERBS {
        let answer = ask("POST", &format!("/api/v1/{verb}"), &watcher).await;
        assert!(answer.problem(403).contains("may watch"), "{verb}");
    }
    assert_eq!(ask("POST", "/api/v1/estop", &bearer(&operate)).await.status, 204);
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn signing_in_keeps_the_token_in_a_cookie_that_only_our_page_can_use() {
    let service = Service::start().await;
    let json = "Content-Type: application/json\r\n";
    let sign_in = |token: String| {
        let service = &service;
        async move {
            service
                .ask_as_stranger(
                    "POST",
                    "/api/v1/session",
                    json,
                    &format!("{{\"token\":\"{token}\"}}"),
                )
                .await
        }
    };
    sign_in("x".repeat(64)).await.problem(401);
    let answer = sign_in(service.token("operate")).await;
    assert_eq!(answer.status, 204);
    let cookie = answer.header("set-cookie").unwrap().to_owned();
    assert!(
        cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"),
        "{cookie}"
    );
    assert!(
        !cookie.contains("Path"),
        "it is for the API alone, wherever that is: {cookie}"
    );
    let cookie = format!("Cookie: other=1; {}\r\n", cookie.split(';').next().unwrap());
    let session = service
        .ask_as_stranger("GET", "/api/v1/session", &cookie, "")
        .await
        .json();
    assert_eq!(session["role"], "operate");
    assert!(
        service
            .ask_as_stranger("POST", "/api/v1/estop", &cookie, "")
            .await
            .problem(403)
            .contains("Origin")
    );
    let ours = format!("{cookie}Origin: http://{}\r\n", service.address);
    assert_eq!(
        service
            .ask_as_stranger("POST", "/api/v1/estop", &ours, "")
            .await
            .status,
        204
    );
    let out = service
        .ask_as_stranger("DELETE", "/api/v1/session", &ours, "")
        .await;
    assert!(out.header("set-cookie").unwrap().contains("Max-Age=0"));
    service.end().await;
}
