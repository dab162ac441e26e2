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
    /// Mean counts of a channel are gain · (responsivity · (signal + stray · lamp) + dark · time); electrons are
    /// Poisson, read noise is normal. The monitor has neither gain, dark signal nor offset.
    pub(crate) fn expose(&self, light: Light, serial: u64) -> Exposed {
        let Imperfections {
            shot_noise_electrons: electrons,
            dark_counts_per_s,
            dark_doubling_c,
            dark_offset_counts,
            stray_per_sr,
            ..
        } = self.imperfections;
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(serial);
        let warmer = match dark_doubling_c {
            0.0 => 0.0,
            doubling => (light.temperature_c - DARK_REFERENCE_C) / doubling,
        };
        let dark = dark_counts_per_s * warmer.exp2() * light.duration_s;
        let channel = |(responsivity, signal): (f64, f64)| {
            let lit = responsivity * 1e6 * (signal + stray_per_sr * light.lamp_s);
            let noisy = light.gain * shot(lit + dark, electrons, &mut random);
            self.convert(noisy + dark_offset_counts, &mut random)
        };
        let mut rgb = [0; 3];
        let pairs = self
            .calibration
            .responsivity
            .into_iter()
            .zip(light.signal.to_array());
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
