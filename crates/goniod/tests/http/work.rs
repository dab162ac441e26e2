//! Jobs, runs and events.

use crate::service::{JOB, Service};

const TOML: &str = "Content-Type: application/toml\r\n";

#[tokio::test(flavor = "multi_thread")]
async fn a_job_goes_from_the_queue_to_its_report() {
    let service = Service::start().await;
    let mut watch = service.watch("").await;
    let plan = service.ask("POST", "/api/v1/plan", TOML, JOB).await.json();
    let planned = plan["readings"].as_u64().unwrap();
    let id = service.submit().await;
    let waiting = |state: &'static str| move |event: &serde_json::Value| event["job"]["state"] == state;
    watch.until(waiting("awaiting_specimen")).await;
    let answer = service.post(&format!("/api/v1/jobs/{id}/ready")).await;
    assert_eq!(answer.status, 200, "{answer:?}");
    watch.until(|event| event["event"] == "reading").await;
    let (_, done) = watch.until(waiting("done")).await;
    let run = done["job"]["run"].as_str().unwrap();

    let runs = service.get("/api/v1/runs").await.json();
    assert_eq!(runs[0]["id"], run);
    assert_eq!(runs[0]["accepted"], planned);
    let readings = service.get(&format!("/api/v1/runs/{run}/readings")).await.json();
    assert!(
        readings
            .as_array()
            .unwrap()
            .iter()
            .any(|reading| reading["f"].is_array())
    );

    let files = service.get(&format!("/api/v1/runs/{run}/files")).await.json();
    let names: Vec<&str> = files
        .as_array()
        .unwrap()
        .iter()
        .map(|file| file["name"].as_str().unwrap())
        .collect();
    for name in ["brdf.binary", "journal", "readings.csv", "report.html"] {
        assert!(names.contains(&name), "{name}: {names:?}");
    }
    let at = format!("/api/v1/runs/{run}/files");
    let report = service.get(&format!("{at}/report.html")).await;
    let policy = report.header("content-security-policy").unwrap();
    assert!(
        policy.starts_with("sandbox allow-same-origin;") && !policy.contains("allow-scripts"),
        "{policy}"
    );
    let part = service
        .ask("GET", &format!("{at}/brdf.binary"), "Range: bytes=0-11\r\n", "")
        .await;
    assert_eq!((part.status, part.body.len()), (206, 12));
    assert_eq!(
        part.body,
        [90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0],
        "the head of a MERL file"
    );
    let saved = part.header("content-disposition").unwrap();
    let day = humantime::format_rfc3339_seconds(std::time::SystemTime::now()).to_string();
    assert!(saved.starts_with("attachment; filename=\"test_20"), "{saved}");
    // The day may have changed since the run began.
    assert!(
        saved.contains(&day[..7]) && saved.ends_with("_brdf.binary\""),
        "{saved}"
    );
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_job_comes_in_toml_or_json() {
    let service = Service::start().await;
    let json =
        r#"{"specimen": "test", "plane": [{"theta_r_deg": 60, "readings": 6}], "arc": {"readings": 4}}"#;
    let by_json = service
        .ask("POST", "/api/v1/plan", "Content-Type: application/json\r\n", json)
        .await;
    let by_toml = service.ask("POST", "/api/v1/plan", TOML, JOB).await;
    assert_eq!(by_json.status, 200, "{by_json:?}");
    assert_eq!(by_json.json(), by_toml.json());
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_path_leads_out_of_a_run_directory() {
    let service = Service::start().await;
    let mut watch = service.watch("").await;
    let id = service.submit().await;
    watch
        .until(|event| event["job"]["state"] == "awaiting_specimen")
        .await;
    service.post(&format!("/api/v1/jobs/{id}/ready")).await;
    let (_, done) = watch.until(|event| event["job"]["state"] == "done").await;
    let run = done["job"]["run"].as_str().unwrap();
    let directory = service.get(&format!("/api/v1/runs/{run}")).await.json();
    let directory = std::path::PathBuf::from(directory["directory"].as_str().unwrap());
    std::os::unix::fs::symlink("/etc/passwd", directory.join("passwd")).unwrap();
    std::fs::write(directory.join(".hidden"), "x").unwrap();
    for name in [
        "..%2Fgoniod.db",
        "..%2f..%2f..%2fetc%2fpasswd",
        "%2Fetc%2Fpasswd",
        "../goniod.db",
        "..",
        "%2e%2e",
        "passwd",
        ".hidden",
        "report.html%00",
        "..%5Cgoniod.db",
        "report.html/",
        "",
        "nothing",
    ] {
        let answer = service.get(&format!("/api/v1/runs/{run}/files/{name}")).await;
        answer.problem(404);
    }
    for run in ["..", "%2e%2e", "..%2f", "%2Fetc"] {
        service
            .get(&format!("/api/v1/runs/{run}/files/goniod.db"))
            .await
            .problem(404);
    }
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_goes_on_where_it_was_cut() {
    let service = Service::start().await;
    let mut watch = service.watch("").await;
    service.submit().await;
    let (first, _) = watch.until(|event| event["event"] == "job").await;
    drop(watch);
    service.post("/api/v1/estop").await;
    let mut watch = service.watch(&format!("Last-Event-ID: {first}\r\n")).await;
    let (next, event) = watch.next().await.unwrap();
    assert_eq!(next, first + 1, "nothing in between is lost");
    // A stop does not wait for what the queue has to say of the job.
    if event["event"] != "fault" {
        watch.until(|event| event["event"] == "fault").await;
    }
    let mut watch = service.watch("Last-Event-ID: 1\r\n").await;
    let (_, event) = watch.next().await.unwrap();
    assert_eq!(event["event"], "gap", "what is no longer known is told");
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_emergency_stop_holds_until_it_is_acknowledged() {
    let service = Service::start().await;
    let mut watch = service.watch("").await;
    assert_eq!(service.post("/api/v1/estop").await.status, 204);
    watch.until(|event| event["event"] == "fault").await;
    let latched = service.get("/api/v1/rig").await.json()["fault"].clone();
    assert_eq!(latched["code"], "estop");
    let json = "Content-Type: application/json\r\n";
    let jog = |deg: f64| format!("{{\"arm\":\"light\",\"angle_deg\":{deg}}}");
    service
        .ask("POST", "/api/v1/jog", json, &jog(-40.0))
        .await
        .problem(409);
    // Somebody presses again before the one who looked acknowledges what was looked at.
    assert_eq!(service.post("/api/v1/estop").await.status, 204);
    let acknowledge = |id: &str| format!("{{\"fault\":\"{id}\"}}");
    let old = acknowledge(latched["id"].as_str().unwrap());
    let refused = service.ask("POST", "/api/v1/acknowledge", json, &old).await;
    refused.problem(409);
    let newer = refused.json()["fault"]["id"].as_str().unwrap().to_owned();
    assert_eq!(
        service.get("/api/v1/rig").await.json()["fault"]["id"],
        newer.as_str()
    );
    for (body, status) in [
        ("", 422),
        ("{}", 422),
        ("{\"fault\":1}", 422),
        ("{\"fault\":\"\"}", 409),
    ] {
        let refused = service.ask("POST", "/api/v1/acknowledge", json, body).await;
        assert_eq!(refused.status, status, "{body:?}");
    }
    let new = acknowledge(&newer);
    assert_eq!(
        service
            .ask("POST", "/api/v1/acknowledge", json, &new)
            .await
            .status,
        204
    );
    assert_eq!(
        service.ask("POST", "/api/v1/jog", json, &jog(-40.0)).await.status,
        204
    );
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_are_listed_in_the_order_in_which_they_are_worked_off() {
    let service = Service::start().await;
    let mut submitted = Vec::new();
    for _ in 0..5 {
        submitted.push(service.submit().await);
    }
    // Some are over, and neither the first nor the last alone.
    for over in [1, 3] {
        let answer = service
            .post(&format!("/api/v1/jobs/{}/cancel", submitted[over]))
            .await;
        assert_eq!(answer.status, 200, "{answer:?}");
    }
    let jobs = service.get("/api/v1/jobs").await.json();
    let jobs = jobs.as_array().unwrap();
    let ids: Vec<_> = jobs.iter().map(|job| job["id"].as_str().unwrap()).collect();
    assert_eq!(ids, submitted);
    assert!(jobs.is_sorted_by_key(|job| job["place"].as_u64().unwrap()));
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_curl_does_to_a_job_file_is_told() {
    let service = Service::start().await;
    let unbroken: String = JOB.lines().collect();
    let commented: String = format!("# A job\n{JOB}").lines().collect();
    for (body, headers) in [
        (unbroken.as_str(), TOML),
        (&commented, TOML),
        (JOB, "Content-Type: application/x-www-form-urlencoded\r\n"),
    ] {
        for path in ["/api/v1/jobs", "/api/v1/plan"] {
            let answer = service.ask("POST", path, headers, body).await;
            assert!([415, 422].contains(&answer.status), "{answer:?}");
            let detail = answer.json()["detail"].as_str().unwrap().to_owned();
            assert!(detail.contains("--data-binary"), "{detail}");
        }
    }
    // One line that is a job file is one.
    let one_line = "plane = [{ theta_r_deg = 60, readings = 6 }]";
    let answer = service.ask("POST", "/api/v1/plan", TOML, one_line).await;
    assert_eq!(answer.status, 200, "{answer:?}");
    let latin1 = "# caf\u{e9}".chars().map(|c| c as u8).collect::<Vec<_>>();
    let head = format!(
        "POST /api/v1/plan HTTP/1.1\r\nHost: localhost\r\n{}{TOML}Content-Length: {}\r\n",
        service.bearer("operate"),
        latin1.len()
    );
    let answer = service.raw(&head, &latin1).await;
    assert!(
        answer.json()["detail"].as_str().unwrap().contains("Latin-1"),
        "{answer:?}"
    );
    service.end().await;
}
