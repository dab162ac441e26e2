use std::f32::consts::LOG2_E;

use glam::Vec4Swizzles;

use crate::bisected::RISE;
use crate::table::{Axis, COLUMNS, ROWS, STRIDE, Table, two_to};

/// How many pairs are evaluated side by side.
const LANES: usize = 8;
/// A number for each pair.
type Lane = [f32; LANES];
/// Taken for the pairs that are missing from the last eight.
const NORMAL: [f64; 3] = [0.0, 0.0, 1.0];

/// Where eight pairs of directions stand in a table.
struct Places {
    /// The first number of the cells of the pairs with the same half angle and with the same difference angle.
    cells: [[u32; LANES]; 2],
    /// How far they stand in these cells over the columns, 0 … 1.
    across: [Lane; 2],
    /// How far they stand in these cells over the rows, 0 … 1.
    along: [Lane; 2],
    /// The most by which log₂ f may rise.
    most: Lane,
    /// 1 where both directions stand above the horizon, else 0.
    above: Lane,
}

/// The pairs to evaluate, and where the results go.
struct All<'a> {
    table: &'a Table,
    incident: &'a [[f64; 3]],
    exitant: &'a [[f64; 3]],
    out: &'a mut [[f64; 3]],
}

impl pulp::WithSimd for All<'_> {
    type Output = ();

    // Whatever is called from here must be inlined, for only this function is compiled for the wide vectors.
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let (incident, rest) = self.incident.as_chunks::<LANES>();
        let (exitant, exitant_rest) = self.exitant.as_chunks::<LANES>();
        let (out, out_rest) = self.out.as_chunks_mut::<LANES>();
        for ((incident, exitant), out) in incident.iter().zip(exitant).zip(out) {
            self.table.eight(incident, exitant, out);
        }
        self.table.fewer(rest, exitant_rest, out_rest);
    }
}

impl Table {
    /// Evaluates many pairs of unit vectors, as [`Table::reflectance`] does, to the last bit; 0 where either is at or below
    /// the horizon. All slices have one length.
    ///
    /// Eight pairs go side by side, with the widest vectors that the processor has.
    pub(crate) fn reflectances(&self, incident: &[[f64; 3]], exitant: &[[f64; 3]], out: &mut [[f64; 3]]) {
        pulp::Arch::new().dispatch(All {
            table: self,
            incident,
            exitant,
            out,
        });
    }

    /// The same for fewer than eight pairs.
    #[inline(always)]
    fn fewer(&self, incident: &[[f64; 3]], exitant: &[[f64; 3]], out: &mut [[f64; 3]]) {
        let filled = |some: &[[f64; 3]]| {
            let mut all = [NORMAL; LANES];
            all[..some.len()].copy_from_slice(some);
            all
        };
        let mut all = [[0.0; 3]; LANES];
        self.eight(&filled(incident), &filled(exitant), &mut all);
        out.copy_from_slice(&all[..out.len()]);
    }

    /// log₂ of RGB in the cells of two neighbouring pairs, as [`Table::at`] has it for one; `k` is 0 for those of the same
    /// half angle, and 1 for those of the same difference angle.
    #[inline(always)]
    fn two(&self, places: &Places, k: usize, n: usize) -> Lane {
        let [a, b] = [n, n + 1].map(|n| {
            let first = places.cells[k][n] as usize;
            &self.logs[first..first + STRIDE + 7]
        });
        let corner = |at: usize| {
            let (a, b) = (&a[at..at + 4], &b[at..at + 4]);
            [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]
        };
        let (across, along) = (twice(&places.across[k], n), twice(&places.along[k], n));
        let mix = |a: Lane, b: Lane, share: Lane| -> Lane {
            std::array::from_fn(|lane| a[lane] * (1.0 - share[lane]) + b[lane] * share[lane])
        };
        let row = |at: usize| mix(corner(at), corner(at + 3), across);
        mix(row(0), row(STRIDE), along)
    }

    #[inline(always)]
    fn eight(&self, incident: &[[f64; 3]; LANES], exitant: &[[f64; 3]; LANES], out: &mut [[f64; 3]; LANES]) {
        let places = Places::new(self.axis, incident, exitant);
        let light = self.light.xyz().extend(0.0).to_array();
        let light: Lane = std::array::from_fn(|lane| light[lane % 4]);
        for n in (0..LANES).step_by(2) {
            let (near, far) = (self.two(&places, 0, n), self.two(&places, 1, n));
            let (most, above) = (twice(&places.most, n), twice(&places.above, n));
            let rgb: Lane = std::array::from_fn(|lane| {
                let rise = (far[lane] - near[lane]) * RISE as f32;
                let rise = if rise > 0.0 { rise } else { 0.0 };
                let rise = if rise < most[lane] { rise } else { most[lane] };
                two_to(near[lane] + rise) * (light[lane] * above[lane])
            });
            out[n] = [rgb[0], rgb[1], rgb[2]].map(f64::from);
            out[n + 1] = [rgb[4], rgb[5], rgb[6]].map(f64::from);
        }
    }
}

/// A number of each of two neighbouring pairs, four times.
#[inline(always)]
fn twice(of: &Lane, n: usize) -> Lane {
    std::array::from_fn(|lane| of[n + lane / 4])
}

impl Places {
    /// What `Places::new` of the table computes for one pair, in the same order, for eight.
    #[inline(always)]
    fn new(axis: Axis, incident: &[[f64; 3]; LANES], exitant: &[[f64; 3]; LANES]) -> Self {
        let lane = [0.0; LANES];
        let mut found = Self {
            cells: [[0; LANES]; 2],
            across: [lane; 2],
            along: [lane; 2],
            most: lane,
            above: lane,
        };
        let (mut flat, mut apart, mut across, mut product, mut height) = (lane, lane, lane, lane, lane);
        for n in 0..LANES {
            let ([ix, iy, iz], [ox, oy, oz]) = (incident[n], exitant[n]);
            let (sx, sy, dx, dy) = (ix + ox, iy + oy, ix - ox, iy - oy);
            flat[n] = (sx * sx + sy * sy) as f32;
            apart[n] = (dx * dx + dy * dy) as f32;
            across[n] = (ix * oy - iy * ox) as f32;
            product[n] = (iz * oz) as f32;
            height[n] = (iz + oz) as f32;
            found.above[n] = if (iz > 0.0) & (oz > 0.0) { 1.0 } else { 0.0 };
        }
        for n in 0..LANES {
            let up = height[n] * height[n];
            let (length, cos, out) = (flat[n] + up, up + apart[n], across[n] * across[n]);
            let roots = [
                length.sqrt(),
                cos.sqrt(),
                (product[n] * length).sqrt(),
                product[n].sqrt(),
            ];
            let squares = [length + up, length * (4.0 + cos)];
            let twice = [2.0 * height[n] * roots[0], 4.0 * length * roots[1]];
            let tan = [flat[n] * axis.inverse, (flat[n] - out) * (4.0 * axis.inverse)];
            const CELLS: f32 = (ROWS - 1) as f32;
            let rows = [CELLS * roots[2] / height[n], 2.0 * CELLS * roots[3] / roots[1]];
            for k in 0..2 {
                let column = axis.place((squares[k] + tan[k] + twice[k]) / (squares[k] + twice[k]));
                let (column, across) = cell(column, (COLUMNS - 1) as f32 - 1e-4);
                let (row, along) = cell(rows[k], CELLS - 1e-4);
                found.cells[k][n] = row * STRIDE as u32 + 3 * column;
                found.across[k][n] = across;
                found.along[k][n] = along;
            }
            found.most[n] = LOG2_E * out / (0.5 * length * length + out).max(f32::MIN_POSITIVE);
        }
        found
    }
}

/// The cell in which a place lies, and how far in it; what is no number lies in the first.
#[inline(always)]
fn cell(place: f32, last: f32) -> (u32, f32) {
    /// Adding it leaves a whole number in the last bits.
    const WHOLE: f32 = 12_582_912.0;
    let place = if place > 0.0 { place } else { 0.0 };
    let place = if place < last { place } else { last };
    let shifted = place - 0.5 + WHOLE;
    (shifted.to_bits() & 0x7f, place - (shifted - WHOLE))
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use brdf::{Brdf, Fitted, Lambert, Mirror};
    use glam::DVec3;
    use proptest::prelude::*;

    use crate::{Observation, Planes};

    static MODELS: LazyLock<[Planes; 4]> = LazyLock::new(models);

    fn models() -> [Planes; 4] {
        let gold = Fitted::named("gold-paint").unwrap();
        let mirror = Mirror::new(0.9, Mirror::HALF_ANGLE_RAD).unwrap();
        // Black in one channel.
        struct Red;
        impl Brdf for Red {
            fn eval(&self, _: DVec3, _: DVec3) -> DVec3 {
                DVec3::X
            }
        }
        let grey = Lambert::new(0.5).unwrap();
        let specimens: [&dyn Brdf; 4] = [&gold, &mirror, &Red, &grey];
        specimens.map(|specimen| {
            let plane = |theta_r: f64| -> Vec<_> {
                let deviations = [-0.2, -0.01, 0.0, 0.01, 0.05, 0.3, 0.8];
                deviations
                    .iter()
                    .filter_map(|&d| Observation::of(specimen, theta_r, d))
                    .collect()
            };
            let arc: Vec<_> = [0.1, 0.8, 1.3]
                .iter()
                .filter_map(|&t| Observation::of(specimen, t, 0.0))
                .collect();
            Planes::from_observations(&[plane(0.4), plane(1.0)], &arc).unwrap()
        })
    }

    /// Unit vectors anywhere, those at the horizon and the normal too.
    fn direction() -> impl Strategy<Value = [f64; 3]> {
        let place = prop_oneof![-1.0..=1.0_f64, Just(0.0), Just(1.0), Just(1e-9), Just(-1e-300)];
        (place, 0.0..7.0_f64).prop_map(|(z, phi)| {
            let sin = (1.0 - z * z).max(0.0).sqrt();
            [sin * phi.cos(), sin * phi.sin(), z]
        })
    }

    proptest! {
        #[test]
        fn prop_eight_at_a_time_are_to_the_last_bit_what_one_by_one_is(
            pairs in prop::collection::vec((direction(), direction()), 0..30),
            mirrored in any::<bool>(),
        ) {
            let (incident, mut exitant): (Vec<_>, Vec<_>) = pairs.into_iter().unzip();
            if mirrored {
                // Where all that is flat cancels, and at the horizon all.
                exitant = incident.iter().map(|&[x, y, z]: &[f64; 3]| [-x, -y, z]).collect();
            }
            for model in MODELS.iter() {
                let mut together = vec![[f64::NAN; 3]; incident.len()];
                model.eval_all(&incident, &exitant, &mut together);
                for ((i, o), rgb) in incident.iter().zip(&exitant).zip(together) {
                    let alone = model.eval(DVec3::from_array(*i), DVec3::from_array(*o));
                    prop_assert_eq!(alone.to_array(), rgb, "at {:?} and {:?}", i, o);
                }
            }
        }
    }
}
