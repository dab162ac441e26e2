//! How far an estimate of a reflectance is from a reference: the one place in which the error metrics are defined.
//!
//! The functions that take a reference and an estimate give the error of one value, [`Tally`] sums them over many values,
//! and [`Metrics`] is what a tally comes to. [`crate::compare()`] draws the pairs of directions and fills tallies, and
//! [`spheres`] compares pictures. Reflectances are in sr⁻¹ and at
//! least 0; a tally of estimates that are not finite is not finite either.
//!
//! ```
//! use pdv::metric::{Tally, absolute_log_error, relative_error};
//!
//! // A reference of 0.5 and an estimate of 0.6 sr⁻¹ with the light at 60°.
//! assert!((absolute_log_error(0.5, 0.6, 0.5) - (1.3_f64 / 1.25).ln()).abs() < 1e-15);
//! assert!((relative_error(0.5, 0.6) - 0.2).abs() < 1e-15);
//!
//! let mut tally = Tally::new();
//! tally.add(0.5, 0.6, 0.5, 1.0);
//! assert!((tally.metrics(1, 1).rel_rms.unwrap() - 0.2).abs() < 1e-15);
//! ```

use glam::DVec3;
use serde::Serialize;

use crate::quantile::Quantiles;
pub use crate::spheres::{Spheres, spheres};

/// The floor of relative errors, sr⁻¹: what a photometer of this kind can tell from nothing.
pub const FLOOR_PER_SR: f64 = 1e-3;
/// ε of the log-relative mapping (Nielsen, Jensen, Ramamoorthi 2015), in sr⁻¹ and for the cosine weight.
pub const EPSILON: f64 = 1e-3;
/// A product of ratios is turned into a logarithm when it passes this: three more ratios of 1e13 each, the most that a
/// model can be off, still leave it finite.
const LARGE: f64 = 1e200;

/// Returns |ln(1 + f cos θ_i) − ln(1 + f̂ cos θ_i)|, whose mean is the MALE.
///
/// Written with one `ln_1p` of the difference, which keeps all digits where f is small and where f and f̂ are nearly
/// the same. Both reflectances are in sr⁻¹, at least 0 and at most 1e300, and the cosine is 0 … 1.
///
/// ```
/// // Below 1e-12 the logarithm of 1 + f would have no digits left.
/// let error = pdv::metric::absolute_log_error(1e-15, 3e-15, 1.0);
/// assert!((error / 2e-15 - 1.0).abs() < 1e-12);
/// ```
#[inline]
pub fn absolute_log_error(reference: f64, estimate: f64, cos_incident: f64) -> f64 {
    let smaller = reference.min(estimate);
    ((estimate - reference).abs() * cos_incident / (1.0 + smaller * cos_incident)).ln_1p()
}

/// Returns |f̂ − f|/max(f, [`FLOOR_PER_SR`]), whose median, 95th percentile and root mean square are metrics.
///
/// ```
/// assert_eq!(pdv::metric::relative_error(2.0, 3.0), 0.5);
/// // Below the floor the error is relative to the floor.
/// assert_eq!(pdv::metric::relative_error(0.0, 1e-3), 1.0);
/// ```
#[inline]
pub fn relative_error(reference: f64, estimate: f64) -> f64 {
    (estimate - reference).abs() / reference.max(FLOOR_PER_SR)
}

/// Returns ln((f̂ w + ε)/(f w + ε)) with w = max(cos θ_i cos θ_o, ε) and ε = [`EPSILON`], whose root mean square is the
/// log-relative RMSE.
///
/// ```
/// assert_eq!(pdv::metric::log_relative_error(0.2, 0.2, 0.7, 0.3), 0.0);
/// let faint = pdv::metric::log_relative_error(0.0, 1e-3, 1.0, 1.0);
/// assert!((faint - 2.0_f64.ln()).abs() < 1e-15);
/// ```
#[inline]
pub fn log_relative_error(reference: f64, estimate: f64, cos_incident: f64, cos_exitant: f64) -> f64 {
    let weight = (cos_incident * cos_exitant).max(EPSILON);
    let smaller = reference.min(estimate);
    // Of the larger by the smaller one, so that ln 0 is never near.
    let size = ((estimate - reference).abs() * weight / (smaller * weight + EPSILON)).ln_1p();
    if estimate < reference { -size } else { size }
}

/// Returns the value below which the share `q` of some values lies, 0 … 1, exactly and without sorting them all; `None`
/// of no values.
///
/// The values are reordered. What is no number counts as larger than all others.
///
/// ```
/// let mut values = [3.0, 1.0, 2.0, 4.0];
/// assert_eq!(pdv::metric::quantile(&mut values, 0.5), Some(3.0));
/// assert_eq!(pdv::metric::quantile(&mut [], 0.5), None);
/// ```
pub fn quantile(values: &mut [f64], q: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let at = ((q * values.len() as f64) as usize).min(last);
    Some(*values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Returns the relative error of Eq. 4 of the paper, √(Σ/n)/√N, of a sum Σ of n squared relative errors over N pairs of
/// directions, n/N being the number of channels; `None` of none.
///
/// It shrinks with N whatever the estimate: an estimate that is black everywhere has Σ = n and scores 1/√N.
///
/// ```
/// assert_eq!(pdv::metric::eq4(100.0, 100, 1), Some(0.1));
/// assert_eq!(pdv::metric::eq4(0.0, 0, 3), None);
/// ```
pub fn eq4(sum_of_squares: f64, positive: u64, channels: u64) -> Option<f64> {
    let count = positive as f64;
    (positive > 0).then(|| (sum_of_squares / count).sqrt() / (count / channels as f64).sqrt())
}

/// How far an estimate is from a reference.
///
/// All over the pairs that are valid in both. `None` where no pair is left.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// MALE: mean |ln(1 + f cos θ_i) − ln(1 + f̂ cos θ_i)|.
    pub male: Option<f64>,
    /// Median of |f̂ − f|/max(f, 1e-3 sr⁻¹), to 0.2 % of itself.
    pub median_rel: Option<f64>,
    /// 95th percentile of the same.
    pub p95_rel: Option<f64>,
    /// Root mean square of the same.
    pub rel_rms: Option<f64>,
    /// Root mean square of ln((f̂ w + ε)/(f w + ε)), w = max(cos θ_i cos θ_o, ε), ε = 1e-3.
    pub log_rel_rmse: Option<f64>,
    /// Eq. 4 of the paper, relRMS/√N without a floor. It shrinks with N whatever the estimate: see `eq4_black`.
    pub eq4: Option<f64>,
    /// What an all-zero estimate scores in Eq. 4: 1/√N.
    pub eq4_black: Option<f64>,
    /// N: pairs of Eq. 4, valid in both and with a reference above 0.
    pub pairs: u64,
    /// Share of the drawn pairs that are not among those N.
    pub left_out: f64,
}

/// Metrics per channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Channels {
    /// Red.
    pub r: Metrics,
    /// Green.
    pub g: Metrics,
    /// Blue.
    pub b: Metrics,
}

/// Running sums of all metrics over the values of one channel, or of several that are pooled, in constant memory.
#[derive(Clone, Debug)]
pub struct Tally {
    valid: u64,
    male: f64,
    squares: f64,
    log_squares: f64,
    relative: Quantiles,
    positive: u64,
    squares_without_floor: f64,
}

impl Default for Tally {
    fn default() -> Self {
        Self::new()
    }
}

impl Tally {
    /// A tally of nothing.
    pub fn new() -> Self {
        Self {
            valid: 0,
            male: 0.0,
            squares: 0.0,
            log_squares: 0.0,
            relative: Quantiles::new(),
            positive: 0,
            squares_without_floor: 0.0,
        }
    }

    /// Adds one value: reference and estimate in sr⁻¹, and the cosines of the zenith angles of light and viewer.
    #[inline]
    pub fn add(&mut self, reference: f64, estimate: f64, cos_incident: f64, cos_exitant: f64) {
        self.valid += 1;
        self.male += absolute_log_error(reference, estimate, cos_incident);
        let relative = relative_error(reference, estimate);
        self.squares += relative * relative;
        self.relative.add(relative);
        let log = log_relative_error(reference, estimate, cos_incident, cos_exitant);
        self.log_squares += log * log;
        if reference > 0.0 {
            self.positive += 1;
            self.squares_without_floor += ((estimate - reference) / reference).powi(2);
        }
    }

    /// Adds all values of another tally.
    pub fn merge(&mut self, other: &Self) {
        self.valid += other.valid;
        self.male += other.male;
        self.squares += other.squares;
        self.log_squares += other.log_squares;
        self.relative.merge(&other.relative);
        self.positive += other.positive;
        self.squares_without_floor += other.squares_without_floor;
    }

    /// The metrics of the values so far, of `drawn` pairs of directions with `channels` values each.
    pub fn metrics(&self, drawn: u64, channels: u64) -> Metrics {
        let n = self.valid as f64;
        let some = |value: f64| (self.valid > 0).then_some(value);
        let positive = self.positive as f64;
        Metrics {
            male: some(self.male / n),
            median_rel: some(self.relative.quantile(0.5)),
            p95_rel: some(self.relative.quantile(0.95)),
            rel_rms: some((self.squares / n).sqrt()),
            log_rel_rmse: some((self.log_squares / n).sqrt()),
            // One definition for both, so that a black estimate scores exactly what black scores.
            eq4: eq4(self.squares_without_floor, self.positive, channels),
            eq4_black: eq4(positive, self.positive, channels),
            pairs: self.positive / channels,
            left_out: 1.0 - positive / (drawn * channels).max(1) as f64,
        }
    }

    /// The metrics of three channels pooled, and of each by itself.
    pub fn of_channels(channels: &[Self; 3], drawn: u64) -> (Metrics, Channels) {
        let mut pooled = Self::new();
        channels.iter().for_each(|channel| pooled.merge(channel));
        let [r, g, b] = channels.each_ref().map(|channel| channel.metrics(drawn, 1));
        (pooled.metrics(drawn, 3), Channels { r, g, b })
    }
}

/// Running sums over all channels of what is a mean or a root mean square, for a hundred million pairs and more.
///
/// One logarithm serves many pairs, since ratios at least 1 are multiplied first; that costs 1e-16 of absolute error a
/// pair, which [`Tally`] does not have.
#[derive(Clone, Debug)]
pub struct PooledSums {
    valid: u64,
    /// Sum of |ln ratio| but for what is still in `ratios`.
    male: f64,
    /// Product of ratios ≥ 1.
    ratios: f64,
    squares: f64,
    positive: u64,
    squares_without_floor: f64,
}

impl Default for PooledSums {
    fn default() -> Self {
        Self {
            valid: 0,
            male: 0.0,
            ratios: 1.0,
            squares: 0.0,
            positive: 0,
            squares_without_floor: 0.0,
        }
    }
}

impl PooledSums {
    /// Adds a pair of directions: RGB of reference and estimate, at most 1e13 sr⁻¹, and the cosine of the light.
    #[inline]
    pub fn add(&mut self, reference: DVec3, estimate: DVec3, cos_incident: f64) {
        let (a, b) = (reference * cos_incident + 1.0, estimate * cos_incident + 1.0);
        self.ratios *= (a.max(b) / a.min(b)).element_product();
        if self.ratios > LARGE {
            self.male += self.ratios.ln();
            self.ratios = 1.0;
        }
        let error = estimate - reference;
        self.squares += (error / reference.max(DVec3::splat(FLOOR_PER_SR))).length_squared();
        let positive = reference.cmpgt(DVec3::ZERO);
        let relative = DVec3::select(positive, error / reference, DVec3::ZERO);
        self.squares_without_floor += relative.length_squared();
        self.positive += u64::from(positive.bitmask().count_ones());
        self.valid += 3;
    }

    /// Adds all pairs of other sums.
    pub fn merge(&mut self, other: &Self) {
        self.valid += other.valid;
        self.male += other.male + other.ratios.ln();
        self.squares += other.squares;
        self.positive += other.positive;
        self.squares_without_floor += other.squares_without_floor;
    }

    /// The metrics of the pairs so far, of `drawn` pairs; without quantiles and without the log-relative error.
    pub fn metrics(&self, drawn: u64) -> Metrics {
        let n = self.valid as f64;
        let some = |value: f64| (self.valid > 0).then_some(value);
        let positive = self.positive as f64;
        Metrics {
            male: some((self.male + self.ratios.ln()) / n),
            median_rel: None,
            p95_rel: None,
            rel_rms: some((self.squares / n).sqrt()),
            log_rel_rmse: None,
            eq4: eq4(self.squares_without_floor, self.positive, 3),
            eq4_black: eq4(positive, self.positive, 3),
            pairs: self.positive / 3,
            left_out: 1.0 - positive / (3 * drawn).max(1) as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Reflectances over all that a photometer and a mirror may give, 0 among them.
    fn reflectance() -> impl Strategy<Value = f64> {
        prop_oneof![
            1 => Just(0.0),
            9 => (-15.0..13.0_f64).prop_map(|log| 10_f64.powf(log)),
        ]
    }

    proptest! {
        #[test]
        fn prop_errors_are_zero_for_the_same_and_grow_with_the_difference(
            f in reflectance(), ratio in 1.0..10.0_f64, more in 1.0..10.0_f64, cos in 0.0..=1.0_f64, cos_o in 0.0..=1.0_f64,
        ) {
            let errors = |g: f64| [
                absolute_log_error(f, g, cos),
                relative_error(f, g),
                log_relative_error(f, g, cos, cos_o).abs(),
            ];
            prop_assert_eq!(errors(f), [0.0; 3]);
            for [near, far] in [[ratio, ratio * more], [1.0 / ratio, 1.0 / ratio / more], [1.0 / ratio, 0.0]] {
                for (near, far) in errors(f * near).into_iter().zip(errors(f * far)) {
                    prop_assert!(near.is_finite() && far.is_finite() && near <= far, "{} {}", near, far);
                }
            }
        }

        /// Swapped it is the same, and the triangle inequality holds: it is a distance.
        #[test]
        fn prop_the_absolute_log_error_is_a_distance(
            f in reflectance(), g in reflectance(), h in reflectance(), cos in 0.0..=1.0_f64,
        ) {
            let error = |a, b| absolute_log_error(a, b, cos);
            prop_assert_eq!(error(f, g), error(g, f));
            // Each has digits for 4e-16 of itself.
            prop_assert!(error(f, h) <= (error(f, g) + error(g, h)) * (1.0 + 1e-14));
        }

        #[test]
        fn prop_both_ways_to_sum_agree(
            pairs in prop::collection::vec(([reflectance(), reflectance(), reflectance()], -2.0..2.0_f64, 0.0..=1.0_f64), 1..300),
        ) {
            let (mut tally, mut pooled) = (Tally::new(), PooledSums::default());
            for (rgb, log, cos) in &pairs {
                let (f, g) = (DVec3::from_array(*rgb), DVec3::from_array(*rgb) * log.exp());
                for (f, g) in rgb.iter().zip(g.to_array()) {
                    tally.add(*f, g, *cos, 1.0);
                }
                pooled.add(f, g, *cos);
            }
            let drawn = pairs.len() as u64;
            let (one, other) = (tally.metrics(drawn, 3), pooled.metrics(drawn));
            prop_assert!((one.male.unwrap() - other.male.unwrap()).abs() < 1e-14);
            prop_assert!((one.rel_rms.unwrap() - other.rel_rms.unwrap()).abs() <= 1e-12 * one.rel_rms.unwrap());
            prop_assert_eq!((one.pairs, one.left_out), (other.pairs, other.left_out));
            prop_assert_eq!(one.eq4_black, other.eq4_black);
        }

        #[test]
        fn prop_the_quantile_is_that_of_sorting(values in prop::collection::vec(0.0..9.0_f64, 1..99), q in 0.0..=1.0_f64) {
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            let at = ((q * values.len() as f64) as usize).min(values.len() - 1);
            prop_assert_eq!(quantile(&mut values.clone(), q), Some(sorted[at]));
        }
    }

    #[test]
    fn a_tally_of_nothing_has_no_metrics() {
        let empty = Tally::new().metrics(10, 3);
        assert_eq!((empty.male, empty.median_rel, empty.eq4), (None, None, None));
        assert_eq!((empty.pairs, empty.left_out), (0, 1.0));
        assert_eq!(PooledSums::default().metrics(0).male, None);
    }
}
