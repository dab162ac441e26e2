use glam::DVec3;

use crate::course::Course;
use crate::sweeps::{Point, Side};
use crate::{Error, Factor};

/// Half angle, rad, below which the lobe is interpolated linearly in θ_h and above which in ln θ_h.
const KNEE: f64 = 0.005;
/// A side whose first reading is farther out than this, rad, has its peak hidden by the arms.
const HIDDEN: f64 = 0.02;
/// What rounding may carry a half angle beyond the end of its own side, rad.
const ROUNDING: f64 = 1e-9;

/// G(θ_h, θ_d), the lobe relative to its peak, from the sides of planes and of other curves.
///
/// Along a side θ_h runs and θ_d follows from it. Elsewhere ln G is linear in θ_d between the sides next to it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lobe {
    curves: Vec<Curve>,
}

#[derive(Clone, Debug, PartialEq)]
struct Curve {
    course: Course,
    sign: f64,
    from: f64,
    to: f64,
    /// ln G over [`warped`] θ_h.
    log: Factor,
    /// ln f as it was read, over the same.
    read: Factor,
}

/// What a [`Lobe`] is made of, for one reading and for the peak.
pub(crate) struct Shown<G, R, P> {
    /// ln G of a reading.
    pub(crate) log_g: G,
    /// ln f of a reading.
    pub(crate) read: R,
    /// ln f of the peak at a difference angle, rad.
    pub(crate) peak: P,
}

impl Curve {
    /// θ_d of the curve at a half angle.
    #[inline]
    fn theta_d(&self, theta_h: f64) -> f64 {
        self.course.theta_d(self.sign * theta_h)
    }

    #[inline]
    fn covers(&self, theta_h: f64) -> bool {
        self.from - ROUNDING <= theta_h && theta_h <= self.to + ROUNDING
    }
}

/// A curve's θ_d at some half angle, and its index.
type Neighbour = Option<(f64, usize)>;

/// ln(1 + θ_h/knee).
#[inline]
pub(crate) fn warped(theta_h: f64) -> f64 {
    (theta_h / KNEE).ln_1p()
}

impl Lobe {
    /// The lobe of sides.
    ///
    /// A side that begins near the peak counts as known from there, with G = 1 at the peak itself if `tied`.
    pub(crate) fn new(
        sides: &[Side],
        tied: bool,
        shown: &Shown<impl Fn(&Point) -> DVec3, impl Fn(&Point) -> DVec3, impl Fn(f64) -> DVec3>,
    ) -> Result<Self, Error> {
        let curve = |side: &Side| {
            let x = |theta_h: f64| warped(theta_h.abs());
            let first = side.points[0].theta_h.abs();
            let from_peak = first < HIDDEN;
            // The peak itself, where the side has not read it.
            let added = |log: DVec3| (tied && from_peak && first > 0.0).then_some((x(0.0), log));
            let points = |log: &dyn Fn(&Point) -> DVec3| -> Vec<(f64, DVec3)> {
                side.points.iter().map(|p| (x(p.theta_h), log(p))).collect()
            };
            let (log, read) = (points(&shown.log_g), points(&shown.read));
            Ok(Curve {
                course: side.course.clone(),
                sign: side.sign,
                from: if from_peak { 0.0 } else { first },
                to: side.points[side.points.len() - 1].theta_h.abs(),
                log: Factor::new("G", added(DVec3::ZERO).into_iter().chain(log))?,
                read: Factor::new(
                    "G",
                    added((shown.peak)(side.course.theta_d(0.0)))
                        .into_iter()
                        .chain(read),
                )?,
            })
        };
        Ok(Self {
            curves: sides.iter().map(curve).collect::<Result<_, _>>()?,
        })
    }

    /// ln G; `without` names a curve that is not used.
    #[inline]
    pub(crate) fn log(&self, theta_h: f64, theta_d: f64, without: Option<usize>) -> DVec3 {
        let x = warped(theta_h);
        match self.neighbours(theta_h, theta_d, without) {
            (Some((low, a)), Some((high, b))) => {
                let [a, b] = [a, b].map(|n| self.curves[n].log.at(x));
                a.lerp(b, (theta_d - low) / (high - low))
            }
            (Some((_, n)), None) | (None, Some((_, n))) => self.curves[n].log.at(x),
            (None, None) => self
                .nearest(theta_h, without)
                .map_or(DVec3::ZERO, |n| self.curves[n].log.at(x)),
        }
    }

    /// ln f between the readings beside a place, and ln of the share that it is of the peak at its own difference angle,
    /// at most 0; between two sides both are linear in θ_d, as [`Lobe::log`] is. Also how far the nearest side is in θ_d,
    /// rad. `peak` gives ln f of the peak.
    #[inline]
    pub(crate) fn read(
        &self,
        theta_h: f64,
        theta_d: f64,
        without: Option<usize>,
        peak: impl Fn(f64) -> DVec3,
    ) -> ([DVec3; 2], f64) {
        let x = warped(theta_h);
        let at = |n: usize| {
            let curve = &self.curves[n];
            let (read, at) = (curve.read.at(x), curve.theta_d(theta_h));
            ([read, (read - peak(at)).min(DVec3::ZERO)], (theta_d - at).abs())
        };
        match self.neighbours(theta_h, theta_d, without) {
            (Some((low, a)), Some((high, b))) => {
                let share = (theta_d - low) / (high - low);
                let (([a, below_a], from_a), ([b, below_b], from_b)) = (at(a), at(b));
                (
                    [a.lerp(b, share), below_a.lerp(below_b, share)],
                    from_a.min(from_b),
                )
            }
            (Some((_, n)), None) | (None, Some((_, n))) => at(n),
            (None, None) => self
                .nearest(theta_h, without)
                .map_or(([DVec3::NEG_INFINITY, DVec3::ZERO], 0.0), at),
        }
    }

    /// The curves of which ln G is made at some place: one or two.
    pub(crate) fn beside(&self, theta_h: f64, theta_d: f64) -> impl Iterator<Item = usize> {
        let (below, above) = self.neighbours(theta_h, theta_d, None);
        let nearest = || self.nearest(theta_h, None);
        let alone = below.is_none() && above.is_none();
        let beside = below.into_iter().chain(above).map(|(_, n)| n);
        beside.chain(alone.then(nearest).flatten())
    }

    /// Of the curves that cover a half angle the next ones below and above a difference angle, each with its own.
    #[inline]
    fn neighbours(&self, theta_h: f64, theta_d: f64, without: Option<usize>) -> (Neighbour, Neighbour) {
        let mut below: Neighbour = None;
        let mut above: Neighbour = None;
        for (n, curve) in self.curves.iter().enumerate() {
            if Some(n) == without || !curve.covers(theta_h) {
                continue;
            }
            let at = curve.theta_d(theta_h);
            if at <= theta_d {
                if below.is_none_or(|(best, _)| at > best) {
                    below = Some((at, n));
                }
            } else if above.is_none_or(|(best, _)| at < best) {
                above = Some((at, n));
            }
        }
        (below, above)
    }

    /// The curve that ends nearest to a half angle which none covers.
    #[cold]
    fn nearest(&self, theta_h: f64, without: Option<usize>) -> Option<usize> {
        let gap = |n: usize| (self.curves[n].from - theta_h).max(theta_h - self.curves[n].to);
        let others = (0..self.curves.len()).filter(|&n| Some(n) != without);
        others.min_by(|&a, &b| gap(a).total_cmp(&gap(b)))
    }

    /// Whether any curve reaches this half angle.
    pub(crate) fn covers(&self, theta_h: f64) -> bool {
        self.curves.iter().any(|curve| curve.covers(theta_h))
    }

    /// The largest half angle of any curve but one; 0 where there is no other.
    pub(crate) fn reach_without(&self, without: usize) -> f64 {
        let others = self.curves.iter().enumerate().filter(|&(n, _)| n != without);
        others.map(|(_, curve)| curve.to).fold(0.0, f64::max)
    }

    /// Rows (θ_h in degrees, ln G) of every side, plane by plane, towards the normal first.
    pub(crate) fn rows(&self) -> impl Iterator<Item = Vec<(f64, DVec3)>> {
        self.curves.iter().map(|curve| {
            let row = |(x, log): (f64, DVec3)| ((KNEE * x.exp_m1()).to_degrees(), log);
            curve.log.points().map(row).collect()
        })
    }
}
