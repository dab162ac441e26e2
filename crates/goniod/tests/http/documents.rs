//! What the daemon says of itself.

use std::collections::BTreeSet;
use std::path::Path;

use crate::service::{JOB, Service};

/// Set to write the committed document anew.
const WRITE: &str = "GONIOD_WRITE_OPENAPI";

#[test]
fn the_committed_openapi_document_is_that_of_the_code() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi.json");
    let document = serde_json::to_string_pretty(&goniod::http::openapi()).unwrap() + "\n";
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, &document).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let differs = document.lines().zip(committed.lines()).position(|(a, b)| a != b);
    assert!(
        document == committed,
        "crates/goniod/openapi.json is not what the code serves, from line {}. If clients can live with the change, \
         run\n\n    {WRITE}=1 cargo test -p goniod --test http openapi\n\nand commit the file.",
        differs.map_or(committed.lines().count(), |line| line) + 1
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn the_served_document_is_the_committed_one() {
    let service = Service::start().await;
    let served = service.get("/api/v1/openapi.json").await;
    assert_eq!(
        served.json(),
        serde_json::to_value(goniod::http::openapi()).unwrap()
    );
    service.end().await;
}

/// A job file in JSON is described by hand; what it may hold is what the parser says that it expects.
#[test]
fn the_document_knows_every_key_and_word_of_a_job_file() {
    /// A table of the document, and a job file with something unknown in that table.
    const UNKNOWN: [(&str, &str); 8] = [
        ("JobFile", "unknown = 1"),
        ("SpecimenTable", "[specimen]\nunknown = 1"),
        ("RunTable", "[run]\nunknown = 1"),
        ("PlaneTable", "[[plane]]\nunknown = 1"),
        ("ArcTable", "[arc]\nunknown = 1"),
        ("ReconstructionTable", "[reconstruction]\nunknown = 1"),
        ("SceneTable", "[scene]\nunknown = 1"),
        ("SweepTable", "[sweep]\nunknown = 1"),
    ];
    const UNKNOWN_WORD: [(&str, &str); 4] = [
        (
            "DistributionName",
            "[[plane]]\ntheta_r_deg = 1\nreadings = 1\ndistribution = \"unknown\"",
        ),
        ("ModelName", "[reconstruction]\nmodel = \"unknown\""),
        ("ModeName", "[sweep]\nmode = \"unknown\""),
        ("ChannelName", "[scene]\nchannels = [\"unknown\"]"),
    ];
    let document = serde_json::to_value(goniod::http::openapi()).unwrap();
    let schemas = &document["components"]["schemas"];
    for (table, job) in UNKNOWN {
        let known = schemas[table]["properties"].as_object().unwrap();
        assert_eq!(expected(job), known.keys().cloned().collect(), "{table}");
    }
    for (name, job) in UNKNOWN_WORD {
        let known = schemas[name]["enum"].as_array().unwrap();
        let known = known.iter().map(|word| word.as_str().unwrap().to_owned());
        assert_eq!(expected(job), known.collect(), "{name}");
    }
}

/// The words in backticks that the refusal of a job file says were expected.
fn expected(job: &str) -> BTreeSet<String> {
    let refusal = sweep::Job::parse(job, "job").unwrap_err().to_string();
    let (_, list) = refusal
        .split_once("expected")
        .unwrap_or_else(|| panic!("{refusal}"));
    list.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn errors_are_problem_documents_that_say_what_is_allowed() {
    let service = Service::start().await;
    let toml = "Content-Type: application/toml\r\n";
    let json = "Content-Type: application/json\r\n";
    service.get("/nowhere").await.problem(404);
    service
        .get("/api/v1/jobs/01KAGN4Z7Q3X9V5T8R2M6C1D0B")
        .await
        .problem(404);
    service.get("/api/v1/jobs/no-id").await.problem(404);
    service.get("/api/v1/runs/no-id").await.problem(404);
    service.ask("PUT", "/api/v1/rig", "", "").await.problem(405);
    service
        .ask("POST", "/api/v1/jobs", "Content-Type: text/plain\r\n", JOB)
        .await
        .problem(415);
    let wrong = service
        .ask(
            "POST",
            "/api/v1/jobs?name=a.toml",
            toml,
            "[[plane]]\ntheta_r_deg = 99\nreadings = 1\n",
        )
        .await;
    let detail = wrong.problem(422);
    for part in ["a.toml", "theta_r_deg", "0 … 85"] {
        assert!(detail.contains(part), "{detail}");
    }
    service
        .ask("POST", "/api/v1/jobs", json, "{\"plane\": null}")
        .await
        .problem(422);
    service
        .ask("POST", "/api/v1/jobs", json, "not json")
        .await
        .problem(422);
    let far = service
        .ask(
            "POST",
            "/api/v1/jog",
            json,
            "{\"arm\":\"light\",\"angle_deg\":90}",
        )
        .await;
    assert!(far.problem(422).contains("-88.000° … 88.000°"), "{far:?}");
    service
        .ask("POST", "/api/v1/jog", json, "{\"arm\":\"third\",\"angle_deg\":0}")
        .await
        .problem(422);
    service.post("/api/v1/pause").await.problem(409);
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_page_may_use_this_daemon_alone() {
    let service = Service::start().await;
    let page = service.get("/").await;
    let policy = page.header("content-security-policy").unwrap();
    assert!(
        policy.contains("default-src 'none'") && policy.contains("frame-ancestors 'none'"),
        "{policy}"
    );
    let text = String::from_utf8(page.body).unwrap();
    for reference in text.split(['"', '\'']).filter(|part| part.starts_with("assets/")) {
        let reference = &format!("/{reference}");
        let asset = service.get(reference).await;
        assert_eq!(asset.status, 200, "{reference}");
        assert_eq!(asset.header("x-content-type-options"), Some("nosniff"));
        let known = format!("If-None-Match: {}\r\n", asset.header("etag").unwrap());
        assert_eq!(service.ask("GET", reference, &known, "").await.status, 304);
    }
    assert!(!text.contains("http"), "nothing comes from elsewhere");
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_query_key_that_an_operation_does_not_take_is_refused_everywhere() {
    let service = Service::start().await;
    let document = serde_json::to_value(goniod::http::openapi()).unwrap();
    let mut tried = 0;
    for (path, item) in document["paths"].as_object().unwrap() {
        let address = path.replace("{id}", "01KAGN4Z7Q3X9V5T8R2M6C1D0B");
        let address = address.replace("{action}", "ready").replace("{name}", "run.json");
        for method in item.as_object().unwrap().keys() {
            let method = method.to_uppercase();
            let answer = service.ask(&method, &format!("{address}?limitt=5"), "", "").await;
            let detail = answer.problem(400);
            assert!(detail.contains("\"limitt\""), "{method} {address}: {detail}");
            tried += 1;
        }
    }
    assert!(tried > 20, "{tried}");
    let detail = service.get("/api/v1/log?limitt=5").await.problem(400);
    assert!(detail.contains("takes limit"), "{detail}");
    for wrong in [
        "/api/v1/log?limit=0",
        "/api/v1/log?limit=101",
        "/api/v1/log?limit=many",
        "/api/v1/events?after=-1",
    ] {
        let detail = service.get(wrong).await.problem(400);
        assert!(
            detail.contains("limit") || detail.contains("after"),
            "{wrong}: {detail}"
        );
    }
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn whoever_comes_later_is_told_what_happened_and_what_to_do() {
    let service = Service::start().await;
    let mut watch = service.watch("").await;
    let id = service.submit().await;
    assert_eq!(service.post("/api/v1/estop").await.status, 204);
    watch.until(|event| event["event"] == "fault").await;
    let log = service.get("/api/v1/log").await.json();
    let log = log.as_array().unwrap();
    assert!(
        log.iter().any(|event| event["job"]["id"] == id.as_str()),
        "{log:?}"
    );
    let fault = &log.iter().find(|event| event["event"] == "fault").unwrap()["fault"];
    let remedy = fault["remedy"].as_str().unwrap();
    assert!(remedy.starts_with("Find out why"), "{remedy}");
    assert_eq!(service.get("/api/v1/rig").await.json()["fault"]["remedy"], remedy);
    assert!(log.is_sorted_by_key(|event| event["id"].as_u64().unwrap()));
    let one = service.get("/api/v1/log?limit=1").await.json();
    assert_eq!(one.as_array().unwrap().len(), 1);
    service.end().await;
}
