//! The result of a run in other formats.

use crate::service::Service;

#[tokio::test(flavor = "multi_thread")]
async fn the_result_of_a_run_comes_in_each_format_and_in_all_at_once() {
    let service = Service::start().await;
    let mut watch = service.watch("").await;
    let id = service.submit().await;
    watch
        .until(|event| event["job"]["state"] == "awaiting_specimen")
        .await;
    service.post(&format!("/api/v1/jobs/{id}/ready")).await;
    let (_, done) = watch.until(|event| event["job"]["state"] == "done").await;
    let run = done["job"]["run"].as_str().unwrap();

    let at = format!("/api/v1/runs/{run}/exports");
    let listed = service.get(&at).await.json();
    let names: Vec<&str> = listed
        .as_array()
        .unwrap()
        .iter()
        .map(|one| one["format"].as_str().unwrap())
        .collect();
    assert_eq!(names.len(), formats::FORMATS.len() + 1);
    assert_eq!(names.last(), Some(&"all"));

    let file = service.get(&format!("{at}/ssdd")).await;
    assert_eq!(file.status, 200, "{file:?}");
    let disposition = file.header("content-disposition").unwrap();
    assert!(
        disposition.starts_with("attachment; filename=\"test-20") && disposition.ends_with("-ssdd.ssdd\""),
        "{disposition}"
    );
    let format = formats::recognise(&file.body).unwrap();
    assert_eq!(format.name, "ssdd");
    assert!((format.read)(&file.body).is_ok());

    for missing in [
        format!("{at}/jpeg"),
        "/api/v1/runs/01/exports/ssdd".to_owned(),
        "/api/v1/runs/01/exports".to_owned(),
    ] {
        assert_eq!(service.get(&missing).await.status, 404, "{missing}");
    }

    // HTTP/1.0 has no chunks.
    let head = format!(
        "GET {at}/all HTTP/1.0\r\nHost: {}\r\n{}",
        service.address,
        service.bearer("watch")
    );
    let archive = service.raw(&head, b"").await;
    assert_eq!(archive.status, 200, "{archive:?}");
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(archive.body)).unwrap();
    let names: Vec<String> = archive
        .file_names()
        .map(|name| name.unwrap().into_owned())
        .collect();
    for ending in [
        "-readings.csv",
        "-merl.binary",
        "-rgl-rgb.bsdf",
        "-gltf.gltf",
        "formats.txt",
    ] {
        assert!(
            names.iter().any(|name| name.ends_with(ending)),
            "{ending}: {names:?}"
        );
    }
    let mut figures = String::new();
    std::io::Read::read_to_string(&mut archive.by_name("formats.txt").unwrap(), &mut figures).unwrap();
    for format in &formats::FORMATS {
        let line = figures
            .lines()
            .find(|line| line.starts_with(&format!("{}: ", format.name)));
        assert!(
            line.is_some_and(|line| line.contains("MALE")),
            "{}: {figures}",
            format.name
        );
    }
    service.end().await;
}
