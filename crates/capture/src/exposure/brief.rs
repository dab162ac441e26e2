use rig::{Exposure, Gain, RigFile};

/// Share of full scale that an exposure in flight is expected to reach at most: the arm comes to poses of which little is
/// known, and cannot wait to expose again.
const HEADROOM: f64 = 1.0 / 16.0;

/// Noise of reflectance times cosine that nothing feels, sr⁻¹: where less light comes than makes this the noise that the rig
/// file allows, a reading may be noisier in proportion.
const UNFELT_PER_SR: f64 = 3e-4;

/// The noise that a reading in flight may have at a rate of its brightest channel, counts per µs at gain ×1, relative to it.
pub(crate) fn allowed_rel(file: &RigFile, rate: f64) -> f64 {
    let responsivity = file.calibration.responsivity.into_iter().fold(0.0, f64::max);
    let unfelt = UNFELT_PER_SR * responsivity / rate.max(f64::MIN_POSITIVE);
    file.photometer.flight_noise_rel.max(unfelt.min(MOST_REL))
}

/// Beyond this nobody would call it a measurement, however dark it is.
const MOST_REL: f64 = 0.05;

/// How many exposures in flight are as long as the longest at rest: what needs more light than one is better read at rest.
const LONGEST: f64 = 2.0;

/// The shortest exposure that is as little noisy as the rig file asks of a reading in flight, in its brightest channel and
/// in the lamp monitor together; at most `longest_s`, where that is noisier.
///
/// `rate` is counts per µs at gain ×1. Of the gains that leave room for a lobe the strongest, where the converter's
/// noise counts least.
pub(crate) fn brief(file: &RigFile, rate: f64, longest_s: f64) -> Exposure {
    let p = &file.photometer;
    let shortest = f64::from(p.integration_min_us);
    let longest = (f64::from(p.integration_max_us) / LONGEST).max(shortest);
    let at = |gain: Gain| {
        let bright_us = p.aim * f64::from(p.full_scale) / (rate * gain.factor());
        let needed_us = needed_us(file, rate, gain).min(bright_us).min(longest_s * 1e6);
        Exposure {
            integration_us: needed_us.clamp(shortest, longest).round() as u32,
            gain,
        }
    };
    let has_room = |exposure: &Exposure| {
        let counts = rate * f64::from(exposure.integration_us) * exposure.gain.factor();
        counts <= HEADROOM * f64::from(p.full_scale)
    };
    let strongest = Gain::ALL.into_iter().rev().map(at).find(has_room);
    strongest.unwrap_or_else(|| at(Gain::X1))
}

/// Time in which photons, electrons and the converter leave as much noise as is allowed, µs: t with a/t + b/t² = ν², where
/// a comes of the photons that signal and monitor collect per µs, and b of the converter.
fn needed_us(file: &RigFile, rate: f64, gain: Gain) -> f64 {
    let known = &file.uncertainty;
    let monitor = file.calibration.monitor;
    let a = match known.electrons_per_count {
        0.0 => 0.0,
        electrons => (1.0 / rate + 1.0 / monitor) / electrons,
    };
    let converter = known.variance(0.0, gain.factor());
    let b = converter * ((rate * gain.factor()).powi(-2) + monitor.powi(-2));
    let allowed = allowed_rel(file, rate).powi(2);
    (a + (a * a + 4.0 * allowed * b).sqrt()) / (2.0 * allowed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_what_is_allowed_and_no_time_is_spent_on_less() {
        let file = RigFile::parse("", "test.toml".as_ref()).expect("the built-in file");
        let known = &file.uncertainty;
        for rate in [0.01, 0.1, 1.0, 10.0, 1000.0] {
            let exposure = brief(&file, rate, 1.0);
            let us = f64::from(exposure.integration_us);
            let noise = |counts: f64, gain: f64| {
                let variance = gain * counts / known.electrons_per_count + known.read_noise_counts.powi(2);
                variance.sqrt() / counts
            };
            let gain = exposure.gain.factor();
            let both = noise(rate * us * gain, gain).hypot(noise(file.calibration.monitor * us, 1.0));
            let allowed = allowed_rel(&file, rate);
            println!("{rate} counts/µs: {exposure:?}, noise {:.3} %", both * 100.0);
            if us < f64::from(file.photometer.integration_max_us) / LONGEST {
                assert!(both <= 1.01 * allowed, "{rate} counts/µs: {both}");
            }
            assert!(
                both > 0.9 * allowed,
                "{rate} counts/µs: {both} took longer than needed"
            );
        }
    }
}
