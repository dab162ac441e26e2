use brdf::Brdf;
use glam::DVec3;

use crate::bisected::{Bisected, Pair, RISE};
use crate::lobe::{Lobe, Shown};
use crate::model::Basis;
use crate::shape::Excess;
use crate::sweeps::{Point, Sweeps};
use crate::{Error, Factor, FactorTable, Shape};

/// ε of the errors by which a shape is chosen, sr⁻¹.
const EPSILON: f64 = 0.1;
/// How far, as a factor, f may lie above what the readings beside it allow. From 1.3 on the accuracy on the fitted
/// materials does not depend on it: `cargo run --release -p pdv --example accuracy`.
const ABOVE: f64 = 2.0;
/// In how much difference angle from the nearest side, rad, that factor doubles: with one plane f is carried far, and may
/// well rise on the way. Below it the mean over a single plane at 30° suffers by a hundredth.
const DOUBLES: f64 = 0.4;
/// A channel in which G·F rises to so many times its peak, farther than [`OFF_PEAK`] from it, has no lobe. The least of 2,
/// 5, 10 and 30 at which the example's means over materials with lobes stay as they are.
const WITHOUT_LOBE: f64 = 30.0;
/// How far from the peak, rad, a reading says that there is no lobe.
const OFF_PEAK: f64 = 0.02;
/// θ_h, rad, at which the peak of a channel without a lobe has lost half of its say. Of 0.03, 0.05 and 0.1 the first two
/// are best for a vinyl that was measured, by a hundredth; `a_channel_that_vanishes_at_the_peak_is_followed` stands for it.
const FADED: f64 = 0.05;
/// How far from the peak, rad, an arc may be read and count as the peak.
const ON_PEAK: f64 = 1e-6;
/// What rounding may carry a difference angle below the smallest that was read, rad.
const ROUNDING: f64 = 1e-9;

/// The reflectance of pairs in one plane with the normal, from the readings, and what follows from it for all others.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Surface {
    pub(crate) excess: Excess,
    /// F over θ_d, rad.
    pub(crate) f: Factor,
    /// How fast F loses its say with θ_h², rad⁻²: 0 in a channel with a lobe.
    fade: DVec3,
    /// ln f of the peak over θ_d, rad.
    peak: Factor,
    /// The most that any value may be, sr⁻¹.
    ceiling: DVec3,
    /// G over θ_h and θ_d.
    pub(crate) lobe: Lobe,
    /// The smallest θ_d, rad, that was read: nothing is known closer to retro-reflection.
    closest: f64,
}

impl Surface {
    /// The surface of some shape.
    pub(crate) fn new(sweeps: &Sweeps, shape: Shape) -> Result<Self, Error> {
        let black = sweeps.least.cmpeq(DVec3::ZERO);
        let excess = Excess::new(shape, sweeps.least, sweeps.points());
        let log = |p: &Point| excess.log(p.rgb, p.cosines);
        let on_peak = sweeps.arc.iter().all(|p| p.theta_h.abs() < ON_PEAK);
        let mut f = Factor::new("F", sweeps.arc.iter().map(|p| (p.theta_d, log(p))))?;
        let fade = fade(sweeps, |p| log(p) / f.at(p.theta_d));
        let brightest = sweeps.points().fold(excess.least, |most, p| most.max(p.rgb));
        let read = |p: &Point| ln(p.rgb.max(excess.least));
        let lobe = |f: &Factor, peak: &Factor| {
            let log_g = |p: &Point| {
                let ratio = if fade == DVec3::ZERO {
                    (log(p) / f.at(p.theta_d)).map(f64::ln)
                } else {
                    log(p).map(f64::ln) - say(fade, p.theta_h) * f.at(p.theta_d).map(f64::ln)
                };
                DVec3::select(black, DVec3::ZERO, ratio)
            };
            let peak = |theta_d: f64| peak.at(theta_d);
            Lobe::new(&sweeps.sides, on_peak, &Shown { log_g, read, peak })
        };
        let mut peak = Factor::new("F", sweeps.arc.iter().map(|p| (p.theta_d, read(p))))?;
        let mut g = lobe(&f, &peak)?;
        // An arc beside the peak is brought to it by the lobe, which changes the lobe in turn.
        for _ in 0..if on_peak { 0 } else { 3 } {
            let at_peak = |p: &Point| log(p) / g.log(p.theta_h.abs(), p.theta_d, None).map(f64::exp);
            f = Factor::new("F", sweeps.arc.iter().map(|p| (p.theta_d, at_peak(p))))?;
            let rgb = |theta_d: f64, log: DVec3| {
                let theta_h = 0.0;
                excess.reflectance(log, Bisected { theta_h, theta_d }.cosines())
            };
            let points = f.points().map(|(theta_d, log)| (theta_d, rgb(theta_d, log)));
            let points = points.map(|(theta_d, rgb)| (theta_d, ln(rgb.min(brightest))));
            peak = Factor::new("F", points)?;
            g = lobe(&f, &peak)?;
        }
        Ok(Self {
            excess,
            f,
            fade,
            peak,
            ceiling: ABOVE * brightest,
            lobe: g,
            closest: sweeps.points().map(|p| p.theta_d).fold(f64::INFINITY, f64::min),
        })
    }

    /// The reflectance of a pair in the plane, sr⁻¹; `without` names a side that is not used.
    #[inline]
    pub(crate) fn at(&self, pose: Bisected, without: Option<usize>) -> DVec3 {
        let log_g = self.lobe.log(pose.theta_h, pose.theta_d, without);
        let f = self.f.at(pose.theta_d);
        let log = if self.fade == DVec3::ZERO {
            log_g.map(f64::exp) * f
        } else {
            // F is 0 in a black channel alone.
            (log_g + say(self.fade, pose.theta_h) * ln(f)).map(f64::exp)
        };
        self.excess
            .reflectance(log, pose.cosines())
            .min(self.most(pose, without))
    }

    /// The most that the readings beside a pair in the plane allow, sr⁻¹.
    ///
    /// That is [`ABOVE`] times what lies between the readings at the same half angle, or, where that is brighter, the
    /// same share of the peak at the pair's own difference angle as they are of the peak at theirs, at most all of it. The
    /// farther the next side, the more is allowed, up to [`ABOVE`] times the brightest reading.
    #[inline]
    fn most(&self, pose: Bisected, without: Option<usize>) -> DVec3 {
        let peak = |theta_d: f64| self.peak.at(theta_d);
        let ([read, share], far) = self.lobe.read(pose.theta_h, pose.theta_d, without, peak);
        let most = ABOVE * (far / DOUBLES).exp2() * read.max(peak(pose.theta_d) + share).map(f64::exp);
        most.min(self.ceiling)
    }

    /// The reflectance of any pair, sr⁻¹.
    pub(crate) fn reflectance(&self, pair: &Pair) -> DVec3 {
        let near = self.at(pair.same_half(), None);
        let far = self.at(pair.same_difference(), None);
        let channel = |near: f64, far: f64| {
            // Black stays black; else the ratio is a number, for a surface has no other zero.
            let rise = if near > 0.0 { RISE * (far / near).ln() } else { 0.0 };
            near * rise.clamp(0.0, pair.most()).exp()
        };
        DVec3::new(
            channel(near.x, far.x),
            channel(near.y, far.y),
            channel(near.z, far.z),
        )
    }

    /// How well each side is predicted by the others: mean over sides, channels and half angles of
    /// |ln(f̂ cos θ_i + ε) − ln(f cos θ_i + ε)|. `None` where nothing can be compared.
    pub(crate) fn cross_validate(&self, sweeps: &Sweeps) -> Option<f64> {
        let (mut sum, mut sides) = (0.0, 0.0);
        for (n, side) in sweeps.sides.iter().enumerate() {
            let reach = self.lobe.reach_without(n) + 1e-9;
            let points: Vec<&Point> = side.points.iter().filter(|p| p.theta_h.abs() <= reach).collect();
            let (mut errors, mut weights) = (0.0, 0.0);
            for (at, p) in points.iter().enumerate() {
                let next = points[(at + 1).min(points.len() - 1)].theta_h.abs();
                let weight = next - points[at.saturating_sub(1)].theta_h.abs();
                let [found, read] =
                    [self.at(p.bisected(), Some(n)), p.rgb].map(|rgb| rgb * p.cos_i + EPSILON);
                errors += weight * (found / read).map(f64::ln).abs().element_sum() / 3.0;
                weights += weight;
            }
            if weights > 0.0 {
                sum += errors / weights;
                sides += 1.0;
            }
        }
        (sides > 1.0).then(|| sum / sides)
    }

    /// What a pair in the plane rests on.
    pub(crate) fn basis(&self, pose: Bisected) -> Basis {
        let closer = pose.theta_d < self.closest - ROUNDING;
        match closer || !self.lobe.covers(pose.theta_h) || self.f.extrapolated(pose.theta_d) {
            true => Basis::Extrapolated,
            false => Basis::Interpolated,
        }
    }

    /// The one-dimensional factors, for people and files.
    pub(crate) fn factors(&self) -> Vec<FactorTable> {
        let degrees = |(theta, value): (f64, DVec3)| (theta.to_degrees(), value);
        let f = FactorTable {
            name: "F",
            variable: "theta_d_deg",
            rows: self.f.points().map(degrees).collect(),
        };
        let side = |rows: Vec<(f64, DVec3)>| FactorTable {
            name: "G",
            variable: "theta_h_deg",
            rows: rows
                .into_iter()
                .map(|(theta_h, log)| (theta_h, log.map(f64::exp)))
                .collect(),
        };
        std::iter::once(f).chain(self.lobe.rows().map(side)).collect()
    }
}

/// The logarithm of RGB, and of 0 that of the smallest number.
#[inline]
fn ln(rgb: DVec3) -> DVec3 {
    rgb.map(|value| value.max(f64::MIN_POSITIVE).ln())
}

/// The power of F at a half angle: 1 at the peak, and everywhere in a channel with a lobe.
#[inline]
fn say(fade: DVec3, theta_h: f64) -> DVec3 {
    (DVec3::ONE + fade * (theta_h * theta_h)).recip()
}

/// How fast F loses its say, of the ratios of readings to the peak at their difference angle.
fn fade(sweeps: &Sweeps, ratio: impl Fn(&Point) -> DVec3) -> DVec3 {
    let off_peak = sweeps.sides.iter().flat_map(|side| &side.points);
    let highest = off_peak
        .filter(|p| p.theta_h.abs() > OFF_PEAK)
        // 0/0 in a black channel is no number, and passed over.
        .fold(DVec3::ZERO, |most, p| most.max(ratio(p)));
    let without = highest.cmpgt(DVec3::splat(WITHOUT_LOBE));
    DVec3::select(without, DVec3::splat(FADED.powi(-2)), DVec3::ZERO)
}

impl Brdf for Surface {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        self.reflectance(&Pair::new(incident, exitant))
    }
}
