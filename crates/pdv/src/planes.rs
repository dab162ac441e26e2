use brdf::{Brdf, HalfDifference};
use glam::DVec3;

use crate::lobe::Lobe;
use crate::shape::Excess;
use crate::sweeps::{Point, Sweeps};
use crate::{Error, Factor, FactorTable, Model, Observation, Shape};

/// ε of the errors by which a shape is chosen, sr⁻¹.
const EPSILON: f64 = 0.1;
/// How far from the peak, rad, an arc may be read and count as the peak.
const ON_PEAK: f64 = 1e-6;

/// A reciprocal BRDF of one or more planes and an arc.
///
/// f = A (cos θ_i cos θ_o)^κ + s V expm1(G(θ_h, θ_d)·F(θ_d)), V = 1/((c_i(1−a)+a)(c_o(1−a)+a)): a diffuse floor and a
/// lobe G over the half angle whose peak F is read on the arc, where θ_h = 0 and θ_i = θ_o = θ_d. For s → ∞ it is the
/// product of lobe and Fresnel-like arc; below that a power law whose lobe narrows as its peak rises, as the paper's
/// Eq. 3 (s = 1, A = 0, V = 1). Everything depends on θ_h, θ_d and the product of the cosines, so that light and
/// viewer may be swapped.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    excess: Excess,
    /// F over θ_d, rad.
    f: Factor,
    /// G over θ_h and θ_d.
    lobe: Lobe,
    error: Option<f64>,
    dropped: usize,
}

impl Planes {
    /// The model of planes and an arc, with the shape that best predicts each side of each plane from the others.
    ///
    /// Readings that are not finite or where no light can stand are dropped and counted, negative ones count as 0,
    /// several at one pose are averaged. Without an arc the planes' own peaks take its place. Where there are no two
    /// sides to compare the shape is [`Shape::DEFAULT`].
    ///
    /// # Errors
    /// No usable reading of any plane, none of an arc that is not empty, or θ_r within a plane that differ by more
    /// than 0.02 rad.
    pub fn from_observations(planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Self, Error> {
        let sweeps = Sweeps::new(planes, arc)?;
        crate::choice::choose(&sweeps)
    }

    /// The model of some shape.
    pub(crate) fn new(sweeps: &Sweeps, shape: Shape) -> Result<Self, Error> {
        let black = sweeps.least.cmpeq(DVec3::ZERO);
        let excess = Excess::new(shape, sweeps.least, sweeps.points());
        let log = |p: &Point| excess.log(p.rgb, p.cos_i, p.cos_o);
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
            error: None,
            dropped: sweeps.dropped,
        })
    }

    pub(crate) fn with_error(self, error: Option<f64>) -> Self {
        Self { error, ..self }
    }

    #[inline]
    fn at(&self, [theta_h, theta_d]: [f64; 2], [cos_i, cos_o]: [f64; 2], without: Option<usize>) -> DVec3 {
        let g = self.lobe.log(theta_h, theta_d, without).map(f64::exp);
        self.excess.reflectance(g * self.f.at(theta_d), cos_i, cos_o)
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
                let found = self.at([p.theta_h.abs(), p.theta_d], [p.cos_i, p.cos_o], Some(n));
                let log = |rgb: DVec3| (rgb * p.cos_i + EPSILON).map(f64::ln);
                errors += weight * (log(found) - log(p.rgb)).abs().element_sum() / 3.0;
                weights += weight;
            }
            if weights > 0.0 {
                sum += errors / weights;
                sides += 1.0;
            }
        }
        (sides > 1.0).then(|| sum / sides)
    }

    /// The shape that was chosen.
    pub fn shape(&self) -> Shape {
        self.excess.shape
    }

    /// A, the diffuse floor towards the normal, sr⁻¹.
    pub fn diffuse(&self) -> DVec3 {
        self.excess.diffuse
    }

    /// How far each side of a plane is from what the others predict: the mean of
    /// |ln(f̂ cos θ_i + 0.1) − ln(f cos θ_i + 0.1)|; `None` where there was but one side.
    pub fn error(&self) -> Option<f64> {
        self.error
    }

    /// Readings that were not finite, or where no light can stand.
    pub fn dropped(&self) -> usize {
        self.dropped
    }
}

impl Brdf for Planes {
    #[inline]
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        self.at(angles(incident, exitant), [incident.z, exitant.z], None)
    }
}

impl Model for Planes {
    fn extrapolated(&self, incident: DVec3, exitant: DVec3) -> bool {
        let [theta_h, theta_d] = angles(incident, exitant);
        !self.lobe.covers(theta_h) || self.f.extrapolated(theta_d)
    }

    fn about(&self) -> String {
        let Shape {
            scale,
            diffuse,
            shadowing,
            darkening,
        } = self.shape();
        let why = self.error.map_or_else(
            || "a moderate shape, taken untested, for there are no two sides to compare".to_owned(),
            |error| {
                format!(
                    "the shape with which its sides predict each other best, to {error:.4} in ln(f cos + 0.1)"
                )
            },
        );
        format!(
            "the reciprocal model of {} sides of planes and an arc, with {why}: s = {scale:.3} 1/sr, q = {diffuse:.2}, \
             a = {shadowing:.2}, κ = {darkening:.2}; {} readings dropped",
            self.lobe.rows().count(),
            self.dropped
        )
    }

    fn factors(&self) -> Vec<FactorTable> {
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

/// θ_h and θ_d of two unit vectors, rad; the same to the last bit where they are swapped.
#[inline]
fn angles(incident: DVec3, exitant: DVec3) -> [f64; 2] {
    let half = HalfDifference::from_directions(incident, exitant);
    [half.theta_h, half.theta_d]
}
