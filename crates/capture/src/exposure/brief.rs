use rig::{Exposure, Gain, RigFile};

/// Share of full scale that an exposure in flight is expected to reach at most: the arm comes to poses of which little is
/// known, and cannot wait to expose again.
const HEADROOM: f64 = 1.0 / 16.0;

/// The shortest exposure that is as little noisy as the rig file asks of a reading in flight, in its brightest channel and
/// in the lamp monitor together; at most `longest_s`, where that is noisier.
///
/// `rate` is counts per µs at gain ×1. Of the gains that leave room for a lobe the strongest, where the converter's
/// noise counts least.
pub(crate) fn brief(file: &RigFile, rate: f64, longest_s: f64) -> Exposure {
    let p = &file.photometer;
    let [shortest, longest] = [p.integration_min_us, p.integration_max_us].map(f64::from);
    let monitor_us = needed_counts(file, 1.0) / file.calibration.monitor;
    let at = |gain: Gain| {
        let per_us = rate * gain.factor();
        let signal_us = needed_counts(file, gain.factor()) / per_us;
        let bright_us = p.aim * f64::from(p.full_scale) / per_us;
        let needed_us = signal_us.max(monitor_us).min(bright_us).min(longest_s * 1e6);
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

/// Counts of which photons, electrons and the converter leave as much noise as is allowed, the other half of it being
/// the other channel's: n with gain·n/E + σ² = (ν²/2)·n².
fn needed_counts(file: &RigFile, gain: f64) -> f64 {
    let known = &file.uncertainty;
    let shot = match known.electrons_per_count {
        0.0 => 0.0,
        electrons => gain / electrons,
    };
    let allowed = file.photometer.flight_noise_rel.powi(2) / 2.0;
    let converter = known.read_noise_counts.powi(2) + 1.0 / 12.0;
    (shot + (shot * shot + 4.0 * allowed * converter).sqrt()) / (2.0 * allowed)
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
            let allowed = file.photometer.flight_noise_rel;
            println!("{rate} counts/µs: {exposure:?}, noise {:.3} %", both * 100.0);
            if us < f64::from(file.photometer.integration_max_us) {
                assert!(both <= 1.01 * allowed, "{rate} counts/µs: {both}");
            }
            assert!(
                both > 0.6 * allowed,
                "{rate} counts/µs: {both} took longer than needed"
            );
        }
    }
}
