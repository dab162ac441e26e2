//! The history over HTTP: pages, search, the record, put away, delete, files made when somebody asks.

use std::path::PathBuf;

use serde_json::{Value, json};

use crate::service::Service;

const JSON: &str = "Content-Type: application/json\r\n";
const TOML: &str = "Content-Type: application/toml\r\n";

/// A short job of a specimen, with a record.
fn job(specimen: &str, tag: &str) -> String {
    format!(
        "[specimen]\nname = \"{specimen}\"\ntags = [\"{tag}\"]\nmaterial = \"acrylic\"\n[run]\nproject = \"P-17\"\n\
         [[plane]]\ntheta_r_deg = 60\nreadings = 6\n[arc]\nreadings = 4\n"
    )
}

/// Has a job measured, and returns its run.
async fn measured(service: &Service, job: &str) -> String {
    let mut watch = service.watch("").await;
    let answer = service.ask("POST", "/api/v1/jobs?name=a.toml", TOML, job).await;
    assert_eq!(answer.status, 201, "{answer:?}");
    let id = answer.json()["id"].as_str().unwrap().to_owned();
    watch
        .until(|event| event["job"]["id"] == id.as_str() && event["job"]["state"] == "awaiting_specimen")
        .await;
    service.post(&format!("/api/v1/jobs/{id}/ready")).await;
    let (_, done) = watch
        .until(|event| event["job"]["id"] == id.as_str() && event["job"]["state"] == "done")
        .await;
    done["job"]["run"].as_str().unwrap().to_owned()
}

fn ids(runs: &Value) -> Vec<&str> {
    let runs = runs.as_array().unwrap();
    runs.iter().map(|run| run["id"].as_str().unwrap()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_run_is_found_again_by_its_record_which_can_be_corrected() {
    let service = Service::start().await;
    let blue = measured(&service, &job("blue paint", "Reference")).await;
    let gold = measured(&service, &job("gold leaf", "metal")).await;
    let found = async |query: &str| {
        let answer = service.get(&format!("/api/v1/runs?{query}")).await;
        assert_eq!(answer.status, 200, "{query}: {answer:?}");
        answer.json()
    };
    assert_eq!(ids(&found("").await), [&gold, &blue]);
    for query in [
        "q=blu",
        "q=BLUE%20acryl",
        "tag=reference",
        "specimen=blue%20paint&state=done",
    ] {
        assert_eq!(ids(&found(query).await), [&blue], "{query}");
    }
    assert_eq!(ids(&found("project=P-17").await).len(), 2);
    for query in [
        "q=zzz",
        "tag=ref",
        "to=2001-01-01",
        "state=cancelled",
        "archived=true",
    ] {
        assert!(ids(&found(query).await).is_empty(), "{query}");
    }
    for (wrong, part) in [
        ("limit=0", "1 … 200"),
        ("before=9223372036854775808", "0 … 9223372036854775807"),
        ("limit=201", "1 … 200"),
        ("from=yesterday", "2026-12-01"),
        ("state=asleep", "unknown variant"),
    ] {
        let answer = service.get(&format!("/api/v1/runs?{wrong}")).await;
        let detail = answer.json()["detail"].as_str().unwrap().to_owned();
        assert!(
            [400, 422].contains(&answer.status) && detail.contains(part),
            "{wrong}: {detail}"
        );
    }

    let page = service.get("/api/v1/runs?limit=1&project=P-17").await;
    assert_eq!(ids(&page.json()), [&gold]);
    let link = page.header("link").unwrap();
    let next = link
        .strip_prefix("<?")
        .unwrap()
        .strip_suffix(">; rel=\"next\"")
        .unwrap();
    assert!(next.contains("project=P-17"), "{next}");
    assert_eq!(ids(&found(next).await), [&blue]);

    // Who measured is who submitted, where the job does not say.
    let run = service.get(&format!("/api/v1/runs/{blue}")).await.json();
    assert!(
        run["record"]["operator"]
            .as_str()
            .unwrap()
            .starts_with("operator at 127.0.0.1"),
        "{run}"
    );
    let edit = json!({ "specimen": "blue paint, second coat", "tags": ["checked"], "operator": "Meier" });
    let path = format!("/api/v1/runs/{blue}");
    let edited = service.ask("PATCH", &path, JSON, &edit.to_string()).await;
    assert_eq!(edited.status, 200, "{edited:?}");
    let edited = edited.json();
    assert_eq!(edited["record"]["material"], "acrylic", "what is not named stays");
    assert!(edited["record"]["edited"].is_string() && edited["record"]["edited_by"].is_string());
    assert_eq!(ids(&found("q=second&operator=Meier&tag=checked").await), [&blue]);
    assert!(ids(&found("tag=reference").await).is_empty());
    for wrong in [
        json!({ "tags": [""] }),
        json!({ "specimen": "two\nlines" }),
        json!({ "weight": 4 }),
    ] {
        service
            .ask("PATCH", &path, JSON, &wrong.to_string())
            .await
            .problem(422);
    }
    // What the job said stays in the files.
    let file = service.get(&format!("{path}/files/run.json")).await.json();
    assert_eq!(file["specimen"]["name"], "blue paint");
    assert_eq!(file["specimen"]["tags"], json!(["Reference"]));
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_run_takes_little_room_and_its_tables_are_made_when_somebody_asks() {
    const ROOM: u64 = 5_000_000;
    let service = Service::start().await;
    let run = measured(&service, &job("blue paint", "a")).await;
    let path = format!("/api/v1/runs/{run}");
    let directory = PathBuf::from(service.get(&path).await.json()["directory"].as_str().unwrap());
    let files = std::fs::read_dir(&directory).unwrap();
    let bytes: u64 = files.map(|file| file.unwrap().metadata().unwrap().len()).sum();
    let store = std::fs::metadata(service.data.path().join("goniod.db"))
        .unwrap()
        .len();
    assert!(bytes + store < ROOM, "{bytes} and {store} bytes");
    let files = service.get(&format!("{path}/files")).await.json();
    let listed = |name: &str| {
        let files = files.as_array().unwrap();
        files.iter().find(|file| file["name"] == name).unwrap().clone()
    };
    assert_eq!(listed("readings.csv")["made"], false);
    // As a whole run directory has them.
    let whole = tempfile::tempdir().unwrap();
    std::fs::copy(directory.join("journal"), whole.path().join("journal")).unwrap();
    let whole = report::RunDirectory::at(whole.path());
    report::reconstruct(&whole).unwrap();
    for name in ["brdf.binary", "brdf.uncertainty.binary"] {
        assert_eq!(listed(name)["made"], true);
        let file = service.get(&format!("{path}/files/{name}")).await;
        assert_eq!(file.status, 200);
        assert_eq!(
            file.body.len() as u64,
            listed(name)["bytes"].as_u64().unwrap(),
            "{name}"
        );
        assert!(std::fs::read(whole.file(name)).unwrap() == file.body, "{name}");
    }
    service
        .get(&format!("{path}/files/brdf.other"))
        .await
        .problem(404);
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_run_is_put_away_taken_back_and_deleted_with_its_files() {
    let service = Service::start().await;
    let run = measured(&service, &job("blue paint", "a")).await;
    let path = format!("/api/v1/runs/{run}");
    assert_eq!(service.post(&format!("{path}/archive")).await.status, 200);
    assert!(ids(&service.get("/api/v1/runs").await.json()).is_empty());
    assert_eq!(
        ids(&service.get("/api/v1/runs?archived=true").await.json()),
        [&run]
    );
    assert_eq!(service.post(&format!("{path}/unarchive")).await.status, 200);
    assert_eq!(ids(&service.get("/api/v1/runs").await.json()), [&run]);
    let directory = PathBuf::from(service.get(&path).await.json()["directory"].as_str().unwrap());
    assert!(directory.exists());
    assert_eq!(service.ask("DELETE", &path, "", "").await.status, 204);
    assert!(!directory.exists(), "its files are gone");
    service.get(&path).await.problem(404);
    service.ask("DELETE", &path, "", "").await.problem(404);
    assert!(ids(&service.get("/api/v1/runs?q=blue").await.json()).is_empty());
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_run_whose_job_may_go_on_is_neither_put_away_nor_deleted() {
    let service = Service::start().await;
    let mut watch = service.watch("").await;
    let long = job("blue paint", "a").replace("readings = 6", "readings = 2000");
    let answer = service.ask("POST", "/api/v1/jobs?name=a.toml", TOML, &long).await;
    let id = answer.json()["id"].as_str().unwrap().to_owned();
    watch
        .until(|event| event["job"]["state"] == "awaiting_specimen")
        .await;
    service.post(&format!("/api/v1/jobs/{id}/ready")).await;
    watch.until(|event| event["event"] == "reading").await;
    service.post("/api/v1/stop").await;
    let (_, stopped) = watch.until(|event| event["job"]["state"] == "interrupted").await;
    let path = format!("/api/v1/runs/{}", stopped["job"]["run"].as_str().unwrap());
    let detail = service.ask("DELETE", &path, "", "").await.problem(409);
    assert!(detail.contains("cancel it first"), "{detail}");
    service.post(&format!("{path}/archive")).await.problem(409);
    service.post(&format!("/api/v1/jobs/{id}/cancel")).await;
    assert_eq!(service.ask("DELETE", &path, "", "").await.status, 204);
    service.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_job_is_lost_behind_the_first_page() {
    let service = Service::start().await;
    for n in 0..7 {
        let id = service.submit().await;
        if n > 0 {
            assert_eq!(
                service.post(&format!("/api/v1/jobs/{id}/cancel")).await.status,
                200
            );
        }
    }
    let first = service.get("/api/v1/jobs?limit=4").await;
    assert_eq!(
        first.json().as_array().unwrap().len(),
        5,
        "four that are over, and the one that waits"
    );
    let mut seen = 5;
    let mut link = first.header("link").map(str::to_owned);
    while let Some(next) = link {
        let next = next
            .strip_prefix("<?")
            .unwrap()
            .strip_suffix(">; rel=\"next\"")
            .unwrap()
            .to_owned();
        let page = service.get(&format!("/api/v1/jobs?{next}")).await;
        seen += page.json().as_array().unwrap().len();
        link = page.header("link").map(str::to_owned);
    }
    assert_eq!(seen, 7);
    service.end().await;
}
