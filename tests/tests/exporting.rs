//! A run in every file format, and files of one format in another.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use tests::run;

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// A run of one plane and an arc with a reciprocal model.
fn captured(here: &Path) -> PathBuf {
    let job = "specimen = \"gold paint\"\non_stage = true\n[[plane]]\ntheta_r_deg = 60.0\nreadings = 24\n[arc]\nreadings = 16\n\
        [reconstruction]\nmodel = \"reciprocal\"\n";
    fs::write(here.join("job.toml"), job).unwrap();
    fs::write(here.join("rig.toml"), "").unwrap();
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
    let names: Vec<&str> = names.filter(|&name| name != "csv").collect();
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
fn what_cannot_be_exported_is_told() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let none = run(GONIOCTL, here, &["export", "--format", "rgl-rgb"])
        .expect(2)
        .stderr;
    assert!(none.contains("run directory is missing"), "{none}");
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
