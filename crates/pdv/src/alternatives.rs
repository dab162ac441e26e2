use brdf::Brdf;
use glam::DVec3;

use crate::surface::Surface;
use crate::sweeps::Sweeps;
use crate::table::Table;
use crate::{Bivariate, Error, Observation, Shape};

/// The least reflectance, sr⁻¹, that has a logarithm.
const LEAST: f64 = 1e-9;
/// Of what changes when readings are left out, the share that is missing with all of them: without every second one the gaps
/// are twice as wide, and the error goes with their square.
const LEFT_OUT: f64 = 0.25;
/// What ln f is unsure by where all alternatives agree, as a standard uncertainty: no reading in the plane tells how f
/// depends on the azimuth of the difference vector. With 0.05 one entry in a hundred less holds the truth, over neural
/// stand-ins of two databases and over measured paints alike; `cargo run --release -p study --example held` shows what
/// another value would cost.
const OUT_OF_PLANE: f64 = 0.075;

/// Other reconstructions that the same readings allow, and how far they lie from a model of them: what no error of a
/// reading explains.
///
/// The readings are taken once more without each plane (of a single plane without each side), without every second reading
/// of all sides, without every second one of the arc; with [`Shape::DEFAULT`] instead of the shape that they chose; and by
/// half and difference angle, as [`Bivariate`].
#[derive(Clone, Debug)]
pub struct Alternatives {
    /// The usual model of all readings.
    usual: Table,
    /// The same with the shape that is not fitted; `None` where it cannot be made.
    unfitted: Option<Table>,
    /// By what is left out: planes or sides, readings of the sides, readings of the arc.
    without: [Vec<Table>; 3],
    bivariate: Bivariate,
}

impl Alternatives {
    /// The alternatives to a model of planes and an arc.
    ///
    /// # Errors
    /// As [`crate::Planes::from_observations`].
    ///
    /// ```
    /// # let gold = brdf::Fitted::named("gold-paint").expect("one of the fitted materials");
    /// use brdf::Brdf;
    /// use pdv::{Alternatives, Observation, Planes};
    ///
    /// # let plane = |theta_r: f64| -> Vec<Observation> {
    /// #     let deviations = [-0.04, 0.0, 0.02, 0.06, 0.15, 0.4, 0.8];
    /// #     deviations.iter().filter_map(|&d| Observation::of(&gold, theta_r, d)).collect()
    /// # };
    /// # let arc: Vec<_> = [0.1, 0.5, 0.9, 1.3].iter().filter_map(|&t| Observation::of(&gold, t, 0.0)).collect();
    /// let planes = [plane(0.3), plane(1.0)];
    /// let alternatives = Alternatives::new(&planes, &arc)?;
    /// let (incident, exitant) = plane(0.3)[3].pdv().directions().expect("it was read there");
    /// let f = Planes::from_observations(&planes, &arc)?.eval(incident, exitant);
    /// assert!(alternatives.u_log(f, incident, exitant).x < 0.2);
    /// // Another value than the readings allow is as unsure as it is far from them.
    /// assert!(alternatives.u_log(2.0 * f, incident, exitant).x > 0.69);
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn new(planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Self, Error> {
        let sweeps = Sweeps::new(planes, arc)?;
        let (usual, _) = crate::choice::choose(&sweeps)?;
        let shape = usual.excess.shape;
        // What cannot be made without some readings is no alternative.
        let of = |planes: &[Vec<Observation>], arc: &[Observation], shape: Shape| {
            let sweeps = Sweeps::new(planes, arc).ok()?;
            Some(bake(&Surface::new(&sweeps, shape).ok()?, &sweeps))
        };
        let left_out = fewer(planes);
        let thinned = [0, 1].map(|n| {
            planes
                .iter()
                .map(|plane| half(plane, n, |o| o.deviation))
                .collect()
        });
        let arcs = [0, 1].map(|n| half(arc, n, |o| o.theta_r));
        Ok(Self {
            usual: bake(&usual, &sweeps),
            unfitted: of(planes, arc, Shape::DEFAULT),
            without: [
                left_out.iter().filter_map(|rest| of(rest, arc, shape)).collect(),
                thinned
                    .iter()
                    .filter_map(|rest: &Vec<_>| of(rest, arc, shape))
                    .collect(),
                arcs.iter().filter_map(|rest| of(planes, rest, shape)).collect(),
            ],
            bivariate: Bivariate::from_observations(planes, arc)?,
        })
    }

    /// Standard uncertainty of ln f between two unit vectors, of a model that says `f` there, sr⁻¹: how far the
    /// alternatives lie from the usual model, and that from `f`, as independent of each other.
    pub fn u_log(&self, f: DVec3, incident: DVec3, exitant: DVec3) -> DVec3 {
        let usual = ln(self.usual.reflectance(incident, exitant));
        let from_usual = |of: DVec3| (ln(of) - usual).abs();
        let from_table = |table: &Table| from_usual(table.reflectance(incident, exitant));
        let left_out = self.without.iter().map(|tables| {
            let most = tables.iter().map(from_table).fold(DVec3::ZERO, DVec3::max);
            LEFT_OUT * most
        });
        let others = [
            self.unfitted.as_ref().map_or(DVec3::ZERO, from_table),
            from_usual(self.bivariate.eval(incident, exitant)),
            from_usual(f),
            DVec3::splat(OUT_OF_PLANE),
        ];
        let squares: DVec3 = left_out.chain(others).map(|term| term * term).sum();
        squares.map(f64::sqrt)
    }
}

fn ln(f: DVec3) -> DVec3 {
    f.map(|f| f.max(LEAST).ln())
}

fn bake(surface: &Surface, sweeps: &Sweeps) -> Table {
    Table::bake(|pose| surface.at(pose, None), sweeps.light()).0
}

/// The planes without each of them in turn; of a single one without each of its sides.
fn fewer(planes: &[Vec<Observation>]) -> Vec<Vec<Vec<Observation>>> {
    let read: Vec<usize> = (0..planes.len()).filter(|&n| !planes[n].is_empty()).collect();
    if let [only] = read[..] {
        let one_sided = |sign: f64| {
            let mut rest = planes.to_vec();
            rest[only].retain(|o| o.deviation * sign >= 0.0);
            rest
        };
        return vec![one_sided(1.0), one_sided(-1.0)];
    }
    let without = |&n: &usize| {
        let mut rest = planes.to_vec();
        rest[n].clear();
        rest
    };
    read.iter().map(without).collect()
}

/// Every second reading in the order of a coordinate, the `first` or the other half, with both ends and the mirror direction
/// of a plane: what is asked is what lies between the readings, not beyond them.
fn half(readings: &[Observation], first: usize, of: impl Fn(&Observation) -> f64) -> Vec<Observation> {
    let mut sorted = readings.to_vec();
    sorted.sort_by(|a, b| of(a).total_cmp(&of(b)));
    let last = sorted.len().saturating_sub(1);
    // In a plane the coordinate is the deviation, which is 0 there; along an arc all deviations are about the same.
    let mirror = (0..sorted.len()).min_by(|&a, &b| of(&sorted[a]).abs().total_cmp(&of(&sorted[b]).abs()));
    let kept = (0..sorted.len()).filter(|&n| n % 2 == first || n == 0 || n == last || Some(n) == mirror);
    kept.map(|n| sorted[n]).collect()
}
