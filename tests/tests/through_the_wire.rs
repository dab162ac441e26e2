//! What comes out of a captured run is what comes out of sampling the material directly.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use brdf::MerlTable;
use firmware_sim::Imperfections;
use tests::{Captured, difference, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

/// The model that [`Captured::direct`] makes of the material itself.
const JOB: &str = "
[reconstruction]
model = \"separable\"
[[plane]]
theta_r_deg = 70.0
readings = 90
[arc]
readings = 90
";

/// Runs the job on the built-in simulator and reads the result back.
fn captured(directory: &Path, sim: &str) -> Captured {
    fs::write(directory.join("job.toml"), JOB).unwrap();
    fs::write(directory.join("rig.toml"), format!("[sim]\n{sim}\n")).unwrap();
    let finished = run(GONIOCTL, directory, &["run", "job.toml", "--rig", "rig.toml"]).expect(0);
    Captured::read(&directory.join(finished.stdout.trim()))
}

#[test]
fn an_ideal_rig_measures_what_the_material_is() {
    for name in ["blue-rubber", "white-paint", "gold-paint"] {
        let temporary = tempfile::tempdir().unwrap();
        let run = captured(
            temporary.path(),
            &format!("specimen = \"{name}\"\nimperfections = \"none\""),
        );
        let direct: PathBuf = temporary.path().join("direct.binary");
        let material = brdf::specimen(name).unwrap();
        MerlTable::fill(&run.direct(&material)).write(&direct).unwrap();
        let (median, p99) = difference(&run.directory.join("brdf.binary"), &direct);
        println!("{name}: median {median:.2e}, p99 {p99:.2e}");
        assert!(median < 0.002, "{name}: median {median}");
        assert!(p99 < 0.01, "{name}: 99th percentile {p99}");
    }
}

/// Variance of the reflectance of a reading, relative, by what the simulator states of its noise: shot noise of the
/// channel and of the monitor, and their converters.
fn variance(reading: &capture::Reading, channel: usize) -> f64 {
    let Imperfections {
        shot_noise_electrons: electrons,
        read_noise_counts: converter,
        dark_offset_counts: offset,
        ..
    } = Imperfections::DEFAULT;
    let relative = |counts: f64, gain: f64| (counts * gain / electrons + converter.powi(2)) / counts.powi(2);
    let counts = reading.counts;
    let signal = f64::from(counts.rgb[channel]) - offset;
    relative(signal, counts.exposure.gain.factor()) + relative(f64::from(counts.monitor), 1.0)
}

#[test]
fn another_seed_agrees_within_the_stated_noise() {
    let temporary = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let [a, b] = [0, 1].map(|seed| {
        // Of light alone: arms that stand where they were told.
        let sim = format!(
            "specimen = \"white-paint\"\nseed = {}\nlight_backlash_deg = 0.0\nsensor_backlash_deg = 0.0\n\
             static_error_counts = 0\njitter_counts = 0",
            seed + 7
        );
        captured(temporary[seed].path(), &sim)
    });
    let lit = |run: &Captured| -> Vec<_> {
        let accepted = run
            .measurements
            .iter()
            .filter(|m| m.reading.accepted && m.reading.lamp);
        accepted.cloned().collect()
    };
    let (a_lit, b_lit) = (lit(&a), lit(&b));
    assert_eq!(a_lit.len(), 180);
    let (mut deviations, mut variances) = (Vec::new(), Vec::new());
    for (a, b) in a_lit.iter().zip(&b_lit) {
        assert_eq!(a.reading.step, b.reading.step);
        let (f_a, f_b) = (a.rgb().unwrap(), b.rgb().unwrap());
        for channel in 0..3 {
            let sigma = (variance(&a.reading, channel) + variance(&b.reading, channel)).sqrt();
            deviations.push((f_a[channel] / f_b[channel] - 1.0) / sigma);
            variances.push(sigma * sigma);
        }
    }
    let rms = (deviations.iter().map(|z| z * z).sum::<f64>() / deviations.len() as f64).sqrt();
    println!("seeds 7 and 8: rms {rms:.2} of the stated noise");
    assert!(deviations.iter().any(|z| *z != 0.0), "there is noise");
    assert!(rms < 1.5, "{rms} times the stated noise");
    let (median, p99) = difference(&a.directory.join("brdf.binary"), &b.directory.join("brdf.binary"));
    // Three readings go into every value of the table: one of the plane, one of the arc, and where they cross.
    let noise = (3.0 * variances.iter().sum::<f64>() / variances.len() as f64).sqrt();
    println!("median {median:.2e}, p99 {p99:.2e}, stated {noise:.2e}");
    assert!(
        median < noise && p99 < 3.0 * noise,
        "median {median}, p99 {p99}, stated {noise}"
    );
}
