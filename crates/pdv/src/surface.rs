use brdf::Brdf;
use glam::DVec3;

use crate::bisected::{Bisected, Pair, RISE};
use crate::lobe::Lobe;
use crate::model::Basis;
use crate::shape::Excess;
use crate::sweeps::{Point, Sweeps};
use crate::{Error, Factor, FactorTable, Shape};

/// ε of the errors by which a shape is chosen, sr⁻¹.
const EPSILON: f64 = 0.1;
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
        let lobe = |f: &Factor| {
            let ratio = |p: &Point| {
                let ratio = (log(p) / f.at(p.theta_d)).map(f64::ln);
                DVec3::select(black, DVec3::ZERO, ratio)
            };
            Lobe::new(&sweeps.sides, on_peak, ratio)
        };
        let mut g = lobe(&f)?;
        // An arc beside the peak is brought to it by the lobe, which changes the lobe in turn.
        for _ in 0..if on_peak { 0 } else { 3 } {
            let at_peak = |p: &Point| log(p) / g.log(p.theta_h.abs(), p.theta_d, None).map(f64::exp);
            f = Factor::new("F", sweeps.arc.iter().map(|p| (p.theta_d, at_peak(p))))?;
            g = lobe(&f)?;
        }
        Ok(Self {
            excess,
            f,
            lobe: g,
            closest: sweeps.points().map(|p| p.theta_d).fold(f64::INFINITY, f64::min),
        })
    }

    /// The reflectance of a pair in the plane, sr⁻¹; `without` names a side that is not used.
    #[inline]
    pub(crate) fn at(&self, pose: Bisected, without: Option<usize>) -> DVec3 {
        let g = self.lobe.log(pose.theta_h, pose.theta_d, without).map(f64::exp);
        self.excess
            .reflectance(g * self.f.at(pose.theta_d), pose.cosines())
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

impl Brdf for Surface {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        self.reflectance(&Pair::new(incident, exitant))
    }
}
