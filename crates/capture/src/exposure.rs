use arms::Pose;
use rig::{Counts, Exposure, Gain, PhotometerSettings, RigFile};
use sweep::Sweep;

use crate::Reading;

mod brief;

use brief::allowed_rel;
pub(crate) use brief::brief;

/// How much brighter than full scale a saturated channel is taken to be.
const BEYOND_FULL_SCALE: f64 = 8.0;
/// Most by which the trend of the last two readings may raise a prediction.
const STEEPEST: f64 = 8.0;
/// Share of full scale that no exposure may be expected to exceed.
const ALMOST_FULL: f64 = 0.95;
/// An exposure that differs less than this from the last one is not worth another reading.
const WORTH_IT: f64 = 1.1;
/// A channel is exposed again beside a brighter one, and a faint reading in flight again at rest, only where that leaves at
/// most this share of its noise: the same exposure once more, for the same time or less, would leave 0.7 of every channel's.
const QUIETER: f64 = 0.5;
/// Times the noise that the rig file allows in flight, beyond which a reading is taken again at rest if that helps: the
/// way there costs as much as dozens of readings in flight.
const FAINT: f64 = 4.0;

/// Chooses exposures from the readings before.
///
/// A rate is counts per µs at gain ×1 of the brightest channel above the dark level. The weakest gain that reaches
/// the aim within the longest integration is used, since light collected longer is less noisy than light amplified.
#[derive(Clone, Debug)]
pub(crate) struct Ranging<'a> {
    file: &'a RigFile,
    photometer: &'a PhotometerSettings,
    /// Brightest channel of dark readings: gain, integration in µs, counts.
    dark: Vec<(Gain, f64, f64)>,
    /// Accepted readings with the lamp on, oldest first.
    lit: Vec<(Sweep, Pose, f64)>,
}

impl<'a> Ranging<'a> {
    pub(crate) fn new(file: &'a RigFile) -> Self {
        Self {
            file,
            photometer: &file.photometer,
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

    /// Whether there is any lit reading to range others from.
    pub(crate) fn knows_light(&self) -> bool {
        !self.lit.is_empty()
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

    /// An exposure beside the one of `counts`, which counts, for its faintest channel: where that has fewer counts than
    /// the rig file calls enough, since a brighter one leaves no time for more. There the brighter one may saturate; each
    /// channel is taken from the exposures that show it. `None` where that would leave no more than a little less noise:
    /// where the time is spent already, amplification does not help against the noise of light.
    pub(crate) fn beside(&self, counts: &Counts) -> Option<Exposure> {
        let dark = self.dark_level(counts.exposure);
        let faintest = f64::from(counts.rgb.into_iter().fold(u32::MAX, u32::min)) - dark;
        if counts.saturated || self.dim(counts) || faintest >= f64::from(self.photometer.enough) {
            return None;
        }
        // Below one count only the noise is known.
        let rate = faintest.max(1.0) / sensitivity(counts.exposure);
        let next = self.aim(rate);
        self.quieter(rate, next, counts.exposure).then_some(next)
    }

    /// Whether a reading in flight is too faint to count, as one is that came after a much brighter one: its noise is far
    /// from what the rig file asks for, and at rest there would be time for much less.
    pub(crate) fn too_faint(&self, counts: &Counts) -> bool {
        let rate = self.rate(counts);
        let noisy = self.noise(rate, counts.exposure) > FAINT * allowed_rel(self.file, rate);
        noisy && !counts.saturated && self.quieter(rate, self.aim(rate), counts.exposure)
    }

    /// Whether an exposure leaves much less noise at a rate than another.
    fn quieter(&self, rate: f64, next: Exposure, than: Exposure) -> bool {
        self.noise(rate, next) <= QUIETER * self.noise(rate, than)
    }

    /// Standard deviation of a channel with this rate, relative to it.
    fn noise(&self, rate: f64, exposure: Exposure) -> f64 {
        let counts = rate * sensitivity(exposure);
        let variance = self.file.uncertainty.variance(counts, exposure.gain.factor());
        variance.sqrt() / counts
    }

    /// Whether the brightest channel has fewer counts above dark than the rig file calls enough.
    pub(crate) fn dim(&self, counts: &Counts) -> bool {
        self.net(counts) < f64::from(self.photometer.enough)
    }

    /// The brightest channel above the dark level.
    fn net(&self, counts: &Counts) -> f64 {
        f64::from(counts.rgb.into_iter().fold(0, u32::max)) - self.dark_level(counts.exposure)
    }

    /// Counts per µs at gain ×1.
    pub(crate) fn rate(&self, counts: &Counts) -> f64 {
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

    /// Expected rate at a pose: between two readings of the sweep, evenly in the logarithm; beyond them of the last one,
    /// raised along the trend of the last two (an exposure that comes out too weak costs little, a saturated one must be
    /// repeated); failing that, of the nearest reading of any sweep.
    pub(crate) fn predict(&self, sweep: Sweep, pose: Pose) -> Option<f64> {
        let mut last = self.lit.iter().rev().filter(|(of, ..)| *of == sweep);
        let Some(&(_, last_pose, last_rate)) = last.next() else {
            let distance = |at: &Pose| apart(at, &pose);
            let nearest = self
                .lit
                .iter()
                .min_by(|(_, a, _), (_, b, _)| distance(a).total_cmp(&distance(b)));
            return nearest.map(|&(.., rate)| rate);
        };
        if let Some(rate) = self.between(sweep, pose) {
            return Some(rate);
        }
        let Some(&(_, before, rate_before)) = last.next() else {
            return Some(last_rate);
        };
        let at = |pose: Pose| along(sweep, pose);
        let step = at(last_pose) - at(before);
        let growth = (last_rate / rate_before).ln() * (at(pose) - at(last_pose)) / step;
        let growth = if growth.is_finite() {
            growth.clamp(0.0, STEEPEST.ln())
        } else {
            0.0
        };
        Some(last_rate * growth.exp())
    }

    /// The rate between the two nearest readings of a sweep, where it has some on both sides.
    fn between(&self, sweep: Sweep, pose: Pose) -> Option<f64> {
        let (mut below, mut above) = (None, None);
        for &(of, at, rate) in self.lit.iter().filter(|(of, ..)| *of == sweep) {
            debug_assert_eq!(of, sweep);
            let off = along(sweep, at) - along(sweep, pose);
            let side = if off <= 0.0 { &mut below } else { &mut above };
            if side.is_none_or(|(nearest, _): (f64, f64)| off.abs() <= nearest) {
                *side = Some((off.abs(), rate));
            }
        }
        let ((back, low), (on, high)) = (below?, above?);
        let share = back / (back + on);
        Some((low.ln() * (1.0 - share) + high.ln() * share).exp())
    }

    /// The exposure that brings a rate to the aim, or as near as the range of the photometer allows without
    /// saturating.
    fn aim(&self, rate: f64) -> Exposure {
        let p = self.photometer;
        let full = f64::from(p.full_scale);
        let [shortest, longest] = [p.integration_min_us, p.integration_max_us].map(f64::from);
        let needed = |gain: Gain| p.aim * full / (rate * gain.factor());
        let at = |gain: Gain| Exposure {
            integration_us: needed(gain).clamp(shortest, longest).round() as u32,
            gain,
        };
        let fits = |gain: &Gain| rate * sensitivity(at(*gain)) <= ALMOST_FULL * full;
        let reaches = |gain: &Gain| needed(*gain) <= longest;
        // Where the range of times is narrower than the steps of gain, the gain that reaches the aim may saturate.
        let gain = Gain::ALL.into_iter().find(|gain| reaches(gain) && fits(gain));
        let strongest = || Gain::ALL.into_iter().rev().find(fits);
        at(gain.or_else(strongest).unwrap_or(Gain::X1))
    }
}

/// How far along its sweep a pose is, rad: by the half angle, which the mirror arc alone does not change.
fn along(sweep: Sweep, pose: Pose) -> f64 {
    match sweep {
        Sweep::Arc => pose.light.rad(),
        _ => pose.light.rad() + pose.sensor.rad(),
    }
}

/// How unlike the reflectances at two poses may be, in rad: by isotropy the side of the mirror direction says nothing, and
/// with the difference angle a reflectance changes less than with the half angle.
fn apart(a: &Pose, b: &Pose) -> f64 {
    const DIFFERENCE: f64 = 0.5;
    let half = |pose: &Pose| (pose.light.rad() + pose.sensor.rad()).abs();
    (half(a) - half(b)).abs() + DIFFERENCE * (a.separation_rad() - b.separation_rad()).abs()
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rig::RigFile;

    use super::*;

    const DARK: f64 = 64.0;

    fn rig(text: &str) -> RigFile {
        let text = format!("[photometer]\n{text}");
        RigFile::parse(&text, "test.toml".as_ref()).expect("a good rig file")
    }

    /// What a photometer without noise says of a light with this rate.
    fn counts(file: &RigFile, rate: f64, exposure: Exposure) -> Counts {
        counts_of(file, [rate; 3], exposure)
    }

    fn counts_of(file: &RigFile, rates: [f64; 3], exposure: Exposure) -> Counts {
        let full = f64::from(file.photometer.full_scale);
        let raw = rates.map(|rate| (DARK + rate * sensitivity(exposure)).round());
        Counts {
            rgb: raw.map(|raw| raw.min(full) as u32),
            monitor: 0,
            exposure,
            saturated: raw.into_iter().any(|raw| raw >= full),
            sequence: 0,
            ticks: 0,
            temperature_c: 25,
        }
    }

    fn reading(file: &RigFile, lamp: bool, light_deg: f64, rate: f64, exposure: Exposure) -> Reading {
        let pose = Pose::from_deg(light_deg, 60.0);
        Reading {
            step: 0,
            attempt: 0,
            accepted: true,
            sweep: if lamp { Sweep::Plane(0) } else { Sweep::Dark },
            lamp,
            goal: pose,
            measured: pose,
            counts: counts(file, rate, exposure),
            device_ticks: 0,
            retries: 0,
            flags: Vec::new(),
            swept_rad: None,
            spread_rad: None,
        }
    }

    fn with_darks(file: &RigFile) -> Ranging<'_> {
        let mut ranging = Ranging::new(file);
        let p = &file.photometer;
        for gain in Gain::ALL {
            for integration_us in [p.integration_min_us, p.integration_max_us] {
                ranging.learn(&reading(file, false, 0.0, 0.0, Exposure { integration_us, gain }));
            }
        }
        ranging
    }

    /// Exposes until there is nothing better, and says how often.
    fn settle(ranging: &Ranging<'_>, rate: f64, first: Exposure) -> (Counts, usize) {
        let mut last = counts(ranging.file, rate, first);
        let mut exposures = 1;
        while let Some(better) = ranging.better(&last) {
            last = counts(ranging.file, rate, better);
            exposures += 1;
            assert!(
                exposures <= 20,
                "never content with {rate} counts/µs from {first:?}"
            );
        }
        (last, exposures)
    }

    #[test]
    fn the_weakest_gain_that_reaches_the_aim_is_used() {
        let file = rig("");
        let p = &file.photometer;
        let ranging = with_darks(&file);
        let aim = f64::from(p.full_scale) * p.aim;
        let table = [
            (aim / 100_000.0, Gain::X1, 100_000),
            (aim / 100_001.0, Gain::X16, 6250),
            (aim / 1_600_000.0, Gain::X16, 100_000),
            (aim / 1_700_000.0, Gain::X256, 6641),
            (1e-9, Gain::X256, 100_000),
            (1e9, Gain::X1, 100),
        ];
        for (rate, gain, integration_us) in table {
            assert_eq!(
                ranging.aim(rate),
                Exposure { integration_us, gain },
                "{rate} counts/µs"
            );
        }
    }

    /// On the flank of a lobe each reading is brighter than the last by the same factor.
    #[test]
    fn a_steady_rise_is_foreseen_and_a_fall_is_not() {
        let file = rig("");
        for (factor, expected) in [(1.5, 1.5), (0.5, 1.0), (100.0, STEEPEST)] {
            let mut ranging = with_darks(&file);
            for (i, light_deg) in [-40.0, -41.0].into_iter().enumerate() {
                let rate = f64::powi(factor, i as i32);
                ranging.learn(&reading(&file, true, light_deg, rate, ranging.aim(rate)));
            }
            let next = ranging
                .predict(Sweep::Plane(0), Pose::from_deg(-42.0, 60.0))
                .expect("known");
            assert!((next / factor / expected - 1.0).abs() < 1e-2, "{factor}: {next}");
        }
    }

    #[test]
    fn a_sweep_begins_with_what_the_nearest_reading_of_another_said() {
        let file = rig("");
        let mut ranging = with_darks(&file);
        for (light_deg, rate) in [(-80.0, 0.5), (-20.0, 7.0)] {
            ranging.learn(&reading(&file, true, light_deg, rate, ranging.aim(rate)));
        }
        let expected = ranging.aim(7.0);
        let first = ranging.first(Sweep::Arc, Pose::from_deg(-30.0, 50.0));
        assert_eq!(first.gain, expected.gain);
        assert!(
            first.integration_us.abs_diff(expected.integration_us) < 10,
            "{first:?}, {expected:?}"
        );
    }

    #[test]
    fn a_faint_channel_beside_a_bright_one_is_exposed_for_itself() {
        let file = rig("");
        let ranging = with_darks(&file);
        // A lobe that leaves 52 µs, and a channel a thousand times fainter than it.
        let lobe = counts_of(&file, [5000.0, 5000.0, 5.0], ranging.aim(5000.0));
        let next = ranging.beside(&lobe).expect("more time for the blue channel");
        let beside = counts_of(&file, [5000.0, 5000.0, 5.0], next);
        assert!(beside.saturated, "{beside:?}");
        assert!(beside.rgb[2] > file.photometer.enough && beside.rgb[2] < file.photometer.full_scale);
        // The time is all spent, and blue has the light that there is; or it has enough anyway.
        for rates in [[0.35, 0.035, 0.0012], [5000.0, 50.0, 50.0]] {
            let counts = counts_of(&file, rates, ranging.aim(rates[0]));
            assert_eq!(ranging.beside(&counts), None, "{counts:?}");
        }
        assert_eq!(ranging.beside(&beside), None, "what does not count is left");
    }

    proptest! {
        #[test]
        fn prop_any_light_is_ranged_within_the_bound(
            log_rate in -6.0..6.0_f64,
            min_us in 10_u32..5_000,
            span in 1_u32..2_000,
            gain in 0_usize..3,
            start in 0.0..=1.0_f64,
            aim in 0.05..0.9_f64,
            enough in 0_u32..1_048_575,
        ) {
            let max_us = min_us.saturating_mul(span).min(10_000_000);
            // The monitor must have room for the longest of all integrations, 10 s.
            let file = rig(&format!(
                "integration_min_us = {min_us}\nintegration_max_us = {max_us}\naim = {aim}\nenough = {enough}\n\
                 [calibration]\nmonitor = 0.1"
            ));
            let p = &file.photometer;
            let ranging = with_darks(&file);
            let integration_us = min_us + (start * f64::from(max_us - min_us)) as u32;
            let first = Exposure { integration_us, gain: Gain::ALL[gain] };
            let (last, exposures) = settle(&ranging, 10_f64.powf(log_rate), first);
            prop_assert!(exposures <= crate::execution::MAX_EXPOSURES as usize, "{exposures} exposures");
            let exposure = last.exposure;
            prop_assert!((min_us..=max_us).contains(&exposure.integration_us));
            if last.saturated {
                let least = f64::from(exposure.integration_us) <= f64::from(min_us) * WORTH_IT;
                prop_assert!(exposure.gain == Gain::X1 && least, "{exposure:?} could be had weaker");
            } else if ranging.dim(&last) {
                let most = exposure.gain == Gain::X256
                 && f64::from(exposure.integration_us) * WORTH_IT >= f64::from(max_us);
             let aim = p.aim * f64::from(p.full_scale);
             let reached = ranging.net(&last) * WORTH_IT * 1.01 >= aim;
             // Nothing between too little and too much.
             let times = f64::from(min_us)..=f64::from(max_us);
             let gap = !Gain::ALL.into_iter().any(|gain| times.contains(&(aim / (10_f64.powf(log_rate) * gain.factor()))));
             prop_assert!(most || reached || gap, "{last:?} is dim and could be had better");
            }
        }
    }

    #[test]
    fn too_faint_in_flight_is_what_was_exposed_for_a_brighter_one() {
        let file = rig("");
        let mut ranging = Ranging::new(&file);
        for gain in Gain::ALL {
            let integration_us = 1000;
            ranging.learn(&reading(
                &file,
                false,
                0.0,
                0.0,
                Exposure { integration_us, gain },
            ));
        }
        for rate in [1e-4, 0.01, 1.0] {
            let chosen = counts(&file, rate, brief(&file, rate, 1.0));
            assert!(!ranging.too_faint(&chosen), "{rate}: chosen for it, {chosen:?}");
            let brighter = counts(&file, rate, brief(&file, 1e4 * rate.max(0.01), 1.0));
            assert!(ranging.too_faint(&brighter), "{rate}: {brighter:?}");
        }
    }
}
