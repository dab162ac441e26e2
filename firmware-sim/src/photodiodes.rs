use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};
use rig::Calibration;

use crate::Imperfections;

/// Temperature for which dark counts are stated, °C.
const DARK_REFERENCE_C: f64 = 25.0;

/// What one integration saw.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Light {
    /// ∫ lamp · f · cos dt for red, green and blue, s/sr.
    pub(crate) signal: DVec3,
    /// ∫ lamp dt, s.
    pub(crate) lamp_s: f64,
    /// ∫ light of the room dt, s/sr.
    pub(crate) room_s: f64,
    pub(crate) duration_s: f64,
    pub(crate) gain: f64,
    pub(crate) temperature_c: f64,
}

/// What one integration gave, as the registers show it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Exposed {
    pub(crate) rgb: [u32; 3],
    pub(crate) monitor: u32,
    /// A colour channel is at full scale.
    pub(crate) saturated: bool,
}

/// Three colour channels and the lamp monitor: from light to whole counts.
#[derive(Clone, Debug)]
pub(crate) struct Photodiodes {
    pub(crate) calibration: Calibration,
    pub(crate) full_scale: u32,
    pub(crate) imperfections: Imperfections,
    pub(crate) seed: u64,
}

impl Photodiodes {
    /// Counts of the `serial`-th integration: its noise depends on nothing but that number and the seed.
    ///
    /// Mean counts of a channel are gain · (responsivity · (signal + stray · lamp + room) + dark · time); electrons are
    /// Poisson, read noise is normal. The monitor has neither gain, dark signal nor offset. Responsivity, gain, linearity
    /// and colours are off by the stated errors.
    pub(crate) fn expose(&self, light: Light, serial: u64) -> Exposed {
        let Imperfections {
            shot_noise_electrons: electrons,
            dark_counts_per_s,
            dark_doubling_c,
            dark_offset_counts,
            stray_per_sr,
            responsivity_error,
            gain_error,
            nonlinearity,
            crosstalk,
            ..
        } = self.imperfections;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(serial);
        let warmer = match dark_doubling_c {
            0.0 => 0.0,
            doubling => (light.temperature_c - DARK_REFERENCE_C) / doubling,
        };
        let dark = dark_counts_per_s * warmer.exp2() * light.duration_s;
        let gain = match light.gain {
            1.0 => 1.0,
            gain => gain * (1.0 + gain_error),
        };
        let full_scale = f64::from(self.full_scale);
        let channel = |(responsivity, signal): (f64, f64)| {
            let lit = responsivity
                * (1.0 + responsivity_error)
                * 1e6
                * (signal + stray_per_sr * light.lamp_s + light.room_s);
            let noisy = gain * shot(lit + dark, electrons, &mut random);
            // Beyond the top of the parabola, where every reading is full, the counts shown go on growing.
            let lost = (nonlinearity * noisy / full_scale).min(0.5);
            let shown = noisy * (1.0 - lost);
            self.convert(shown + dark_offset_counts, &mut random)
        };
        let others = |signal: DVec3| (DVec3::splat(signal.element_sum()) - signal) / 2.0;
        let seen = light.signal * (1.0 - crosstalk) + others(light.signal) * crosstalk;
        let mut rgb = [0; 3];
        let pairs = self.calibration.responsivity.into_iter().zip(seen.to_array());
        for (counts, counted) in rgb.iter_mut().zip(pairs.map(channel)) {
            *counts = counted;
        }
        let monitor = shot(
            self.calibration.monitor * 1e6 * light.lamp_s,
            electrons,
            &mut random,
        );
        Exposed {
            rgb,
            monitor: self.convert(monitor, &mut random),
            saturated: rgb.contains(&self.full_scale),
        }
    }

    /// Counts of the green photodiode alone at gain ×1, as an instrument sees its current: with shot noise, dark current and
    /// stray light, without converter and offset.
    pub(crate) fn photocurrent(&self, light: Light, serial: u64) -> f64 {
        let amounts = self.imperfections;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(serial);
        let warmer = match amounts.dark_doubling_c {
            0.0 => 0.0,
            doubling => (light.temperature_c - DARK_REFERENCE_C) / doubling,
        };
        let dark = amounts.dark_counts_per_s * warmer.exp2() * light.duration_s;
        let lit = self.calibration.responsivity[1]
            * (1.0 + amounts.responsivity_error)
            * 1e6
            * (light.signal.y + amounts.stray_per_sr * light.lamp_s + light.room_s);
        shot(lit + dark, amounts.shot_noise_electrons, &mut random)
    }

    fn convert(&self, counts: f64, random: &mut ChaCha8Rng) -> u32 {
        let normal: f64 = StandardNormal.sample(random);
        let read = counts + self.imperfections.read_noise_counts * normal;
        read.round().clamp(0.0, f64::from(self.full_scale)) as u32
    }
}

/// Counts at gain ×1 as Poisson electrons make them; 0 electrons per count: no noise.
fn shot(counts: f64, electrons_per_count: f64, random: &mut ChaCha8Rng) -> f64 {
    match Poisson::new(counts * electrons_per_count) {
        Ok(electrons) => electrons.sample(random) / electrons_per_count,
        // No light, or no noise.
        Err(_) => counts,
    }
}

#[cfg(test)]
mod tests {
    use rig::Filling;

    use super::*;

    fn photodiodes(imperfections: Imperfections) -> Photodiodes {
        Photodiodes {
            calibration: Calibration {
                filling: Filling::Over,
                responsivity: [1.0, 2.0, 0.5],
                monitor: 5.0,
            },
            full_scale: 1_048_575,
            imperfections,
            seed: 7,
        }
    }

    /// 100 ms of a signal under a nominal lamp.
    fn light(signal: f64, gain: f64) -> Light {
        Light {
            signal: DVec3::splat(signal * 0.1),
            lamp_s: 0.1,
            room_s: 0.0,
            duration_s: 0.1,
            gain,
            temperature_c: 25.0,
        }
    }

    #[test]
    fn without_imperfections_counts_are_the_rounded_truth() {
        let photodiodes = photodiodes(Imperfections::NONE);
        let exposed = photodiodes.expose(light(0.123_456, 16.0), 0);
        assert_eq!(exposed.rgb, [197_530, 395_059, 98_765]);
        assert_eq!((exposed.monitor, exposed.saturated), (500_000, false));
        let full = photodiodes.expose(light(3.0, 16.0), 1);
        assert_eq!(full.rgb[0], 1_048_575);
        assert!(full.saturated);
    }

    #[test]
    fn noise_depends_on_seed_and_number_alone() {
        let photodiodes = photodiodes(Imperfections::DEFAULT);
        let first = photodiodes.expose(light(0.1, 1.0), 3);
        assert_eq!(first, photodiodes.expose(light(0.1, 1.0), 3));
        assert_ne!(first, photodiodes.expose(light(0.1, 1.0), 4));
        let other = Photodiodes {
            seed: 8,
            ..photodiodes
        };
        assert_ne!(first, other.expose(light(0.1, 1.0), 3));
    }

    #[test]
    fn mean_and_spread_are_the_stated_ones() {
        let amounts = Imperfections::DEFAULT;
        let photodiodes = photodiodes(amounts);
        for (signal, gain) in [(0.15, 16.0), (0.001, 256.0), (0.0, 256.0), (0.3, 1.0)] {
            let n = 4000;
            let reds: Vec<f64> = (0..n)
                .map(|serial| f64::from(photodiodes.expose(light(signal, gain), serial).rgb[0]))
                .collect();
            let mean = reds.iter().sum::<f64>() / n as f64;
            let variance = reds.iter().map(|red| (red - mean).powi(2)).sum::<f64>() / n as f64;
            let at_gain_1 = (signal + amounts.stray_per_sr) * 1e5 + amounts.dark_counts_per_s * 0.1;
            let shot = at_gain_1 * gain * gain / amounts.shot_noise_electrons;
            // Rounding adds 1/12.
            let expected = shot + amounts.read_noise_counts.powi(2) + 1.0 / 12.0;
            let expected_mean = at_gain_1 * gain + amounts.dark_offset_counts;
            let case = format!("f·cos {signal} at ×{gain}");
            assert!(
                (mean - expected_mean).abs() < 4.5 * (expected / n as f64).sqrt(),
                "{case}: mean {mean}, not {expected_mean}"
            );
            assert!(
                (variance / expected - 1.0).abs() < 0.1,
                "{case}: variance {variance}, not {expected}"
            );
        }
    }

    #[test]
    fn bright_readings_are_good_to_well_under_a_percent() {
        let photodiodes = photodiodes(Imperfections::DEFAULT);
        // A white specimen at 45°.
        let truth = 0.16 * 16.0 * 1e5;
        let worst = (0..1000)
            .map(|serial| f64::from(photodiodes.expose(light(0.16, 16.0), serial).rgb[0]))
            .map(|red| ((red - 64.0 - 32.0 - 16.0) / truth - 1.0).abs())
            .fold(0.0, f64::max);
        assert!(worst < 0.006, "worst of 1000 is off by {worst}");
    }

    #[test]
    fn dark_counts_double_with_temperature() {
        let photodiodes = photodiodes(Imperfections {
            dark_counts_per_s: 1e4,
            dark_doubling_c: 8.0,
            ..Imperfections::NONE
        });
        let at = |temperature_c| {
            let dark = Light {
                signal: DVec3::ZERO,
                lamp_s: 0.0,
                temperature_c,
                ..light(0.0, 1.0)
            };
            photodiodes.expose(dark, 0).rgb[0]
        };
        assert_eq!((at(25.0), at(33.0), at(17.0)), (1000, 2000, 500));
    }
}
