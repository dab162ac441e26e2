use brdf::Brdf;
use capture::Record;
use rig::RigFile;

/// A reflectance that is further from the truth than so many of its expanded uncertainties is wrong: 6 σ.
const WRONG: f64 = 3.0;

/// Every step once, and each reflectance true within its uncertainty; how many were compared.
///
/// # Errors
/// What is doubled, missing or wrong, in words.
pub(super) fn whole(
    records: &[Record],
    steps: usize,
    file: &RigFile,
    specimen: &dyn Brdf,
) -> Result<u64, String> {
    let all = report::measurements(records, file);
    let mut accepted = vec![0; steps];
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
        let (Some(f), Some(u)) = (m.rgb(), m.u) else {
            return Err(format!("{at}: no reflectance, {:?}", m.reflectance));
        };
        let truth = specimen.eval(m.pose.incident(), m.pose.exitant());
        if ((f - truth).abs() - WRONG * u).max_element() > 0.0 {
            return Err(format!("{at}: {f} ± {u} sr⁻¹, the truth is {truth}"));
        }
        compared += 1;
    }
    Ok(compared)
}
