use std::f32::consts::LN_2;

use glam::{DVec3, Vec3, Vec4, Vec4Swizzles};

use crate::PlainTable;
use crate::bisected::{Bisected, Pair, RISE};

/// Nodes over the half angle.
pub(crate) const COLUMNS: usize = 66;
/// Nodes over the cosines.
pub(crate) const ROWS: usize = 20;
/// Numbers of a row.
pub(crate) const STRIDE: usize = 3 * COLUMNS;
/// Half angles, rad, of which one is where a table begins to be logarithmic: whichever loses least.
const KNEES: [f64; 6] = [1e-4, 1e-3, 4e-3, 1e-2, 2.5e-2, 6e-2];
/// Pairs by which a table is judged.
const DRAWN: u32 = 2000;
/// Steps of the additive sequence in three dimensions (Roberts 2018): powers of the root of x⁴ = x + 1.
pub(crate) const STEPS: [f64; 3] = [
    0.819_172_513_396_164_4,
    0.671_043_606_703_789_3,
    0.549_700_477_901_970_3,
];
/// Largest zenith angle of pairs on which models are judged, rad.
pub(crate) const THETA_MAX: f64 = 80.0 * std::f64::consts::PI / 180.0;
/// Largest |log₂ f| that is stored; 2⁻¹²⁰ is 7.5e-37 sr⁻¹.
pub(crate) const LOG_MAX: f32 = 120.0;

/// A reflectance in the plane as a small table in f32, and what makes of it one for all directions.
///
/// It holds log₂ f at 66 × 20 nodes, and is linear between them. Over θ_h they stand at even steps of a logarithm of
/// 1 + tan²(θ_h/2)/k² whose mantissa is not looked up but taken as it stands, over the cosines at even steps of
/// √(cos θ_i cos θ_o)/cos θ_h: both even about the mirror direction and about the normal, as f is, and both had from
/// unit vectors by a root and a quotient, without angles.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Table {
    /// log₂ of RGB, θ_h fastest, and a number that is loaded and not used.
    pub(crate) logs: Vec<f32>,
    pub(crate) axis: Axis,
    /// 0 in a black channel, else 1, and a number that is not used.
    pub(crate) light: Vec4,
}

/// The axis of half angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Axis {
    /// 1/k² for tan²(θ_h/2).
    pub(crate) inverse: f32,
    /// Cells per unit of the last place.
    pub(crate) cells: f32,
}

impl Axis {
    fn new(knee: f64) -> Self {
        let inverse = (1.0 / (0.5 * knee).tan().powi(2)) as f32;
        let whole = (1.0 + inverse).to_bits() - 1_f32.to_bits();
        Self {
            inverse,
            cells: (COLUMNS - 1) as f32 / whole as f32,
        }
    }

    /// In cells from the mirror direction, 0 … [`COLUMNS`] − 1, of 1 + tan²(θ_h/2)/k².
    #[inline(always)]
    fn places(self, numbers: Vec4) -> Vec4 {
        Vec4::from_array(numbers.to_array().map(last_places)) * self.cells
    }

    /// The same of one number.
    #[inline(always)]
    pub(crate) fn place(self, number: f32) -> f32 {
        last_places(number) * self.cells
    }

    /// tan²(θ_h/2) of a place.
    fn tan(self, place: f64) -> f64 {
        // In f64 for the steps of f32 near 1 are as wide as the first cells.
        let last = place / f64::from(self.cells) / f64::from(1_u32 << 23);
        let octave = last.floor();
        ((1.0 + last - octave) * octave.exp2() - 1.0) / f64::from(self.inverse)
    }
}

/// Where two pairs of directions stand in a table, in cells: the columns of both, then the rows of both.
#[derive(Clone, Copy)]
struct Places(Vec4);

impl Places {
    /// Of two unit vectors above the horizon, and the most by which ln f may rise, as [`Pair::most`].
    ///
    /// With s and d the flat parts of sum and difference, h the height of the sum, p = cos θ_i cos θ_o and e the height
    /// of the cross product: L = s² + h² is 4 cos² θ_d, and C = h² + d² is 4 (p + sin² θ_d) without cancellation. The pair
    /// in the plane with the same half angle has tan²(θ_h/2) = s²/(√L + h)² and the row √(p L)/h, the one with the same
    /// difference angle 4 (s² − e²)/(L (2 + √C)²) and 2 √(p/C).
    #[inline(always)]
    fn new(axis: Axis, incident: DVec3, exitant: DVec3) -> (Self, f32) {
        // What cancels is a sum of two numbers in f64; the rest is in f32.
        let (sum, difference) = (incident + exitant, incident - exitant);
        let flat = (sum.x * sum.x + sum.y * sum.y) as f32;
        let apart = (difference.x * difference.x + difference.y * difference.y) as f32;
        let across = (incident.x * exitant.y - incident.y * exitant.x) as f32;
        let product = (incident.z * exitant.z) as f32;
        let height = sum.z as f32;
        let up = height * height;
        let (length, cos, out) = (flat + up, up + apart, across * across);
        // The way through roots and quotients is what takes the time: one step of each, side by side. Hence the squares
        // are multiplied out, and the 1 that an axis adds to its quotient is the denominator in the numerator.
        let roots = Vec4::new(length, cos, product * length, product).sqrt();
        let squares = [length + up, length * (4.0 + cos)];
        let twice = [2.0 * height, 4.0 * length];
        let tan = [flat * axis.inverse, (flat - out) * (4.0 * axis.inverse)];
        const CELLS: f32 = (ROWS - 1) as f32;
        let above = Vec4::new(squares[0] + tan[0], squares[1] + tan[1], 0.0, 0.0)
            + Vec4::new(twice[0], twice[1], CELLS, 2.0 * CELLS) * roots;
        let below = Vec4::new(squares[0], squares[1], height, 0.0)
            + Vec4::new(twice[0], twice[1], 0.0, 1.0) * roots.xyxy();
        let places = above / below;
        // In all lanes, of which two are dropped: one by one it takes longer.
        let columns = axis.places(places);
        let most = std::f32::consts::LOG2_E * out / (0.5 * length * length + out).max(f32::MIN_POSITIVE);
        (Self(Vec4::new(columns.x, columns.y, places.z, places.w)), most)
    }

    /// The first number of the cells of both, always within the table, and how far in them both stand, as the places.
    #[inline(always)]
    fn cells(self) -> ([usize; 2], Vec4) {
        /// Adding it leaves a whole number in the last bits: cheaper than a conversion, which has to mind what is no
        /// number.
        const WHOLE: f32 = 12_582_912.0;
        /// Just below the last node.
        const LAST: Vec4 = Vec4::new(
            (COLUMNS - 1) as f32 - 1e-4,
            (COLUMNS - 1) as f32 - 1e-4,
            (ROWS - 1) as f32 - 1e-4,
            (ROWS - 1) as f32 - 1e-4,
        );
        // What is no number becomes 0: 0/0, where there is no half vector.
        let places = self.0.max(Vec4::ZERO).min(LAST);
        // Of −1/2 it makes 0, for ties go to the even number.
        let shifted = places - Vec4::splat(0.5) + Vec4::splat(WHOLE);
        let [a, b, c, d] = shifted.to_array().map(|s| (s.to_bits() & 0x7f) as usize);
        (
            [c * STRIDE + 3 * a, d * STRIDE + 3 * b],
            places - (shifted - Vec4::splat(WHOLE)),
        )
    }
}

impl Table {
    /// Bakes a reflectance in the plane, sr⁻¹; `light` tells which channels are not black.
    ///
    /// Of several tables the one with the least [`Table::error`].
    pub(crate) fn bake(in_plane: impl Fn(Bisected) -> DVec3, light: DVec3) -> (Self, f64) {
        let poses: Vec<_> = drawn().map(|pose| (pose, in_plane(pose))).collect();
        let tables = KNEES.map(|knee| {
            let table = Self::with_knee(&in_plane, light, knee).settle(&in_plane);
            let error = table.error(&poses);
            (table, error)
        });
        tables
            .into_iter()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .expect("there are several")
    }

    fn with_knee(in_plane: impl Fn(Bisected) -> DVec3, light: DVec3, knee: f64) -> Self {
        let axis = Axis::new(knee);
        let mut logs = Vec::with_capacity(ROWS * STRIDE + 1);
        for row in 0..ROWS {
            for column in 0..COLUMNS {
                let rgb = in_plane(pose(axis, column as f64, row as f64));
                logs.extend(self::logs(rgb).to_array());
            }
        }
        logs.push(0.0);
        Self {
            logs,
            axis,
            light: light.as_vec3().extend(0.0),
        }
    }

    /// Half of what the table misses in the middle of its cells goes to their corners: a surface between chords. No corner
    /// becomes brighter than it was and than the middles beside it, so that no light is made up.
    fn settle(mut self, in_plane: impl Fn(Bisected) -> DVec3) -> Self {
        let mut shift = vec![(Vec3::ZERO, 0.0_f32, Vec3::splat(-LOG_MAX)); ROWS * COLUMNS];
        for row in 0..ROWS - 1 {
            for column in 0..COLUMNS - 1 {
                let pose = pose(self.axis, column as f64 + 0.5, row as f64 + 0.5);
                let middle = self.at(row * STRIDE + 3 * column, 0.5, 0.5);
                let true_middle = logs(in_plane(pose));
                let missed = true_middle - middle.truncate();
                for (r, c) in [
                    (row, column),
                    (row, column + 1),
                    (row + 1, column),
                    (row + 1, column + 1),
                ] {
                    let (sum, cells, brightest) = &mut shift[r * COLUMNS + c];
                    *sum += missed;
                    *cells += 1.0;
                    *brightest = brightest.max(true_middle);
                }
            }
        }
        for (node, (sum, cells, brightest)) in self.logs.chunks_exact_mut(3).zip(shift) {
            let log = Vec3::from_slice(node);
            let settled = (log + sum * (0.5 / cells)).min(brightest.max(log));
            settled.map(bounded).write_to_slice(node);
        }
        self
    }

    /// What the table loses: mean |ln(1 + f̂ cos θ_i) − ln(1 + f cos θ_i)| over pairs even in angle below 80°.
    fn error(&self, poses: &[(Bisected, DVec3)]) -> f64 {
        let miss = |(pose, f): &(Bisected, DVec3)| {
            let cos = pose.cosines().product.sqrt();
            let found = self.reflectance(pose.directions()[0], pose.directions()[1]);
            let log = |f: DVec3| (f * cos).map(f64::ln_1p);
            (log(found) - log(*f)).abs().element_sum() / 3.0
        };
        poses.iter().map(miss).sum::<f64>() / poses.len() as f64
    }

    /// log₂ of RGB in the cell that begins at a number; the last lane means nothing.
    #[inline(always)]
    pub(crate) fn at(&self, first: usize, across: f32, along: f32) -> Vec4 {
        let corners = &self.logs[first..first + STRIDE + 7];
        // Two products at once are done sooner than a difference and its product.
        let row = |at: usize| {
            let a = Vec4::from_slice(&corners[at..at + 4]);
            let b = Vec4::from_slice(&corners[at + 3..at + 7]);
            a * (1.0 - across) + b * across
        };
        row(0) * (1.0 - along) + row(STRIDE) * along
    }

    /// The reflectance of two unit vectors above the horizon, as [`Pair`] has it, the angles and all that follows in
    /// f32: the sums and differences of which they are made are not, and lose nothing.
    #[inline]
    pub(crate) fn reflectance(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let (places, most) = Places::new(self.axis, incident, exitant);
        let (cells, within) = places.cells();
        let near = self.at(cells[0], within.x, within.z);
        let far = self.at(cells[1], within.y, within.w);
        let rise = ((far - near) * RISE as f32)
            .max(Vec4::ZERO)
            .min(Vec4::splat(most));
        exp2(near + rise, self.light).truncate().as_dvec3()
    }

    /// Its numbers as they are.
    pub(crate) fn plain(&self) -> PlainTable<'_> {
        PlainTable {
            logs: &self.logs[..ROWS * STRIDE],
            columns: COLUMNS,
            rows: ROWS,
            inverse: self.axis.inverse,
            cells: self.axis.cells,
            light: self.light.truncate().to_array().map(|light| light > 0.0),
        }
    }

    /// Numbers that it consists of.
    pub(crate) fn numbers(&self) -> usize {
        // The axis has two, the channels three.
        self.logs.len() + 5
    }
}

/// By how many units of the last place a number is above 1.
#[inline(always)]
fn last_places(number: f32) -> f32 {
    // Signed, for which the processor has an instruction.
    number.to_bits().wrapping_sub(1_f32.to_bits()).cast_signed() as f32
}

/// The pose of a place in cells.
fn pose(axis: Axis, column: f64, row: f64) -> Bisected {
    let theta_h = 2.0 * axis.tan(column).max(0.0).sqrt().atan();
    let share = row / (ROWS - 1) as f64;
    let sin_d = theta_h.cos() * ((1.0 - share) * (1.0 + share)).max(0.0).sqrt();
    Bisected {
        theta_h,
        theta_d: sin_d.min(1.0).asin(),
    }
}

/// 2ˣ times a factor to 2e-7 of itself for |x| ≤ 126, in all lanes at once.
#[inline(always)]
pub(crate) fn exp2(x: Vec4, factor: Vec4) -> Vec4 {
    let shifted = x + Vec4::splat(WHOLE);
    let t = x - (shifted - Vec4::splat(WHOLE));
    // Taylor of 2ᵗ for |t| ≤ 1/2, in pairs.
    let pair = |[low, high]: [f32; 2]| Vec4::splat(low) + t * high;
    let square = t * t;
    let low = pair(TAYLOR[0]) + square * pair(TAYLOR[1]);
    let high = pair(TAYLOR[2]) + square * LAST_OF_TAYLOR;
    let sum = low + square * square * high;
    let power = shifted.to_array().map(|s| f32::from_bits(s.to_bits() << 23));
    sum * (Vec4::from_array(power) * factor)
}

/// 2ˣ of one number, as [`exp2`] has it: what a loop over many is made of.
#[inline(always)]
pub(crate) fn two_to(x: f32) -> f32 {
    let shifted = x + WHOLE;
    let t = x - (shifted - WHOLE);
    let pair = |[low, high]: [f32; 2]| low + t * high;
    let square = t * t;
    let low = pair(TAYLOR[0]) + square * pair(TAYLOR[1]);
    let high = pair(TAYLOR[2]) + square * LAST_OF_TAYLOR;
    let sum = low + square * square * high;
    sum * f32::from_bits(shifted.to_bits() << 23)
}

/// Adding it leaves a whole number in the last bits, and the bias of an exponent.
const WHOLE: f32 = 12_582_912.0 + 127.0;
/// The coefficients of the Taylor series of 2ᵗ, in pairs.
const TAYLOR: [[f32; 2]; 3] = [
    [1.0, LN_2],
    [LN_2 * LN_2 / 2.0, LN_2 * LN_2 * LN_2 / 6.0],
    [0.009_618_129, 0.001_333_355_8],
];
const LAST_OF_TAYLOR: f32 = 0.000_154_035_3;

/// log₂ of RGB as it is stored.
pub(crate) fn logs(rgb: DVec3) -> Vec3 {
    rgb.map(f64::log2).as_vec3().map(bounded)
}

/// A logarithm as it is stored: its power of 2 is a number that f32 has all digits of.
fn bounded(log: f32) -> f32 {
    log.clamp(-LOG_MAX, LOG_MAX)
}

/// Pairs of directions even in angle below 80°, as pairs in the plane; always the same.
fn drawn() -> impl Iterator<Item = Bisected> {
    (0..DRAWN).map(|n| {
        let [i, o, turn] = STEPS.map(|step| (f64::from(n) * step).fract());
        let (i, o, phi) = (i * THETA_MAX, o * THETA_MAX, turn * std::f64::consts::TAU);
        let direction = |theta: f64, phi: f64| brdf::Spherical { theta, phi }.direction();
        Pair::new(direction(i, phi), direction(o, 0.0)).same_half()
    })
}
