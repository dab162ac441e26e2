use glam::DVec3;

use crate::Error;
use crate::grid::Grid;

/// Nodes closer than this are one; the cube of their distance must stay a number.
const SAME: f64 = 1e-18;
/// What rounding may carry the end of a range beyond itself.
const ROUNDING: f64 = 1e-12;

/// An RGB function of one variable x ≥ 0, known at sorted nodes.
///
/// Between nodes a cubic with the slopes of Fritsch and Butland (1984): monotone where the values are, so it never
/// leaves their range. Beyond the nodes it is constant, and [`Factor::extrapolated`] says so.
#[derive(Clone, Debug, PartialEq)]
pub struct Factor {
    nodes: Vec<f64>,
    values: Vec<DVec3>,
    /// Whether it begins with slope 0.
    flat: bool,
    /// Coefficients of 1, t, t², t³ with t = x − node, from every node to the next, and the constants beyond.
    cubics: Vec<[DVec3; 4]>,
    grid: Grid,
    dropped: usize,
}

impl Factor {
    /// A factor through points (x, RGB) in any order; values at the same x are averaged, points with a negative x
    /// or a number that is not finite are dropped and counted. `name` stands in the error.
    ///
    /// It begins with slope 0, as a function does that is even about x = 0.
    ///
    /// # Errors
    /// No point is left.
    ///
    /// ```
    /// use glam::DVec3;
    /// use pdv::Factor;
    ///
    /// let rgb = |y: f64| DVec3::splat(y);
    /// let factor = Factor::new("G", [(1.0, rgb(2.0)), (0.0, rgb(4.0)), (3.0, rgb(1.0)), (1.0, rgb(4.0))])?;
    /// assert_eq!(factor.at(1.0).x, 3.0, "the mean of both values there");
    /// assert!(factor.at(2.0).x < 3.0 && factor.at(2.0).x > 1.0, "it never leaves the range of its neighbours");
    /// assert_eq!(factor.at(9.0).x, 1.0);
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn new(name: &'static str, points: impl IntoIterator<Item = (f64, DVec3)>) -> Result<Self, Error> {
        Self::through(name, points, true)
    }

    /// As [`Factor::new`], but a function of the square of each x, which needs no root at evaluation.
    ///
    /// d_p and sin θ_r are distances on the disk from a point about which nothing has a direction, so what is smooth
    /// there is smooth in the square. Nodes, range and argument are squares.
    ///
    /// # Errors
    /// No point is left.
    ///
    /// ```
    /// use glam::DVec3;
    /// use pdv::Factor;
    ///
    /// let factor = Factor::over_squares("F", [(0.1, DVec3::ONE), (0.3, DVec3::ZERO)])?;
    /// assert_eq!(factor.at(0.1 * 0.1), DVec3::ONE);
    /// assert_eq!(factor.range(), (0.1 * 0.1, 0.3 * 0.3));
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn over_squares(
        name: &'static str,
        points: impl IntoIterator<Item = (f64, DVec3)>,
    ) -> Result<Self, Error> {
        Self::through(name, points.into_iter().map(|(x, value)| (x * x, value)), false)
    }

    fn through(
        name: &'static str,
        points: impl IntoIterator<Item = (f64, DVec3)>,
        flat: bool,
    ) -> Result<Self, Error> {
        let mut all = 0;
        let mut points: Vec<(f64, DVec3)> = points
            .into_iter()
            .inspect(|_| all += 1)
            .filter(|(x, value)| x.is_finite() && *x >= 0.0 && value.is_finite())
            .collect();
        let dropped = all - points.len();
        if points.is_empty() {
            return Err(Error::Empty {
                factor: name,
                dropped,
            });
        }
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (nodes, values): (Vec<f64>, Vec<DVec3>) = points
            .chunk_by(|a, b| b.0 - a.0 < SAME)
            .map(|same| {
                (
                    same[0].0,
                    same.iter().map(|point| point.1).sum::<DVec3>() / same.len() as f64,
                )
            })
            .unzip();
        let cubics = cubics(&nodes, &values, flat);
        let grid = Grid::new(&nodes);
        Ok(Self {
            nodes,
            values,
            flat,
            cubics,
            grid,
            dropped,
        })
    }

    /// The value at x, 0 … 1e100; held constant beyond the nodes.
    #[inline(always)]
    pub fn at(&self, x: f64) -> DVec3 {
        let (interval, t) = self.grid.locate(x);
        let [c0, c1, c2, c3] = self.cubics[interval];
        (c0 + c1 * t) + (c2 + c3 * t) * (t * t)
    }

    /// First and last node: the measured range.
    pub fn range(&self) -> (f64, f64) {
        (self.nodes[0], self.nodes[self.nodes.len() - 1])
    }

    /// Whether x lies beyond the measured range.
    pub fn extrapolated(&self, x: f64) -> bool {
        let (first, last) = self.range();
        !(first - ROUNDING..=last + ROUNDING).contains(&x)
    }

    /// Nodes with their values, ascending.
    pub fn points(&self) -> impl ExactSizeIterator<Item = (f64, DVec3)> {
        self.nodes.iter().copied().zip(self.values.iter().copied())
    }

    /// Points that were not finite.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// The same nodes with other values.
    pub(crate) fn map(self, change: impl Fn(DVec3) -> DVec3) -> Self {
        let values: Vec<DVec3> = self.values.into_iter().map(change).collect();
        Self {
            cubics: cubics(&self.nodes, &values, self.flat),
            values,
            ..self
        }
    }
}

/// Cubic Hermite coefficients: a constant before the nodes, every interval, a constant behind.
fn cubics(nodes: &[f64], values: &[DVec3], flat: bool) -> Vec<[DVec3; 4]> {
    let constant = |value: DVec3| [value, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO];
    let last = nodes.len() - 1;
    let widths: Vec<f64> = nodes.windows(2).map(|x| x[1] - x[0]).collect();
    let secants: Vec<DVec3> = values
        .windows(2)
        .zip(&widths)
        .map(|(v, h)| (v[1] - v[0]) / h)
        .collect();
    let slopes: Vec<DVec3> = (0..=last)
        .map(|n| match n {
            0 if flat => DVec3::ZERO,
            0 => secants.first().copied().unwrap_or_default(),
            n if n == last => secants[last - 1],
            n => slope([widths[n - 1], widths[n]], [secants[n - 1], secants[n]]),
        })
        .collect();
    let cubic = |n: usize| {
        let (h, secant) = (widths[n], secants[n]);
        let bend = (secant * 3.0 - slopes[n] * 2.0 - slopes[n + 1]) / h;
        let twist = (slopes[n] + slopes[n + 1] - secant * 2.0) / (h * h);
        [values[n], slopes[n], bend, twist]
    };
    std::iter::once(constant(values[0]))
        .chain((0..last).map(cubic))
        .chain([constant(values[last])])
        .collect()
}

/// Weighted harmonic mean of the neighbouring secants, 0 at a turn.
fn slope([before, after]: [f64; 2], [left, right]: [DVec3; 2]) -> DVec3 {
    let (first, second) = (2.0 * after + before, after + 2.0 * before);
    let channel = |l: f64, r: f64| {
        if l * r > 0.0 {
            (first + second) / (first / l + second / r)
        } else {
            0.0
        }
    };
    DVec3::new(
        channel(left.x, right.x),
        channel(left.y, right.y),
        channel(left.z, right.z),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn factor(points: &[(f64, f64)]) -> Factor {
        Factor::new("G", points.iter().map(|&(x, y)| (x, DVec3::new(y, 2.0 * y, 0.0)))).unwrap()
    }

    #[test]
    fn takes_points_in_any_order_and_averages_those_at_one_place() {
        let f = factor(&[
            (1.0, 3.0),
            (0.0, 1.0),
            (1.0, 5.0),
            (f64::NAN, 1.0),
            (2.0, f64::INFINITY),
        ]);
        assert_eq!(
            f.points().map(|(x, y)| (x, y.x)).collect::<Vec<_>>(),
            [(0.0, 1.0), (1.0, 4.0)]
        );
        assert_eq!(f.dropped(), 2);
        assert_eq!(f.range(), (0.0, 1.0));
    }

    #[test]
    fn is_constant_beyond_its_range_and_says_so() {
        let f = factor(&[(0.5, 3.0), (1.0, 1.0)]);
        assert_eq!((f.at(0.0).x, f.at(7.0).x, f.at(1e100).x), (3.0, 1.0, 1.0));
        assert!(f.extrapolated(0.4999) && f.extrapolated(1.0001) && f.extrapolated(f64::NAN));
        assert!(!f.extrapolated(0.5) && !f.extrapolated(1.0));
        assert_eq!(factor(&[(0.3, 2.0)]).at(9.0), DVec3::new(2.0, 4.0, 0.0));
    }

    #[test]
    fn without_a_point_there_is_no_factor() {
        let error = Factor::new("F", [(f64::NAN, DVec3::ONE)]).unwrap_err();
        assert_eq!(
            error,
            Error::Empty {
                factor: "F",
                dropped: 1
            }
        );
    }

    proptest! {
        #[test]
        fn prop_meets_its_nodes_and_stays_between_them(
            points in prop::collection::vec((0.0..2.0_f64, 0.0..9.0_f64), 2..200),
            at in 0.0..2.1_f64,
            crowd in 0..9,
        ) {
            // Some nodes crowd as the raw distribution's do.
            let points: Vec<_> = points.iter().map(|&(x, y)| (x.powi(crowd), y)).collect();
            let f = factor(&points);
            for (x, value) in f.points() {
                prop_assert!((f.at(x) - value).abs().max_element() < 1e-9, "at {}", x);
            }
            let known: Vec<_> = f.points().collect();
            let after = known.partition_point(|&(x, _)| x <= at).clamp(1, known.len().max(2) - 1).min(known.len() - 1);
            let (a, b) = (known[after.saturating_sub(1)].1.x, known[after].1.x);
            let y = f.at(at).x;
            prop_assert!(a.min(b) - 1e-9 <= y && y <= a.max(b) + 1e-9, "{} at {} not in {} … {}", y, at, a, b);
        }
    }
}
