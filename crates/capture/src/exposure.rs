use arms::Pose;
use rig::{Counts, Exposure, Gain, PhotometerSettings};
use sweep::Sweep;

use crate::Reading;

/// How much brighter than full scale a saturated channel is taken to be.
const BEYOND_FULL_SCALE: f64 = 8.0;
/// Most by which the trend of the last two readings may raise a prediction.
const STEEPEST: f64 = 8.0;
/// An exposure that differs less than this from the last one is not worth another reading.
const WORTH_IT: f64 = 1.1;

/// Chooses exposures from the readings before.
///
/// A rate is counts per µs at gain ×1 of the brightest channel above the dark level. The weakest gain that reaches
/// the aim within the longest integration is used, since light collected longer is less noisy than light amplified.
#[derive(Clone, Debug)]
pub(crate) struct Ranging<'a> {
    photometer: &'a PhotometerSettings,
    /// Brightest channel of dark readings: gain, integration in µs, counts.
    dark: Vec<(Gain, f64, f64)>,
    /// Accepted readings with the lamp on, oldest first.
    lit: Vec<(Sweep, Pose, f64)>,
}

impl<'a> Ranging<'a> {
    pub(crate) fn new(photometer: &'a PhotometerSettings) -> Self {
        Self {
            photometer,
            dark: Vec::new(),
            lit: Vec::new(),
        }
    }

    /// Takes note of an accepted reading.
    pub(crate) fn learn(&mut self, reading: &Reading) {
        let Counts { rgb, exposure, .. } = reading.counts;
        if reading.lamp {
            self.lit
                .push((reading.sweep, reading.goal, self.rate(&reading.counts)));
        } else {
            let brightest = f64::from(rgb.into_iter().fold(0, u32::max));
            self.dark
                .push((exposure.gain, f64::from(exposure.integration_us), brightest));
        }
    }

    /// Exposure for the first reading at a pose.
    pub(crate) fn first(&self, sweep: Sweep, pose: Pose) -> Exposure {
        match self.predict(sweep, pose) {
            Some(rate) => self.aim(rate),
            // Nothing is known: the middle of the range, from which every end is two readings away.
            None => Exposure {
                integration_us: geometric_middle(self.photometer),
                gain: Gain::X16,
            },
        }
    }

    /// A better exposure than the one of `counts`, where it was saturated or too dim and there is one.
    pub(crate) fn better(&self, counts: &Counts) -> Option<Exposure> {
        let rate = self.rate(counts);
        let next = self.aim(rate);
        let change = sensitivity(next) / sensitivity(counts.exposure);
        let worth_it = if counts.saturated {
            change * WORTH_IT < 1.0
        } else {
            self.dim(counts) && change > WORTH_IT
        };
        worth_it.then_some(next)
    }

    /// Whether the brightest channel has fewer counts above dark than the rig file calls enough.
    pub(crate) fn dim(&self, counts: &Counts) -> bool {
        self.net(counts) < f64::from(self.photometer.enough)
    }

    /// The brightest channel above the dark level.
    fn net(&self, counts: &Counts) -> f64 {
        f64::from(counts.rgb.into_iter().fold(0, u32::max)) - self.dark_level(counts.exposure)
    }

    fn rate(&self, counts: &Counts) -> f64 {
        let net = if counts.saturated {
            f64::from(self.photometer.full_scale) * BEYOND_FULL_SCALE
        } else {
            // Below one count only the noise is known.
            self.net(counts).max(1.0)
        };
        net / sensitivity(counts.exposure)
    }

    /// Mean of the dark readings with the same gain and the nearest integration time.
    fn dark_level(&self, exposure: Exposure) -> f64 {
        let integration = f64::from(exposure.integration_us);
        let same_gain = || self.dark.iter().filter(|(gain, ..)| *gain == exposure.gain);
        let distance = |&(_, us, _): &(Gain, f64, f64)| (us - integration).abs();
        let nearest = same_gain().map(distance).fold(f64::INFINITY, f64::min);
        let levels: Vec<f64> = same_gain()
            .filter(|dark| distance(dark) <= nearest)
            .map(|dark| dark.2)
            .collect();
        levels.iter().sum::<f64>() / levels.len().max(1) as f64
    }

    /// Expected rate at a pose: of the last reading of the sweep, raised along the trend of the last two (an
    /// exposure that comes out too weak costs little, a saturated one must be repeated); failing that, of the nearest
    /// reading of any sweep.
    fn predict(&self, sweep: Sweep, pose: Pose) -> Option<f64> {
        let mut last = self.lit.iter().rev().filter(|(of, ..)| *of == sweep);
        let Some(&(_, last_pose, last_rate)) = last.next() else {
            let distance = |at: &Pose| (at.light - pose.light).abs() + (at.sensor - pose.sensor).abs();
            let nearest = self
                .lit
                .iter()
                .min_by(|(_, a, _), (_, b, _)| distance(a).total_cmp(&distance(b)));
            return nearest.map(|&(.., rate)| rate);
        };
        let Some(&(_, before, rate_before)) = last.next() else {
            return Some(last_rate);
        };
        let step = last_pose.light - before.light;
        let growth = (last_rate / rate_before).ln() * (pose.light - last_pose.light) / step;
        let growth = if growth.is_finite() {
            growth.clamp(0.0, STEEPEST.ln())
        } else {
            0.0
        };
        Some(last_rate * growth.exp())
    }

    /// The exposure that brings a rate to the aim.
    fn aim(&self, rate: f64) -> Exposure {
        let p = self.photometer;
        let counts = p.aim * f64::from(p.full_scale);
        let needed = |gain: Gain| counts / (rate * gain.factor());
        let longest = f64::from(p.integration_max_us);
        let gain = Gain::ALL
            .into_iter()
            .find(|&gain| needed(gain) <= longest)
            .unwrap_or(Gain::X256);
        let shortest = f64::from(p.integration_min_us);
        Exposure {
            integration_us: needed(gain).clamp(shortest, longest).round() as u32,
            gain,
        }
    }
}

/// Integration time at gain ×1 that collects as much, µs.
fn sensitivity(exposure: Exposure) -> f64 {
    f64::from(exposure.integration_us) * exposure.gain.factor()
}

fn geometric_middle(p: &PhotometerSettings) -> u32 {
    (f64::from(p.integration_min_us) * f64::from(p.integration_max_us))
        .sqrt()
        .round() as u32
}
