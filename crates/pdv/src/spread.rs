use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use crate::{Density, light_angle};

/// Bin whose E is the cap of [`Distribution::Capped`]: d_p = 0.01, the width of the narrowest lobe that an aperture
/// of half a degree lets through at 70°. Denser readings than there would tell nothing new. Where that would still put
/// readings closer than the spacing, the cap goes on to the first bin that does not.
const CAP_BIN: usize = 10;
/// Share of the readings that [`Distribution::Capped`] spreads evenly, so that the flat part of a BRDF is not left
/// to interpolation alone.
const UNIFORM_SHARE: f64 = 0.25;
/// k of [`Distribution::Lobe`], rad: below the width of all but a mirror's lobe, of which an aperture leaves no less.
const LOBE_KNEE_RAD: f64 = 0.0035;
/// Pieces of a side in [`Distribution::Lobe`].
const LOBE_PIECES: usize = 256;

/// How the d_p of a plane are distributed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Distribution {
    /// Inverse CDF of the capped mean of the MERL materials mixed with a uniform share.
    #[default]
    Capped,
    /// Inverse CDF of Eq. 1 of the paper as it stands.
    Paper,
    /// Evenly over the reachable range.
    Uniform,
    /// Even steps of ln(1 + θ_h/k) over the half angle θ_h, whatever the material: few readings describe a lobe of any
    /// width. k is 0.2°, or where that would put readings closer than the spacing the least that does not.
    Lobe,
}

impl Distribution {
    /// As job files name it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Capped => "capped",
            Self::Paper => "paper",
            Self::Uniform => "uniform",
            Self::Lobe => "lobe",
        }
    }
}

/// Where the readings of a plane are to be taken.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spread {
    /// Signed deviations from the mirror direction, ascending, within the reachable ranges; positive towards the
    /// normal (φ_p = 0), negative outwards (φ_p = π).
    pub deviations: Vec<f64>,
    /// Readings that were asked for and fell together with others, being closer than the spacing.
    pub merged: usize,
}

/// Spreads `readings` readings of a plane at `theta_r` (rad) over the reachable ranges of signed deviation.
///
/// They stand at even steps of the distribution's CDF over |D|, from the mirror direction, which is among them where
/// it is reachable, to the outermost ends. Two are nowhere closer than `spacing_rad` in the angle of the light arm:
/// those that would be are merged and counted, so there may be fewer than asked for. Total: ranges that are empty,
/// not finite or off the disk are ignored.
///
/// ```
/// use pdv::{Distribution, spread};
///
/// let theta_r = 0.5_f64;
/// let reach = theta_r.sin() - 0.99..=theta_r.sin() + 0.99;
/// let found = spread(Distribution::Lobe, theta_r, &[reach], 20, 1.5e-3);
/// assert_eq!((found.deviations.len(), found.merged), (20, 0));
/// assert!(found.deviations.contains(&0.0), "the mirror direction is read");
/// ```
pub fn spread(
    distribution: Distribution,
    theta_r: f64,
    reachable: &[RangeInclusive<f64>],
    readings: usize,
    spacing_rad: f64,
) -> Spread {
    let sin = theta_r.sin();
    let mut ranges: Vec<(f64, f64)> = reachable
        .iter()
        .map(|range| (range.start().max(sin - 1.0), range.end().min(sin + 1.0)))
        .filter(|(low, high)| low <= high && (high - low).is_finite())
        .collect();
    ranges.sort_by(|a, b| a.0.total_cmp(&b.0));
    if ranges.is_empty() {
        return Spread {
            deviations: Vec::new(),
            merged: readings,
        };
    }
    let pieces = match distribution {
        Distribution::Capped => capped(&ranges, sin, readings as f64 * spacing_rad),
        Distribution::Paper => pieces(&ranges, f64::INFINITY, 0.0),
        Distribution::Uniform => pieces(&ranges, 0.0, 1.0),
        Distribution::Lobe => lobe(theta_r, &ranges, readings, spacing_rad),
    };
    let mut kept = Kept {
        theta_r,
        spacing_rad,
        angles: Vec::new(),
        deviations: Vec::new(),
    };
    // The mirror direction and the ends first, for whoever comes later gives way.
    if ranges.iter().any(|&(low, high)| low <= 0.0 && 0.0 <= high) && readings > 0 {
        kept.insert(0.0);
    }
    let mut targets: Vec<f64> = steps(&pieces, readings)
        .map(|mass| quantile(&pieces, mass))
        .collect();
    if targets.len() > 2 {
        let last = targets.len() - 1;
        targets.swap(1, last);
    }
    for target in targets {
        if kept.deviations.len() < readings {
            kept.insert(target);
        }
    }
    Spread {
        merged: readings - kept.deviations.len(),
        deviations: kept.deviations,
    }
}

/// Even steps of mass, ascending: on either side of the mirror direction from there to the end, shared by the mass
/// of the sides; over all where only one side is reachable.
fn steps(pieces: &[Piece], readings: usize) -> impl Iterator<Item = f64> {
    let mass: f64 = pieces.iter().map(Piece::mass).sum();
    let outwards: f64 = pieces
        .iter()
        .filter(|piece| piece.low < 0.0)
        .map(Piece::mass)
        .sum();
    let intervals = readings.saturating_sub(1);
    let mut below = (intervals as f64 * outwards / mass.max(f64::MIN_POSITIVE)).round() as usize;
    if outwards > 0.0 && outwards < mass && intervals > 1 {
        below = below.clamp(1, intervals - 1);
    }
    (0..readings).map(move |n| match n {
        _ if intervals == 0 => mass / 2.0,
        // The very end, also where the density fades out before it.
        n if n == intervals => f64::INFINITY,
        n if n < below => outwards * n as f64 / below as f64,
        n if below == intervals => mass * n as f64 / intervals as f64,
        n => outwards + (mass - outwards) * (n - below) as f64 / (intervals - below) as f64,
    })
}

/// Deviations kept so far, ascending, with the angles of the light arm that belong to them.
struct Kept {
    theta_r: f64,
    spacing_rad: f64,
    angles: Vec<f64>,
    deviations: Vec<f64>,
}

impl Kept {
    fn insert(&mut self, deviation: f64) {
        let Some(angle) = light_angle(self.theta_r, deviation) else {
            return;
        };
        let at = self.angles.partition_point(|&kept| kept < angle);
        let near = |kept: Option<&f64>| kept.is_some_and(|kept| (kept - angle).abs() < self.spacing_rad);
        let same = self.angles.get(at) == Some(&angle);
        if same || near(self.angles.get(at)) || near(at.checked_sub(1).and_then(|at| self.angles.get(at))) {
            return;
        }
        self.angles.insert(at, angle);
        self.deviations.insert(at, deviation);
    }
}

/// A stretch of signed deviation with constant density.
struct Piece {
    low: f64,
    high: f64,
    density: f64,
}

impl Piece {
    fn mass(&self) -> f64 {
        (self.high - self.low) * self.density
    }
}

/// The capped density. `taken_rad` is the arm's way that the readings take where they are as close as they may be.
fn capped(ranges: &[(f64, f64)], sin_r: f64, taken_rad: f64) -> Vec<Piece> {
    let bins = Density::stored().bins();
    let at = |bin: usize| pieces(ranges, bins[bin], UNIFORM_SHARE);
    // dD = cos α dα; a few per cent to spare, for either side gets a whole number of readings.
    let cos = |deviation: f64| (1.0 - (deviation - sin_r).powi(2)).max(0.0).sqrt();
    let way = |piece: &Piece| 1.05 * taken_rad * cos(piece.low).max(cos(piece.high));
    let crowds = |pieces: &[Piece]| pieces.iter().any(|piece| piece.density * way(piece) > 1.0);
    // E falls with d_p, and with it the density at the mirror direction; a few per cent at a time.
    let mut bin = CAP_BIN;
    let mut pieces = at(bin);
    while crowds(&pieces) && bin < Density::BINS / 2 {
        bin += 1 + bin / 32;
        pieces = at(bin);
    }
    pieces
}

/// Pieces of equal steps of ln(1 + θ_h/k) on either side of the mirror direction; the readings are shared by the
/// half angles that the sides reach, for a lobe is as wide on both.
fn lobe(theta_r: f64, ranges: &[(f64, f64)], readings: usize, spacing_rad: f64) -> Vec<Piece> {
    let half = |deviation: f64| light_angle(theta_r, deviation).map_or(0.0, |alpha| 0.5 * (alpha + theta_r));
    let ends = [ranges[0].0, ranges[ranges.len() - 1].1].map(half);
    let reach = ends[1].max(0.0) - ends[0].min(0.0);
    // A step of the light arm is two of the half angle; some to spare, for either side gets a whole number.
    let closest = 0.6 * spacing_rad;
    let crowds = |knee: f64| {
        let end = ends[1].max(-ends[0]).max(0.0);
        let share = readings as f64 * end / reach.max(f64::MIN_POSITIVE);
        knee * ((end / knee).ln_1p() / share.max(1.0)).exp_m1() < closest
    };
    let mut knee = LOBE_KNEE_RAD;
    while crowds(knee) && knee < 10.0 {
        knee *= 1.25;
    }
    let side = |end: f64| {
        let steps = (end.abs() / knee).ln_1p() / LOBE_PIECES as f64;
        (0..LOBE_PIECES).map(move |n| {
            let [near, far] = [n, n + 1].map(|n| end.signum() * knee * (n as f64 * steps).exp_m1());
            let at = |half: f64| (2.0 * half - theta_r).sin() + theta_r.sin();
            (
                at(near.min(far)),
                at(near.max(far)),
                end.abs() / LOBE_PIECES as f64,
            )
        })
    };
    let outwards = side(ends[0].min(0.0)).collect::<Vec<_>>();
    let all = outwards.into_iter().rev().chain(side(ends[1].max(0.0)));
    let cut = |(low, high, mass): (f64, f64, f64)| {
        let density = mass / (high - low);
        ranges.iter().filter_map(move |range| {
            let (low, high) = (low.max(range.0), high.min(range.1));
            (low < high).then_some(Piece { low, high, density })
        })
    };
    let found: Vec<Piece> = all.flat_map(cut).collect();
    // A range of one point has no length to be cut.
    if found.is_empty() {
        pieces(ranges, 0.0, 1.0)
    } else {
        found
    }
}

/// The ranges with the density min(E, cap) mixed with a uniform share, of mass 1.
fn pieces(ranges: &[(f64, f64)], cap: f64, share: f64) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = ranges
        .iter()
        .flat_map(|&(low, high)| bin_pieces(low, high, cap))
        .collect();
    let length: f64 = ranges.iter().map(|(low, high)| high - low).sum();
    let mass: f64 = pieces.iter().map(Piece::mass).sum();
    for piece in &mut pieces {
        let shaped = if mass > 0.0 { piece.density / mass } else { 0.0 };
        piece.density = (1.0 - share) * shaped + share / length.max(f64::MIN_POSITIVE);
    }
    pieces
}

/// A range cut at the borders of the bins of |D|, each piece with the E of its bin, at most `cap`.
fn bin_pieces(low: f64, high: f64, cap: f64) -> impl Iterator<Item = Piece> {
    let bins = Density::stored().bins();
    let first = (low / Density::WIDTH).floor() as i64;
    let last = (high / Density::WIDTH).floor() as i64;
    (first..=last).map(move |bin| {
        let at = if bin < 0 { -1 - bin } else { bin } as usize;
        Piece {
            low: low.max(bin as f64 * Density::WIDTH),
            high: high.min((bin + 1) as f64 * Density::WIDTH),
            density: bins.get(at).copied().unwrap_or(0.0).min(cap),
        }
    })
}

/// The deviation below which `mass` lies.
fn quantile(pieces: &[Piece], mut mass: f64) -> f64 {
    for piece in pieces {
        if mass <= piece.mass() {
            return if piece.density > 0.0 {
                piece.low + mass / piece.density
            } else {
                piece.low
            };
        }
        mass -= piece.mass();
    }
    pieces.last().map_or(0.0, |piece| piece.high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const COUNT_RAD: f64 = std::f64::consts::TAU / 4096.0;
    const ALL: [Distribution; 4] = [
        Distribution::Capped,
        Distribution::Paper,
        Distribution::Uniform,
        Distribution::Lobe,
    ];

    fn seventy(distribution: Distribution, readings: usize) -> Spread {
        let theta_r = 70.0_f64.to_radians();
        let range = theta_r.sin() - 85.0_f64.to_radians().sin()..=theta_r.sin() + 65.0_f64.to_radians().sin();
        spread(distribution, theta_r, &[range], readings, COUNT_RAD)
    }

    #[test]
    fn the_raw_distribution_merges_readings_and_the_capped_one_does_not() {
        assert!(
            seventy(Distribution::Paper, 90).merged > 40,
            "{:?}",
            seventy(Distribution::Paper, 90)
        );
        assert_eq!(seventy(Distribution::Capped, 90).merged, 0);
        assert_eq!(seventy(Distribution::Uniform, 90).merged, 0);
        assert_eq!(seventy(Distribution::Capped, 90).deviations.len(), 90);
        // On one side alone the cap has to give way.
        let (theta_r, one_side) = (1.2_f64, 0.0..=1.9);
        assert_eq!(
            spread(Distribution::Capped, theta_r, &[one_side], 180, COUNT_RAD).merged,
            0
        );
    }

    #[test]
    fn the_mirror_direction_and_the_ends_are_read() {
        for distribution in ALL {
            let spread = seventy(distribution, 90).deviations;
            assert!(spread.contains(&0.0), "{distribution:?}");
            let sin = |deg: f64| deg.to_radians().sin();
            assert!(
                (spread[0] - (sin(70.0) - sin(85.0))).abs() < 1e-12,
                "{distribution:?}"
            );
            assert!(
                (spread[spread.len() - 1] - (sin(70.0) + sin(65.0))).abs() < 1e-12,
                "{distribution:?}"
            );
        }
    }

    #[test]
    fn odd_requests_are_answered() {
        for distribution in ALL {
            assert_eq!(
                spread(distribution, 0.5, &[], 5, COUNT_RAD),
                Spread {
                    deviations: vec![],
                    merged: 5
                }
            );
            assert_eq!(spread(distribution, 0.5, &[0.1..=0.1], 1, 0.0).deviations, [0.1]);
            assert_eq!(
                spread(distribution, 0.5, &[-0.1..=0.1], 0, 0.0),
                Spread::default()
            );
            assert_eq!(
                spread(distribution, 0.5, &[f64::NAN..=1.0], 0, 0.0),
                Spread::default()
            );
        }
    }

    proptest! {
        #[test]
        fn prop_readings_are_reachable_ascending_and_apart(
            kind in 0_usize..4,
            theta_r in 0.0_f64..1.5,
            first in (-0.5_f64..0.0, 0.0_f64..0.6),
            second in (0.7_f64..1.0, 1.0_f64..2.0),
            readings in 0_usize..300,
            counts in 0.0_f64..4.0,
        ) {
            let ranges = [first.0..=first.1, second.0..=second.1];
            let spacing = counts * COUNT_RAD;
            let spread = spread(ALL[kind], theta_r, &ranges, readings, spacing);
            prop_assert_eq!(spread.deviations.len() + spread.merged, readings);
            let inside = |d: &f64| ranges.iter().any(|range| *range.start() - 1e-12 <= *d && *d <= *range.end() + 1e-12);
            prop_assert!(spread.deviations.iter().all(inside), "{:?}", spread);
            let angles: Vec<f64> =
                spread.deviations.iter().map(|&d| light_angle(theta_r, d).expect("on the disk")).collect();
            prop_assert!(angles.windows(2).all(|w| w[1] - w[0] >= spacing && w[1] > w[0]), "{:?}", angles);
        }
    }
}
