//! A technician calibrates the simulated rig from the command line and measures with what came of it.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

/// Servos without play and friction, which would turn every angle by a part of them.
const RIG: &str = "[calibration]\ncertificate = \"required\"\n[sim]\nspecimen = \"lambert:0.5\"\n\
     responsivity_error = 0.05\ngain_error = -0.01\nlight_backlash_deg = 0.0\nsensor_backlash_deg = 0.0\n\
     static_error_counts = 0\njitter_counts = 0\nlight_zero_deg = 0.1\nsensor_zero_deg = 0.1\nstray_per_sr = 0.0003\n";
const JOB: &str = "[[plane]]\ntheta_r_deg = 45\nreadings = 10\n[arc]\nreadings = 8\n";

fn gonioctl(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_e2e-gonioctl"))
        .args(arguments)
        .current_dir(directory)
        .output()
        .expect("gonioctl runs")
}

#[test]
fn a_rig_is_calibrated_from_the_command_line() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    fs::write(here.join("rig.toml"), RIG).unwrap();
    fs::write(here.join("job.toml"), JOB).unwrap();
    let run = || gonioctl(here, &["run", "job.toml", "--rig", "rig.toml", "--json"]);

    let refused = run();
    let text = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{text}");
    assert!(text.contains("gonioctl calibrate white"), "{text}");
    assert!(!here.join("runs").exists(), "nothing was begun");

    for stage in ["mirror", "trap", "white"] {
        let output = gonioctl(here, &["calibrate", stage, "--rig", "rig.toml"]);
        let text = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{stage}: {text}");
        let path = String::from_utf8(output.stdout).unwrap();
        assert!(here.join(path.trim()).exists(), "{stage}: {path}");
    }

    let done = run();
    let text = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(0), "{text}");
    let summary: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    let median = summary["errors"]["median_rel"].as_f64().unwrap();
    assert!(median < 0.005, "{median}");
    let directory = here.join(summary["directory"].as_str().unwrap());
    let named: serde_json::Value =
        serde_json::from_slice(&fs::read(directory.join("run.json")).unwrap()).unwrap();
    let parts = named["calibration"]["parts"].as_object().unwrap();
    assert_eq!(parts.keys().collect::<Vec<_>>(), ["mirror", "trap", "white"]);

    // Another zero of an arm is another rig.
    fs::write(here.join("rig.toml"), format!("[light]\nzero_deg = 179.0\n{RIG}")).unwrap();
    assert_eq!(run().status.code(), Some(2));
}
