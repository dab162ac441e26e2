//! A run in every file format, and files of one format in another.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tests::run;

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");
const JOB: &str = "specimen = \"gold paint\"\non_stage = true\n[[plane]]\ntheta_r_deg = 60.0\nreadings = 24\n[arc]\nreadings = 16\n\
    [reconstruction]\nmodel = \"reciprocal\"\n";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// A run of one plane and an arc with a reciprocal model.
fn captured(here: &Path) -> PathBuf {
    captured_with(here, "", "")
}

/// The same with more in the job file and in the rig file.
fn captured_with(here: &Path, job: &str, rig: &str) -> PathBuf {
    let job = format!("{job}{JOB}");
    fs::write(here.join("job.toml"), job).unwrap();
    fs::write(here.join("rig.toml"), rig).unwrap();
    let finished = run(GONIOCTL, here, &["run", "job.toml", "--rig", "rig.toml"]).expect(0);
    here.join(finished.stdout.trim())
}

#[test]
fn a_run_comes_in_every_format_from_its_journal_alone() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let directory = captured(here);
    let kept = fs::read(directory.join("brdf.binary")).unwrap();
    for entry in fs::read_dir(&directory).unwrap() {
        let path = entry.unwrap().path();
        if path.file_name().unwrap() != "journal" {
            fs::remove_file(path).unwrap();
        }
    }
    let directory = directory.to_str().unwrap();
    let list = run(GONIOCTL, here, &["export", "--format", "list"])
        .expect(0)
        .stdout;
    let names = list.lines().filter_map(|line| line.split(' ').next());
    let names: Vec<&str> = names.filter(|name| !["csv", "all"].contains(name)).collect();
    assert!(names.len() > 10, "{list}");
    for name in names {
        let told = run(
            GONIOCTL,
            here,
            &["export", directory, "--format", name, "--to", name],
        )
        .expect(0);
        assert!(told.stderr.contains("read back"), "{name}: {}", told.stderr);
    }
    assert!(
        fs::read(here.join("merl")).unwrap() == kept,
        "the table is that of the run"
    );
    let text = fs::read_to_string(here.join("csv-long")).unwrap();
    assert!(
        text.contains("# specimen: gold paint\n") && text.contains(",saturated|repeated,"),
        "readings come with their flags"
    );

    let arguments = ["convert", "rgl-rgb", "again.ssdd"];
    let told = run(GONIOCTL, here, &arguments).expect(0).stderr;
    assert!(told.starts_with("ssdd: read back"), "{told}");
    let unclear = run(GONIOCTL, here, &["convert", "again.ssdd", "again.bsdf"])
        .expect(2)
        .stderr;
    assert!(unclear.contains("rgl-rgb, rgl-spectral, zemax"), "{unclear}");
}

#[test]
fn a_job_gets_the_files_for_which_it_asks_and_the_report_says_what_was_found_of_each() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let formats = "formats = [\"ssdd\", \"gltf\", \"astm\"]\n";
    let directory = captured_with(here, formats, "[sim]\nspecimen = \"chrome\"\n");
    let report = fs::read_to_string(directory.join("report.json")).unwrap();
    let report: Value = serde_json::from_str(&report).unwrap();
    let exports = report["exports"].as_array().unwrap();
    let of: Vec<&str> = exports
        .iter()
        .map(|export| export["format"].as_str().unwrap())
        .collect();
    assert_eq!(of, ["ssdd", "gltf", "astm"]);
    for export in &exports[..2] {
        let name = export["file"].as_str().unwrap();
        assert!(name.starts_with("gold-paint-20"), "{name}");
        let (_, brdf) = formats::read(&directory.join(name)).unwrap();
        assert!(brdf.eval(glam::DVec3::Z, glam::DVec3::Z).min_element() > 0.0);
        let size = fs::metadata(directory.join(name)).unwrap().len();
        assert_eq!(export["bytes"], size);
        assert!(
            export["median_rel"].is_number() && export["text"].as_str().unwrap().starts_with("read back")
        );
    }
    assert_eq!(
        exports[2]["file"],
        Value::Null,
        "no grid of θ_s and φ_s holds chrome"
    );
    assert!(
        exports[2]["text"]
            .as_str()
            .unwrap()
            .contains("astm does not hold this specimen")
    );
    let page = fs::read_to_string(directory.join("report.html")).unwrap();
    assert!(page.contains("-ssdd.ssdd") && page.contains("astm does not hold"));
}

#[test]
fn a_run_is_exported_by_its_id_into_a_directory_under_a_name_of_its_own() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let directory = captured(here);
    let name = directory.file_name().unwrap().to_str().unwrap();
    let id = name.rsplit('-').next().unwrap();
    fs::create_dir(here.join("out")).unwrap();
    for (format, extension) in [("ssdd", "ssdd"), ("csv", "csv"), ("merl", "binary")] {
        let told = run(GONIOCTL, here, &["export", id, "--format", format, "--to", "out"])
            .expect(0)
            .stderr;
        let name = told.lines().next().unwrap().strip_prefix("writes ").unwrap();
        assert!(
            name.starts_with("out/gold-paint-20") && name.ends_with(extension),
            "{name}"
        );
        assert!(here.join(name).is_file(), "{name}");
    }
    let unknown = run(
        GONIOCTL,
        here,
        &[
            "export",
            "01ARZ3NDEKTSV4RRFFQ69G5FAV",
            "--format",
            "ssdd",
            "--daemon",
            "http://127.0.0.1:1",
        ],
    )
    .expect(5)
    .stderr;
    assert!(
        unknown.contains("has the id 01ARZ3NDEKTSV4RRFFQ69G5FAV"),
        "{unknown}"
    );
}

#[test]
fn what_cannot_be_exported_is_told() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let none = run(GONIOCTL, here, &["export", "--format", "rgl-rgb"])
        .expect(2)
        .stderr;
    assert!(none.contains("the run is missing"), "{none}");
    let nowhere = run(GONIOCTL, here, &["export", "runs/2026", "--format", "astm"])
        .expect(2)
        .stderr;
    assert!(
        nowhere.contains("neither the id of a run nor the address"),
        "{nowhere}"
    );
    let refused = run(GONIOCTL, here, &["convert", "chrome", "chrome.astm"])
        .expect(2)
        .stderr;
    assert!(
        refused.contains("astm does not hold this specimen") && refused.contains("allowed is at most"),
        "{refused}"
    );
    assert!(!here.join("chrome.astm").exists());
    fs::write(
        here.join("broken.ssdd"),
        "VERSION 0.2\nDATA_TYPE brdf\nDATA ascii\n",
    )
    .unwrap();
    let broken = run(GONIOCTL, here, &["convert", "broken.ssdd", "out.binary"])
        .expect(2)
        .stderr;
    assert!(
        broken.contains("broken.ssdd as ssdd") && broken.contains("COLOR_MODEL"),
        "{broken}"
    );
    let scratch = root().join("crates");
    let foreign = run(
        GONIOCTL,
        &scratch,
        &["convert", "formats/Cargo.toml", "out.binary"],
    )
    .expect(2)
    .stderr;
    assert!(foreign.contains("in no format that goniod reads"), "{foreign}");
}
