use arms::Pose;
use serde::{Deserialize, Serialize};

use crate::{Counts, Gain};

mod dark;

pub use dark::Dark;

/// Smallest cosine that a signal is divided by (89.94°): beyond, a hundredth of a degree changes f by a fifth.
pub const MIN_COSINE: f64 = 1e-3;

/// Smallest share of the nominal lamp output at which a reading says anything.
const MIN_LAMP: f64 = 0.01;

/// Which cosine the signal carries (Nicodemus; see docs/geometry.md).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Filling {
    /// The light overfills what the sensor sees: signal ~ f · cos θ_i.
    Over,
    /// The light's spot lies within what the sensor sees: signal ~ f · cos θ_o.
    Under,
}

/// Constants between counts and sr⁻¹; `[calibration]` of the rig file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Which cosine the signal carries.
    pub filling: Filling,
    /// Counts per µs at gain ×1 for f·cos = 1 sr⁻¹ at nominal lamp output; red, green, blue.
    pub responsivity: [f64; 3],
    /// Monitor counts per µs at nominal lamp output.
    pub monitor: f64,
}

/// Why counts do not tell a reflectance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unusable {
    /// A channel is at full scale: the reflectance is only known to be larger.
    #[error("a channel is at full scale")]
    Saturated,
    /// The light (overfilled) or the sensor (underfilled) stands too close to 90°.
    #[error("within 0.06° of grazing, where the signal's cosine vanishes")]
    Grazing,
    /// The monitor saw less than 1 % of the nominal lamp output.
    #[error("the lamp monitor saw no light")]
    Lamp,
    /// No dark reading was taken at this gain.
    #[error("no dark reading at gain ×{}", u16::from(*.0))]
    Dark(Gain),
}

impl Calibration {
    /// BRDF in sr⁻¹, red, green, blue, from one reading.
    ///
    /// f = (counts − dark) / (responsivity · gain · t · cos θ) · (nominal monitor rate · t) / (monitor − dark), with
    /// θ = θ_i where the light overfills the field of the sensor, θ_o where it underfills it (ASTM E2387, Nicodemus).
    /// Of a black specimen the values scatter about 0: they may be slightly negative, and must stay so until averages
    /// are taken.
    ///
    /// # Errors
    /// Counts that say nothing, and why.
    pub fn reflectance(&self, dark: &Dark, pose: Pose, counts: &Counts) -> Result<[f64; 3], Unusable> {
        if counts.saturated {
            return Err(Unusable::Saturated);
        }
        let cosine = match self.filling {
            Filling::Over => pose.light.rad().cos(),
            Filling::Under => pose.sensor.rad().cos(),
        };
        if cosine.is_nan() || cosine < MIN_COSINE {
            return Err(Unusable::Grazing);
        }
        let exposure = counts.exposure;
        let (dark_rgb, dark_monitor) = dark.counts(exposure).ok_or(Unusable::Dark(exposure.gain))?;
        let time_us = f64::from(exposure.integration_us);
        let lamp = (f64::from(counts.monitor) - dark_monitor) / (self.monitor * time_us);
        if lamp < MIN_LAMP {
            return Err(Unusable::Lamp);
        }
        let scale = 1.0 / (exposure.gain.factor() * time_us * cosine * lamp);
        Ok(std::array::from_fn(|c| {
            (f64::from(counts.rgb[c]) - dark_rgb[c]) * scale / self.responsivity[c]
        }))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Exposure;

    const CALIBRATION: Calibration = Calibration {
        filling: Filling::Over,
        responsivity: [1.0, 2.0, 0.5],
        monitor: 5.0,
    };

    fn counts(rgb: [u32; 3], monitor: u32, gain: Gain) -> Counts {
        Counts {
            rgb,
            monitor,
            exposure: Exposure {
                integration_us: 10_000,
                gain,
            },
            saturated: false,
            sequence: 1,
            ticks: 0,
            temperature_c: 25,
        }
    }

    #[test]
    fn a_known_signal_is_a_known_reflectance() {
        let reading = counts([5_000, 10_000, 2_500], 50_000, Gain::X1);
        let normal = Pose::from_deg(0.0, 60.0);
        let f = CALIBRATION.reflectance(&Dark::NONE, normal, &reading).unwrap();
        assert_eq!(f, [0.5, 0.5, 0.5]);
        let aslant = Pose::from_deg(-60.0, 0.0);
        let f = CALIBRATION.reflectance(&Dark::NONE, aslant, &reading).unwrap();
        assert!((f[0] - 1.0).abs() < 1e-12, "overfilled divides by cos θ_i: {f:?}");
        let under = Calibration {
            filling: Filling::Under,
            ..CALIBRATION
        };
        let f = under.reflectance(&Dark::NONE, normal, &reading).unwrap();
        assert!(
            (f[0] - 1.0).abs() < 1e-12,
            "underfilled divides by cos θ_o: {f:?}"
        );
        let amplified = counts([5_000, 10_000, 2_500], 50_000, Gain::X16);
        let f = CALIBRATION.reflectance(&Dark::NONE, normal, &amplified).unwrap();
        assert!((f[0] - 0.5 / 16.0).abs() < 1e-15);
    }

    #[test]
    fn a_lamp_at_half_output_does_not_darken_the_specimen() {
        let pose = Pose::from_deg(-30.0, 40.0);
        let full = counts([8_000; 3], 50_000, Gain::X1);
        let half = counts([4_000; 3], 25_000, Gain::X1);
        let f = [full, half].map(|c| CALIBRATION.reflectance(&Dark::NONE, pose, &c).unwrap());
        assert_eq!(f[0], f[1]);
    }

    #[test]
    fn what_says_nothing_is_refused() {
        let pose = Pose::from_deg(-30.0, 40.0);
        let good = counts([8_000; 3], 50_000, Gain::X1);
        let at = |pose, counts: Counts, dark: &Dark| CALIBRATION.reflectance(dark, pose, &counts);
        let saturated = Counts {
            saturated: true,
            ..good
        };
        assert_eq!(at(pose, saturated, &Dark::NONE), Err(Unusable::Saturated));
        for light in [-90.0, 90.0, 89.95, f64::NAN] {
            let grazing = Pose::from_deg(light, 40.0);
            assert_eq!(at(grazing, good, &Dark::NONE), Err(Unusable::Grazing), "{light}°");
        }
        assert!(at(Pose::from_deg(89.9, 40.0), good, &Dark::NONE).is_ok());
        for monitor in [0, 499] {
            let unlit = counts([8_000; 3], monitor, Gain::X1);
            assert_eq!(at(pose, unlit, &Dark::NONE), Err(Unusable::Lamp));
        }
        let dark = Dark::fit([&counts([10; 3], 10, Gain::X1)]);
        let other = counts([8_000; 3], 50_000, Gain::X256);
        assert_eq!(at(pose, other, &dark), Err(Unusable::Dark(Gain::X256)));
    }

    #[test]
    fn a_black_specimen_may_come_out_negative() {
        let dark = Dark::fit([&counts([100; 3], 10, Gain::X1)]);
        let reading = counts([95, 100, 105], 50_010, Gain::X1);
        let f = CALIBRATION
            .reflectance(&dark, Pose::from_deg(0.0, 40.0), &reading)
            .unwrap();
        assert!(f[0] < 0.0 && f[1] == 0.0 && f[2] > 0.0, "{f:?}");
    }

    proptest! {
        /// Counts made of a reflectance by the formula, rounded, give it back within the rounding.
        #[test]
        fn prop_reflectance_inverts_the_signal(
            f in 1e-3f64..10.0, light in -85.0f64..85.0, gain in 0usize..3, time_us in 100u32..100_000,
            lamp in 0.5f64..1.5, offset in 0.0f64..200.0, rate in 0.0f64..0.01,
        ) {
            let gain = Gain::ALL[gain];
            let pose = Pose::from_deg(light, 0.0);
            let signal = |t: f64, c: usize, lit: f64| {
                let per_us = CALIBRATION.responsivity[c] * gain.factor() * f * pose.light.rad().cos() * lamp * lit + rate;
                (offset + per_us * t).round() as u32
            };
            let take = |time_us: u32, lit: f64| {
                let t = f64::from(time_us);
                Counts {
                    rgb: std::array::from_fn(|c| signal(t, c, lit)),
                    monitor: (CALIBRATION.monitor * lamp * lit * t).round() as u32,
                    exposure: Exposure { integration_us: time_us, gain },
                    ..counts([0; 3], 0, gain)
                }
            };
            let dark = Dark::fit([&take(100, 0.0), &take(100_000, 0.0)]);
            let reading = take(time_us, 1.0);
            let back = CALIBRATION.reflectance(&dark, pose, &reading).unwrap();
            let dark = dark.counts(reading.exposure).unwrap().0;
            for (c, back) in back.into_iter().enumerate() {
                // Half a count in the reading, one in the dark line, half a monitor count.
                let net = f64::from(reading.rgb[c]) - dark[c];
                let bound = 2.0 / net.max(0.5) + 1.0 / f64::from(reading.monitor);
                prop_assert!((back / f - 1.0).abs() < bound * 1.5, "{back} for {f}, channel {c}");
            }
        }
    }
}
