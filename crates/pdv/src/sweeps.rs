use glam::DVec3;

use crate::bisected::{Bisected, Cosines};
use crate::course::Course;
use crate::lobe::warped;
use crate::{Error, Observation, light_angle};

/// Readings closer than this in half angle, rad, are one pose and averaged.
const SAME: f64 = 1e-7;
/// Readings of a curve along which both arms move are taken in flight, as dense as they come: those closer than this in
/// ln(1 + θ_h/knee) are averaged.
const DENSE: f64 = 0.06;
/// The least reflectance, sr⁻¹, that is told from black.
const LEAST: f64 = 1e-9;
/// Near the peak a reading of less than this share of the faintest one far from it is black: a channel that vanishes at the
/// peak is not followed through more decades than it has elsewhere.
const TOLD: f64 = 1e-3;

/// A reading by its half and difference angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    /// Angle between half vector and normal, rad; negative where the light stands outwards of the mirror direction.
    pub(crate) theta_h: f64,
    /// Half the angle between the directions, rad.
    pub(crate) theta_d: f64,
    /// cos θ_i.
    pub(crate) cos_i: f64,
    /// Of both directions.
    pub(crate) cosines: Cosines,
    /// sr⁻¹, ≥ 0.
    pub(crate) rgb: DVec3,
}

impl Point {
    /// Without the side.
    pub(crate) fn bisected(&self) -> Bisected {
        Bisected {
            theta_h: self.theta_h.abs(),
            theta_d: self.theta_d,
        }
    }

    /// `None` where a number is not finite or no light can stand there.
    pub(crate) fn new(o: &Observation) -> Option<Self> {
        let alpha = light_angle(o.theta_r, o.deviation)?;
        let theta_h = 0.5 * (alpha + o.theta_r);
        let theta_d = 0.5 * (alpha - o.theta_r).abs();
        let point = Self {
            theta_h: if theta_h.abs() < SAME { 0.0 } else { theta_h },
            theta_d,
            cos_i: alpha.cos(),
            cosines: Bisected {
                theta_h: theta_h.abs(),
                theta_d,
            }
            .cosines(),
            rgb: o.rgb.max(DVec3::ZERO),
        };
        (o.rgb.is_finite() && point.theta_h.is_finite()).then_some(point)
    }
}

/// One side of the mirror direction on one curve: a plane, or a line along which both arms move.
#[derive(Clone, Debug)]
pub(crate) struct Side {
    /// Place of its curve among those of the run.
    pub(crate) curve: usize,
    pub(crate) course: Course,
    /// +1 towards the normal, −1 outwards.
    pub(crate) sign: f64,
    /// Ascending in |θ_h|, no two at the same.
    pub(crate) points: Vec<Point>,
}

/// All readings of a run, as far as they can be used.
#[derive(Clone, Debug)]
pub(crate) struct Sweeps {
    pub(crate) sides: Vec<Side>,
    /// The mirror arc; without one, of each plane the reading nearest to the mirror direction.
    pub(crate) arc: Vec<Point>,
    /// Below this, sr⁻¹, nothing is told from black; 0 in a channel without any light.
    pub(crate) least: DVec3,
    /// Readings left out.
    pub(crate) dropped: usize,
}

impl Sweeps {
    pub(crate) fn new(planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Self, Error> {
        let all = planes.iter().map(Vec::len).sum::<usize>() + arc.len();
        let points = |sweep: &[Observation]| sweep.iter().filter_map(Point::new).collect::<Vec<_>>();
        let mut sides = Vec::new();
        let mut kept = 0;
        let mut peaks = Vec::new();
        for (curve, plane) in planes.iter().enumerate() {
            let found = points(plane);
            let course = Course::of(plane, &found)?;
            kept += found.len();
            peaks.extend(
                found
                    .iter()
                    .min_by(|a, b| a.theta_h.abs().total_cmp(&b.theta_h.abs())),
            );
            for sign in [1.0, -1.0] {
                let side = found.iter().filter(|p| p.theta_h * sign >= 0.0);
                // Where a leg ends, towards grazing, f changes most, and nothing lies beyond.
                let end = side.clone().map(|p| p.theta_h.abs()).fold(0.0, f64::max);
                let points = merged(side, |a, b| match course {
                    Course::Plane { .. } => b.theta_h.abs() - a.theta_h.abs() < SAME,
                    Course::Leg { .. } => {
                        b.theta_h.abs() < end && warped(b.theta_h.abs()) - warped(a.theta_h.abs()) < DENSE
                    }
                });
                // A peak alone has no side.
                if points.last().is_some_and(|p| p.theta_h != 0.0) {
                    sides.push(Side {
                        curve,
                        course: course.clone(),
                        sign,
                        points,
                    });
                }
            }
        }
        let mut along = points(arc);
        kept += along.len();
        let dropped = all - kept;
        if kept == along.len() {
            return Err(Error::Empty { factor: "G", dropped });
        }
        if !arc.is_empty() && along.is_empty() {
            return Err(Error::Empty { factor: "F", dropped });
        }
        if along.is_empty() {
            along = peaks;
        }
        let readings = || planes.iter().flatten().chain(arc).filter(|o| o.rgb.is_finite());
        let least = least(readings().map(|o| o.rgb));
        let black = least.cmpeq(DVec3::ZERO);
        Ok(Self {
            arc: along,
            least: DVec3::select(black, DVec3::ZERO, least.max(TOLD * faintest_far(&sides))),
            sides,
            dropped,
        })
    }

    /// 0 in a channel without any light, else 1.
    pub(crate) fn light(&self) -> DVec3 {
        DVec3::select(self.least.cmpeq(DVec3::ZERO), DVec3::ZERO, DVec3::ONE)
    }

    pub(crate) fn points(&self) -> impl Iterator<Item = &Point> + Clone {
        self.sides.iter().flat_map(|side| &side.points).chain(&self.arc)
    }
}

/// Sorted by |θ_h|, those at one place averaged: `same` says whether a point is still at the place of the first of them.
fn merged<'a>(points: impl Iterator<Item = &'a Point>, same: impl Fn(&Point, &Point) -> bool) -> Vec<Point> {
    let mut points: Vec<Point> = points.copied().collect();
    points.sort_by(|a, b| a.theta_h.abs().total_cmp(&b.theta_h.abs()));
    let mut merged = Vec::new();
    let mut rest = points.as_slice();
    while let Some(first) = rest.first() {
        // The first is at its own place, whatever is asked.
        let others = rest[1..].iter().take_while(|p| same(first, p)).count();
        let n = 1 + others;
        let (at_one_place, after) = rest.split_at(n);
        merged.push(mean(at_one_place));
        rest = after;
    }
    merged
}

/// What several readings at nearly one place say of it; at least one.
fn mean(points: &[Point]) -> Point {
    let n = points.len() as f64;
    let of = |value: fn(&Point) -> f64| points.iter().map(value).sum::<f64>() / n;
    let [theta_h, theta_d] = match points {
        // Not through a sum, which would round.
        [one] => return *one,
        _ => [of(|p| p.theta_h), of(|p| p.theta_d)],
    };
    Point {
        theta_h,
        theta_d,
        cos_i: of(|p| p.cos_i),
        cosines: Bisected {
            theta_h: theta_h.abs(),
            theta_d,
        }
        .cosines(),
        rgb: points.iter().map(|p| p.rgb).sum::<DVec3>() / n,
    }
}

/// Per channel the faintest reading of the outer halves of the sides; 0 where there is none.
fn faintest_far(sides: &[Side]) -> DVec3 {
    let far = sides
        .iter()
        .flat_map(|side| &side.points[side.points.len() / 2..]);
    let faintest = far.fold(DVec3::INFINITY, |least, p| least.min(p.rgb));
    if faintest.is_finite() {
        faintest
    } else {
        DVec3::ZERO
    }
}

/// Per channel what is told from black: at least the root mean square of the readings below 0, which are noise.
fn least(readings: impl Iterator<Item = DVec3> + Clone) -> DVec3 {
    let channel = |c: usize| {
        let values = readings.clone().map(move |rgb| rgb[c]);
        if values.clone().all(|value| value <= 0.0) {
            return 0.0;
        }
        let (count, squares) = values
            .filter(|&value| value < 0.0)
            .fold((0.0, 0.0), |(n, sum), value| (n + 1.0, sum + value * value));
        (squares / f64::max(count, 1.0)).sqrt().max(LEAST)
    };
    DVec3::new(channel(0), channel(1), channel(2))
}
