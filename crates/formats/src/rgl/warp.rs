use crate::lattice::cell;

/// A density on the unit square, bilinear between the nodes of a grid, for each of some angles of incidence; between
/// angles it is linear.
///
/// x runs along a row. A place is found from the share of the density that lies before it: first by rows, then within the
/// row (Dupuy and Jakob 2018, "An Adaptive Parameterization for Efficient Material Acquisition and Rendering").
pub(crate) struct Warp {
    theta_i: Vec<f64>,
    rows: usize,
    columns: usize,
    /// Per angle: densities, row by row, that integrate to 1 in units of cells.
    density: Vec<f64>,
    /// Per angle and row: the integral of the row up to each column.
    within: Vec<f64>,
    /// Per angle: the integral up to each row.
    below: Vec<f64>,
}

impl Warp {
    /// A warp from densities of any scale, which must not be negative; an angle with none at all gets an even one.
    pub(crate) fn new(theta_i: Vec<f64>, rows: usize, columns: usize, mut density: Vec<f64>) -> Self {
        let mut within = vec![0.0; density.len()];
        let mut below = vec![0.0; theta_i.len() * rows];
        for (t, slice) in density.chunks_exact_mut(rows * columns).enumerate() {
            let integrate = |slice: &[f64], within: &mut [f64], below: &mut [f64]| {
                for row in 0..rows {
                    for column in 1..columns {
                        let at = row * columns + column;
                        within[at] = within[at - 1] + 0.5 * (slice[at - 1] + slice[at]);
                    }
                    if row > 0 {
                        let total = |row: usize| within[row * columns + columns - 1];
                        below[row] = below[row - 1] + 0.5 * (total(row - 1) + total(row));
                    }
                }
                below[rows - 1]
            };
            let within = &mut within[t * rows * columns..][..rows * columns];
            let below = &mut below[t * rows..][..rows];
            let total = integrate(slice, within, below);
            if total > 0.0 && total.is_finite() {
                for part in [&mut *slice, &mut *within, &mut *below] {
                    part.iter_mut().for_each(|value| *value /= total);
                }
            } else {
                slice.fill(1.0 / ((rows - 1) * (columns - 1)) as f64);
                integrate(slice, within, below);
            }
        }
        Self {
            theta_i,
            rows,
            columns,
            density,
            within,
            below,
        }
    }

    /// A table between two angles of incidence, `part` of the way from the first.
    fn mixed(&self, table: &[f64], size: usize, (t, part): (usize, f64), at: usize) -> f64 {
        let low = table[t * size + at];
        if part == 0.0 {
            return low;
        }
        low + part * (table[(t + 1) * size + at] - low)
    }

    /// The angles of incidence around one.
    pub(crate) fn slices(&self, theta_i: f64) -> (usize, f64) {
        cell(&self.theta_i, theta_i)
    }

    /// Where on the square a place (x, y) lies after the density is evened out, and the density there, whose mean is 1.
    pub(crate) fn invert(&self, slices: (usize, f64), [x, y]: [f64; 2]) -> ([f64; 2], f64) {
        let size = self.rows * self.columns;
        let place = |u: f64, nodes: usize| {
            let at = u.clamp(0.0, 1.0) * (nodes - 1) as f64;
            let index = (at as usize).min(nodes - 2);
            (index, at - index as f64)
        };
        let ((row, ty), (column, tx)) = (place(y, self.rows), place(x, self.columns));
        let at = row * self.columns + column;
        let density = |at: usize| self.mixed(&self.density, size, slices, at);
        let within = |at: usize| self.mixed(&self.within, size, slices, at);
        let mix = |a: f64, b: f64, t: f64| (1.0 - t) * a + t * b;
        let c0 = mix(density(at), density(at + self.columns), ty);
        let c1 = mix(density(at + 1), density(at + 1 + self.columns), ty);
        let end = row * self.columns + self.columns - 1;
        let (r0, r1) = (within(end), within(end + self.columns));
        let total = mix(r0, r1, ty);
        let before = mix(within(at), within(at + self.columns), ty);
        let along = (before + c0 * tx + 0.5 * (c1 - c0) * tx * tx) / total.max(f64::MIN_POSITIVE);
        let below = self.mixed(&self.below, self.rows, slices, row);
        let up = below + r0 * ty + 0.5 * (r1 - r0) * ty * ty;
        let cells = ((self.rows - 1) * (self.columns - 1)) as f64;
        ([along.min(1.0), up.min(1.0)], mix(c0, c1, tx) * cells)
    }

    /// The place (x, y) that lies at `s` after the density is evened out, and the density there; undoes
    /// [`Warp::invert`] at an angle of incidence of the grid.
    pub(crate) fn sample(&self, t: usize, [along, up]: [f64; 2]) -> ([f64; 2], f64) {
        let size = self.rows * self.columns;
        let (density, within) = (
            &self.density[t * size..][..size],
            &self.within[t * size..][..size],
        );
        let below = &self.below[t * self.rows..][..self.rows];
        let mix = |a: f64, b: f64, t: f64| (1.0 - t) * a + t * b;
        let row = below
            .partition_point(|&below| below <= up)
            .clamp(1, self.rows - 1)
            - 1;
        let end = row * self.columns + self.columns - 1;
        let (r0, r1) = (within[end], within[end + self.columns]);
        let ty = solve(r0, r1, up - below[row]);
        let goal = along * mix(r0, r1, ty);
        let before = |column: usize| {
            mix(
                within[row * self.columns + column],
                within[(row + 1) * self.columns + column],
                ty,
            )
        };
        // Not a slice to search in: rows are mixed on the way.
        let (mut low, mut high) = (0, self.columns - 1);
        while high - low > 1 {
            let middle = usize::midpoint(low, high);
            if before(middle) <= goal {
                low = middle;
            } else {
                high = middle;
            }
        }
        let at = row * self.columns + low;
        let c0 = mix(density[at], density[at + self.columns], ty);
        let c1 = mix(density[at + 1], density[at + 1 + self.columns], ty);
        let tx = solve(c0, c1, goal - before(low));
        let x = (low as f64 + tx) / (self.columns - 1) as f64;
        let y = (row as f64 + ty) / (self.rows - 1) as f64;
        let cells = ((self.rows - 1) * (self.columns - 1)) as f64;
        ([x, y], mix(c0, c1, tx) * cells)
    }
}

/// The share t of a cell over which a density that goes from `a` to `b` integrates to `area`: a t + (b − a) t²/2 = area.
fn solve(a: f64, b: f64, area: f64) -> f64 {
    let root = (a * a + 2.0 * (b - a) * area).max(0.0).sqrt();
    let sum = a + root;
    if sum > 0.0 {
        (2.0 * area / sum).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn prop_sampling_undoes_inversion(
            density in proptest::collection::vec(0.01..10.0_f64, 2 * 5 * 7),
            u in (0.0..1.0_f64, 0.0..1.0_f64),
            t in 0_usize..2,
        ) {
            let warp = Warp::new(vec![0.0, 1.0], 5, 7, density);
            let (place, density) = warp.sample(t, [u.0, u.1]);
            let (back, again) = warp.invert((0, t as f64), place);
            prop_assert!((back[0] - u.0).abs() < 1e-9 && (back[1] - u.1).abs() < 1e-9, "{back:?} from {u:?}");
            prop_assert!((density - again).abs() < 1e-6 * density.max(1.0));
        }
    }

    #[test]
    fn without_any_density_it_is_even() {
        let warp = Warp::new(vec![0.0], 3, 3, vec![0.0; 9]);
        let (place, density) = warp.sample(0, [0.25, 0.75]);
        assert!((place[0] - 0.25).abs() < 1e-12 && (place[1] - 0.75).abs() < 1e-12);
        assert!((density - 1.0).abs() < 1e-12);
    }
}
