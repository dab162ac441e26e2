use glam::DVec3;

use crate::bisected::{Bisected, Pair};
use crate::surface::Surface;
use crate::sweeps::{Point, Side, Sweeps};
use crate::{Error, Observation, Scene, Shape};

/// Readings beyond the end of a range that a value at the end is made of: the next one, and the one after it for its
/// slope.
const BESIDE: usize = 2;
/// The same where two sides are averaged at the readings of either.
const BESIDE_BOTH: usize = 4;

/// Which readings the values of a scene are made of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reads {
    /// Of each plane, in the order of its readings.
    pub planes: Vec<Vec<bool>>,
    /// Of the arc.
    pub arc: Vec<bool>,
}

impl Scene {
    /// What [`crate::Separable`] reads of a plane and an arc, whose readings are given by θ_r, rad, and signed deviation.
    ///
    /// F at the θ_o of the scene; G up to the largest d_p of any pair, from the mirror direction on, where F is divided
    /// by it. The last reading outwards stays, since the weight of its side ends there.
    pub fn reads_of_product(&self, plane: &[(f64, f64)], arc: &[(f64, f64)]) -> Reads {
        let crossing = arc.iter().map(|(_, d)| d.abs()).fold(0.0, f64::max);
        let farthest = |cell: &crate::Cell| cell.theta_i[1].sin() + cell.theta_o[1].sin();
        let reach = self.cells.iter().map(farthest).fold(crossing, f64::max);
        let mut read = vec![false; plane.len()];
        for sign in [1.0, -1.0] {
            let mut side: Vec<usize> = (0..plane.len()).filter(|&i| plane[i].1 * sign >= 0.0).collect();
            side.sort_by(|&a, &b| plane[a].1.abs().total_cmp(&plane[b].1.abs()));
            let d_p: Vec<f64> = side.iter().map(|&i| plane[i].1.abs()).collect();
            for n in around(&d_p, [0.0, reach], BESIDE_BOTH) {
                read[side[n]] = true;
            }
            if let Some(&last) = side.last().filter(|_| sign < 0.0) {
                read[last] = true;
            }
        }
        let ranges = self.cells.iter().map(|cell| cell.theta_o);
        Reads {
            planes: vec![read],
            arc: along(arc.iter().map(|reading| reading.0), hull(ranges)),
        }
    }

    /// What [`crate::Planes`] reads of planes and an arc, whose readings are given by θ_r, rad, and signed deviation: of
    /// every side the half angles at which it is the next one to a pair of the scene that was carried into the plane, and
    /// of the arc the difference angles of the pairs and of those readings.
    ///
    /// # Errors
    /// As [`crate::Planes::from_observations`].
    pub fn reads_of_lobe(&self, planes: &[Vec<(f64, f64)>], arc: &[(f64, f64)]) -> Result<Reads, Error> {
        self.reads_at(planes, arc, |pair| [pair.same_half(), pair.same_difference()])
    }

    /// What [`crate::Bivariate`] reads: as [`Scene::reads_of_lobe`], but for pairs by their own half and difference angle.
    ///
    /// # Errors
    /// As [`crate::Planes::from_observations`].
    pub fn reads_of_table(&self, planes: &[Vec<(f64, f64)>], arc: &[(f64, f64)]) -> Result<Reads, Error> {
        self.reads_at(planes, arc, |pair| [pair.bisected()])
    }

    fn reads_at<const N: usize>(
        &self,
        planes: &[Vec<(f64, f64)>],
        arc: &[(f64, f64)],
        carried: impl Fn(&Pair) -> [Bisected; N],
    ) -> Result<Reads, Error> {
        let white = |&(theta_r, deviation): &(f64, f64)| Observation {
            theta_r,
            deviation,
            rgb: DVec3::ONE,
        };
        let along_planes: Vec<Vec<_>> = planes
            .iter()
            .map(|plane| plane.iter().map(white).collect())
            .collect();
        let along_arc: Vec<_> = arc.iter().map(white).collect();
        let sweeps = Sweeps::new(&along_planes, &along_arc)?;
        let surface = Surface::new(&sweeps, Shape::DEFAULT)?;
        let mut halves = vec![None; sweeps.sides.len()];
        let mut differences = None;
        for (incident, exitant) in self.pairs().filter(|(i, o)| i.z > 0.0 && o.z > 0.0) {
            let pair = Pair::new(incident, exitant);
            for Bisected { theta_h, theta_d } in carried(&pair) {
                widen(&mut differences, theta_d);
                for side in surface.lobe.beside(theta_h, theta_d) {
                    widen(&mut halves[side], theta_h);
                }
            }
        }
        let read = |plane: &Vec<Observation>| vec![false; plane.len()];
        let mut read: Vec<Vec<bool>> = along_planes.iter().map(read).collect();
        for (side, range) in sweeps.sides.iter().zip(halves) {
            let Some(range) = range else { continue };
            let theta_h: Vec<f64> = side.points.iter().map(|p| p.theta_h.abs()).collect();
            let used = around(&theta_h, range, BESIDE);
            let points = &side.points[used];
            points.iter().for_each(|p| widen(&mut differences, p.theta_d));
            mark(&mut read, &along_planes, side, points);
        }
        if arc.is_empty() {
            // Then the planes' peaks are the arc.
            let peak = |plane: &Vec<Observation>| {
                let half = |i: &usize| Point::new(&plane[*i]).map_or(f64::INFINITY, |p| p.theta_h.abs());
                (0..plane.len()).min_by(|a, b| half(a).total_cmp(&half(b)))
            };
            for (read, plane) in read.iter_mut().zip(&along_planes) {
                peak(plane).into_iter().for_each(|i| read[i] = true);
            }
        }
        let differences = differences.unwrap_or([0.0, 0.0]);
        Ok(Reads {
            planes: read,
            arc: along(along_arc.iter().map(difference), differences),
        })
    }
}

impl Reads {
    /// What either reads.
    #[must_use]
    pub fn or(mut self, other: &Self) -> Self {
        for (plane, others) in self.planes.iter_mut().zip(&other.planes) {
            plane.iter_mut().zip(others).for_each(|(a, b)| *a |= b);
        }
        self.arc.iter_mut().zip(&other.arc).for_each(|(a, b)| *a |= b);
        self
    }
}

/// Marks the readings of the curve to which some points of a side belong, all those at one half angle together.
fn mark(read: &mut [Vec<bool>], planes: &[Vec<Observation>], side: &Side, points: &[Point]) {
    let ends = [points.first(), points.last()].map(|p| p.map_or(f64::NAN, |p| p.theta_h.abs()));
    for (read, observation) in read[side.curve].iter_mut().zip(&planes[side.curve]) {
        let Some(point) = Point::new(observation) else {
            continue;
        };
        let on_side = point.theta_h * side.sign >= 0.0;
        *read |= on_side && (ends[0]..=ends[1]).contains(&point.theta_h.abs());
    }
}

/// θ_d of a reading; NaN where no light can stand.
fn difference(observation: &Observation) -> f64 {
    Point::new(observation).map_or(f64::NAN, |point| point.theta_d)
}

/// Which readings along an arc a range of its angle is made of.
fn along(angles: impl Iterator<Item = f64>, range: [f64; 2]) -> Vec<bool> {
    let angles: Vec<f64> = angles.collect();
    let mut order: Vec<usize> = (0..angles.len()).filter(|&i| angles[i].is_finite()).collect();
    order.sort_by(|&a, &b| angles[a].total_cmp(&angles[b]));
    let sorted: Vec<f64> = order.iter().map(|&i| angles[i]).collect();
    let mut read = vec![false; angles.len()];
    for n in around(&sorted, range, BESIDE) {
        read[order[n]] = true;
    }
    read
}

/// The ascending nodes that values within a range are made of.
fn around(nodes: &[f64], [low, high]: [f64; 2], beside: usize) -> std::ops::Range<usize> {
    let first = nodes.partition_point(|&node| node < low);
    let end = nodes.partition_point(|&node| node <= high);
    first.saturating_sub(beside)..(end + beside).min(nodes.len())
}

/// The least range that holds all of some.
fn hull(ranges: impl Iterator<Item = [f64; 2]>) -> [f64; 2] {
    ranges.fold([f64::INFINITY, f64::NEG_INFINITY], |a, b| {
        [a[0].min(b[0]), a[1].max(b[1])]
    })
}

fn widen(range: &mut Option<[f64; 2]>, to: f64) {
    let [low, high] = range.unwrap_or([to, to]);
    *range = Some([low.min(to), high.max(to)]);
}
