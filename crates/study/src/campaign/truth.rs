use brdf::{Brdf, Spherical};
use capture::{Flag, Record};
use glam::DVec3;
use pdv::Observation;
use report::{Measurement, MonteCarlo, observations};
use rig::RigFile;
use sweep::{Job, Sweep};

use super::carry::words;

/// A reflectance that is further from the truth than so many of its expanded uncertainties is wrong: 6 σ.
const WRONG: f64 = 3.0;
/// Zenith angles, degrees, and azimuths between light and viewer at which reconstructions are compared. Beyond, they
/// lean on the last reading of the arc, at 88°, where no reading tells what the apertures blur across the plane.
const THETA_DEG: [f64; 4] = [0.0, 20.0, 40.0, 60.0];
const PHI_DEG: [f64; 4] = [0.0, 60.0, 120.0, 180.0];

/// Every step once, and each reflectance true within its uncertainty, and so is the reconstruction; how many readings
/// were compared.
///
/// # Errors
/// What is doubled, missing or wrong, in words.
pub(super) fn whole(
    records: &[Record],
    steps: usize,
    job: &Job,
    file: &RigFile,
    specimen: &dyn Brdf,
) -> Result<u64, String> {
    let all = report::measurements(records, file);
    let added = records.iter().map(|record| match record {
        Record::Extension(extension) => extension.steps.len(),
        _ => 0,
    });
    let mut accepted = vec![0; steps + added.sum::<usize>()];
    for m in all.iter().filter(|m| m.reading.accepted) {
        accepted[m.reading.step] += 1;
    }
    if let Some(step) = accepted.iter().position(|&n| n != 1) {
        return Err(format!("step {step} has {} accepted readings", accepted[step]));
    }
    let mut compared = 0;
    for m in all.iter().filter(|m| m.reading.accepted && m.reading.lamp) {
        let at = format!(
            "step {}, light {:.2}°, sensor {:.2}°",
            m.reading.step,
            m.pose.light.deg(),
            m.pose.sensor.deg()
        );
        // A reading at full scale says that it tells nothing.
        if m.reading.flags.contains(&Flag::Saturated) && m.rgb().is_none() {
            continue;
        }
        let (Some(f), Some(u)) = (m.rgb(), m.u) else {
            return Err(format!("{at}: no reflectance, {:?}", m.reflectance));
        };
        let truth = specimen.eval(m.pose.incident(), m.pose.exitant());
        if ((f - truth).abs() - WRONG * u).max_element() > 0.0 {
            return Err(format!("{at}: {f} ± {u} sr⁻¹, the truth is {truth}"));
        }
        compared += 1;
    }
    let draws = MonteCarlo::new(job, &all, records, file);
    reconstructed(job, &all, &draws, specimen)?;
    Ok(compared)
}

/// The reconstruction is that of true readings at the same poses within its uncertainty, wherever one looks.
///
/// Not the specimen itself: how far a model is from it between its readings no uncertainty of theirs tells.
fn reconstructed(
    job: &Job,
    all: &[Measurement],
    draws: &MonteCarlo,
    specimen: &dyn Brdf,
) -> Result<(), String> {
    let sweeps = |sweep| {
        let measured = observations(all, sweep);
        let truth = |o: &Observation| Observation::of(specimen, o.theta_r, o.deviation);
        let truth: Vec<Observation> = measured.iter().filter_map(truth).collect();
        (measured, truth)
    };
    let planes = job.curves().map(&sweeps);
    let (planes, true_planes): (Vec<_>, Vec<_>) = planes.unzip();
    let (arc, true_arc) = sweeps(Sweep::Arc);
    let found = report::model(job.model, &planes, &arc).map_err(words)?;
    let expected = report::model(job.model, &true_planes, &true_arc).map_err(words)?;
    for (i, o, phi) in looks() {
        let direction = |theta_deg: f64, phi_deg: f64| {
            let (theta, phi) = (theta_deg.to_radians(), phi_deg.to_radians());
            Spherical { theta, phi }.direction()
        };
        let (incident, exitant) = (direction(i, phi), direction(o, 0.0));
        let [f, truth] = [&found, &expected].map(|model| model.eval(incident, exitant));
        let u = draws
            .of(|model| Some(model.eval(incident, exitant)))
            .unwrap_or(DVec3::ZERO);
        if ((f - truth).abs() - WRONG * u).max_element() > 0.0 {
            return Err(format!(
                "reconstruction at θ_i {i}°, θ_o {o}°, φ {phi}°: {f} ± {u} sr⁻¹, of true readings it is {truth}"
            ));
        }
    }
    Ok(())
}

fn looks() -> impl Iterator<Item = (f64, f64, f64)> {
    let angles = THETA_DEG.into_iter().flat_map(|i| THETA_DEG.map(|o| (i, o)));
    angles.flat_map(|(i, o)| PHI_DEG.map(|phi| (i, o, phi)))
}
