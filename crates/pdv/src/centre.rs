use brdf::Brdf;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// Lobes that are wider than this say less of where their peak stands than the change of the reflectance with the
/// difference angle hides: half width at half height of a lobe whose ln f falls like −ln(1 + x²), rad.
const WIDEST_RAD: f64 = 0.052;
/// How far below the peak of a curve ln f still belongs to its lobe; below, the diffuse part shows.
const DEPTH: f64 = 4.0;
/// How near to the mirror direction the peak of a curve is looked for, rad.
const NEAR_RAD: f64 = 0.052;
/// Beyond this nothing belongs to a lobe that is narrow enough, rad.
const FAR_RAD: f64 = 0.35;
/// How far a curve must reach to both sides of the mirror direction, rad.
const REACH_RAD: f64 = 0.026;
/// Fewest points of a curve that belong to the lobe.
const FEWEST: usize = 4;
/// Share of a reflectance below which no reading is trusted to fit a smooth lobe.
const LEAST_U: f64 = 0.01;
/// Places of the ground and of the heights after the shifts.
const GROUND: usize = 2;
const HEIGHT: usize = 3;
/// Standard deviation that is granted to ln of the ground, about e⁻³ of the lowest point.
const GROUND_U: f64 = 3.0;
/// Powers of the difference angle by which the height of the lobe changes from curve to curve.
const HEIGHTS: usize = 3;
/// Standard deviation that is granted to each of those, beyond the first, in ln f per radian: it keeps apart what one
/// curve alone cannot.
const HEIGHT_SLOPE: f64 = 4.0;
/// Share of its half width by which a lobe that is not quite even may stand elsewhere: standard deviation.
const LOPSIDED: f64 = 0.03;
/// Points of a curve that miss a shape independently of each other.
const ALONE: f64 = 4.0;
/// How far off a lobe is believed to stand, and how unsure that may be, rad: 1.5° and 0.15°.
const FARTHEST_RAD: f64 = 0.026;
const UNSURE_RAD: f64 = 0.0026;
/// Beyond so many standard deviations a point counts less.
const ROBUST: f64 = 2.0;
/// Half widths, rad, from which the search begins.
const BEGIN_RAD: [f64; 3] = [0.008, 0.025, 0.06];
/// Steps of the search; it ends before where nothing changes any more.
const STEPS: usize = 60;

/// A reading on a curve that crosses the mirror direction in the plane of the arms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Signed half angle: half the sum of both arms' angles, rad.
    pub half_rad: f64,
    /// Difference angle: half the difference of both arms' angles, rad.
    pub difference_rad: f64,
    /// Reflectance, sr⁻¹; only positive ones count.
    pub f: f64,
    /// Its standard uncertainty from one reading to the next, sr⁻¹.
    pub u: f64,
}

/// Where the lobe of a curve stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centre {
    /// Signed half angle about which the curve is even, rad: 0 where the angles are right.
    pub half_rad: f64,
    /// Standard uncertainty of it, rad.
    pub u_rad: f64,
}

/// What curves say together: where the lobe of each stands, and what lobe it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Centres {
    /// Of each curve; `None` where it does not tell.
    pub curves: Vec<Option<Centre>>,
    /// The lobe, where it is narrow enough to tell anything.
    pub lobe: Option<NarrowLobe>,
}

/// A lobe that is narrow enough to tell where it stands, on an even ground: a grey BRDF of the half angle θ_h and the
/// difference angle θ_d, exp(height(θ_d))·(1 + (θ_h/a)²)^−b + ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NarrowLobe {
    /// a, rad.
    pub width_rad: f64,
    /// b.
    pub steepness: f64,
    /// ln of the ground in sr⁻¹.
    ground: f64,
    /// Coefficients of the height by powers of θ_d − π/4.
    heights: [f64; HEIGHTS],
}

impl Brdf for NarrowLobe {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let sum = incident + exitant;
        let half = sum.truncate().length().atan2(sum.z);
        // |ω_i − ω_o| = 2 sin θ_d and |ω_i + ω_o| = 2 cos θ_d.
        let difference = incident.distance(exitant).atan2(sum.length()) - std::f64::consts::FRAC_PI_4;
        let height = height(self.heights, difference);
        let fall = (half / self.width_rad).powi(2).ln_1p();
        DVec3::splat((height - self.steepness * fall).exp() + self.ground.exp())
    }
}

/// ln of the height of a lobe at a difference angle, rad from π/4.
fn height(heights: [f64; HEIGHTS], difference: f64) -> f64 {
    (0..HEIGHTS)
        .map(|power| heights[power] * difference.powi(power as i32))
        .sum()
}

/// Where the lobe of each curve stands, told by all curves together.
///
/// By isotropy and reciprocity f in the plane is even in the signed half angle, so that what is off in the angles of a
/// curve shows as the place about which it is even. All curves are taken to have a lobe of one shape,
/// (1 + ((h − s)/a)²)^−b, whose height changes with the difference angle, on an even ground; a, b, the heights, the ground
/// and a shift s for each curve are fitted to ln f by robust least squares (Levenberg and Marquardt). What the shape does
/// not fit widens the uncertainty of the shifts.
///
/// `None` for a curve that does not reach 1.5° to both sides of the mirror direction or has fewer than four points in the
/// lobe, and for all curves of a specimen whose lobe is wider than 3° (half width at half height of b = 1) or that has
/// none.
///
/// ```
/// use pdv::{Crossing, centres};
///
/// // A lobe of one degree, read by arms of which the light's zero is off by 0.2°.
/// let curve: Vec<Crossing> = (-20..=20)
///     .map(|i| {
///         let half = f64::from(i) * 0.005;
///         let f = (1.0 + ((half - 0.1_f64.to_radians()) / 0.0175).powi(2)).recip();
///         Crossing { half_rad: half, difference_rad: 0.5 - half, f, u: 0.0 }
///     })
///     .collect();
/// let centre = centres(&[curve]).curves[0].expect("a sharp lobe");
/// assert!((centre.half_rad.to_degrees() - 0.1).abs() < 0.01);
/// ```
pub fn centres(curves: &[Vec<Crossing>]) -> Centres {
    let mut found = Centres {
        curves: vec![None; curves.len()],
        lobe: None,
    };
    let all: Vec<(usize, Vec<Point>)> = curves
        .iter()
        .map(|curve| lobe(curve))
        .enumerate()
        .filter(|(_, points)| !points.is_empty())
        .collect();
    let telling: Vec<&(usize, Vec<Point>)> = all
        .iter()
        .filter(|(curve, points)| points.len() >= FEWEST && crosses(&curves[*curve]))
        .collect();
    let points: Vec<Point> = telling
        .iter()
        .enumerate()
        .flat_map(|(place, (_, points))| points.iter().map(move |point| Point { place, ..*point }))
        .collect();
    if let Some(fit) = Fit::best(&points, telling.len()) {
        for (place, (curve, _)) in telling.iter().enumerate() {
            found.curves[*curve] = fit.centre(place);
        }
        found.lobe = Some(fit.lobe());
        return found;
    }
    // Where too few readings fell into the lobe for that, all of them together may still tell what lobe it is.
    let points: Vec<Point> = all.into_iter().flat_map(|(_, points)| points).collect();
    found.lobe = Fit::best(&points, 1).map(|fit| fit.lobe());
    found
}

/// A reading of the lobe.
#[derive(Clone, Copy)]
struct Point {
    /// Whose shift holds for it.
    place: usize,
    half: f64,
    /// About the middle of the range that a difference angle may have.
    difference: f64,
    ln_f: f64,
    weight: f64,
}

/// What of a curve belongs to its lobe.
fn lobe(curve: &[Crossing]) -> Vec<Point> {
    let near = |point: &&Crossing| point.half_rad.abs() <= NEAR_RAD && point.f > 0.0;
    let peak = curve
        .iter()
        .filter(near)
        .map(|point| point.f.ln())
        .fold(f64::NEG_INFINITY, f64::max);
    let belongs = |point: &&Crossing| {
        point.f > 0.0 && point.half_rad.abs() <= FAR_RAD && (point.f.ln() - peak).abs() <= DEPTH
    };
    curve
        .iter()
        .filter(belongs)
        .map(|point| Point {
            place: 0,
            half: point.half_rad,
            difference: point.difference_rad - std::f64::consts::FRAC_PI_4,
            ln_f: point.f.ln(),
            weight: (point.u / point.f).hypot(LEAST_U).recip(),
        })
        .collect()
}

/// Whether a curve reaches far enough to both sides of the mirror direction.
fn crosses(curve: &[Crossing]) -> bool {
    let reaches = |side: f64| curve.iter().any(|point| point.half_rad * side >= REACH_RAD);
    reaches(1.0) && reaches(-1.0)
}

/// The lobe that fits all points best, and how well. Parameters: a shift for each curve, ln a, ln b, ln of the ground, the
/// heights.
struct Fit {
    parameters: DVector<f64>,
    curves: usize,
    covariance: DMatrix<f64>,
    cost: f64,
}

impl Fit {
    /// The best of several beginnings; `None` where the lobe is too wide, or has too few points.
    fn best(points: &[Point], curves: usize) -> Option<Self> {
        let fits = BEGIN_RAD
            .iter()
            .filter_map(|&begin| Self::new(points, curves, begin));
        let best = fits.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
        (0.0..=WIDEST_RAD).contains(&best.width_rad()).then_some(best)
    }

    fn new(points: &[Point], curves: usize, width_rad: f64) -> Option<Self> {
        let parameters = curves + HEIGHT + HEIGHTS;
        if curves == 0 || points.len() <= parameters {
            return None;
        }
        let mut at = DVector::zeros(parameters);
        at[curves] = width_rad.ln();
        let lowest = points
            .iter()
            .map(|point| point.ln_f)
            .fold(f64::INFINITY, f64::min);
        at[curves + GROUND] = lowest - 1.0;
        at[curves + HEIGHT] = points
            .iter()
            .map(|point| point.ln_f)
            .fold(f64::NEG_INFINITY, f64::max);
        let mut normal = Normal::new(points, curves, &at);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let step = normal.step(damping)?;
            let next = &at + &step;
            let there = Normal::new(points, curves, &next);
            if there.cost < normal.cost {
                let gained = normal.cost - there.cost;
                (at, normal) = (next, there);
                damping = f64::max(damping / 10.0, 1e-9);
                if gained < 1e-9 * normal.cost {
                    break;
                }
            } else {
                damping *= 10.0;
                if damping > 1e9 {
                    break;
                }
            }
        }
        // Of few points beyond the parameters the misfit itself is unsure: the variance of Student's distribution.
        let freedom = (points.len() - parameters) as f64;
        let misfit = normal.squares / f64::max(freedom - 2.0, 0.5);
        // What the shape misses is missed alike by neighbours.
        let alike = (points.len() as f64 / (ALONE * curves as f64)).max(1.0);
        let misfit = (misfit * alike).max(1.0);
        Some(Self {
            covariance: normal.matrix.clone().try_inverse()? * misfit,
            parameters: at,
            curves,
            cost: normal.cost,
        })
    }

    fn width_rad(&self) -> f64 {
        self.parameters[self.curves].exp()
    }

    fn lobe(&self) -> NarrowLobe {
        let of = |place: usize| self.parameters[self.curves + place];
        NarrowLobe {
            width_rad: self.width_rad(),
            steepness: of(1).exp(),
            ground: of(GROUND),
            heights: std::array::from_fn(|power| of(HEIGHT + power)),
        }
    }

    fn centre(&self, curve: usize) -> Option<Centre> {
        let centre = Centre {
            half_rad: self.parameters[curve],
            u_rad: self.covariance[(curve, curve)]
                .sqrt()
                .hypot(LOPSIDED * self.width_rad()),
        };
        let told = centre.half_rad.abs() <= FARTHEST_RAD && centre.u_rad <= UNSURE_RAD;
        told.then_some(centre)
    }
}

/// The normal equations of the least squares at given parameters.
struct Normal {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Of what the points are off, robustly.
    cost: f64,
    /// The squares of that.
    squares: f64,
}

impl Normal {
    fn new(points: &[Point], curves: usize, at: &DVector<f64>) -> Self {
        let n = at.len();
        let mut of = Self {
            matrix: DMatrix::zeros(n, n),
            gradient: DVector::zeros(n),
            cost: 0.0,
            squares: 0.0,
        };
        let (a, b, ground) = (at[curves].exp(), at[curves + 1].exp(), at[curves + GROUND]);
        let lowest = points
            .iter()
            .map(|point| point.ln_f)
            .fold(f64::INFINITY, f64::min);
        let heights = std::array::from_fn(|power| at[curves + HEIGHT + power]);
        let mut slopes = DVector::zeros(n);
        for point in points {
            let x = (point.half - at[point.place]) / a;
            let fall = (x * x).ln_1p();
            let steep = 2.0 * b * x / (1.0 + x * x);
            slopes.fill(0.0);
            let lobe = height(heights, point.difference) - b * fall;
            let ln_f = lobe.max(ground) + (-(lobe - ground).abs()).exp().ln_1p();
            // Which part of the light is the lobe's.
            let share = (lobe - ln_f).exp();
            slopes[point.place] = share * steep / a;
            slopes[curves] = share * steep * x;
            slopes[curves + 1] = -share * b * fall;
            slopes[curves + GROUND] = 1.0 - share;
            for power in 0..HEIGHTS {
                slopes[curves + HEIGHT + power] = share * point.difference.powi(power as i32);
            }
            let off = (point.ln_f - ln_f) * point.weight;
            // Huber's: beyond a bound the cost grows evenly.
            let share = f64::min(1.0, ROBUST / off.abs().max(f64::MIN_POSITIVE));
            of.cost += off * off * share * (2.0 - share);
            of.squares += off * off * share;
            let weight = point.weight * point.weight * share;
            of.matrix.ger(weight, &slopes, &slopes, 1.0);
            of.gradient.axpy(point.weight * share * off, &slopes, 1.0);
        }
        // A ground that is far below all points changes nothing, and could be anything.
        let ground = at[curves + GROUND] - lowest + 3.0;
        let i = curves + GROUND;
        of.matrix[(i, i)] += GROUND_U.powi(-2);
        of.gradient[i] -= ground * GROUND_U.powi(-2);
        of.cost += (ground / GROUND_U).powi(2);
        for power in 1..HEIGHTS {
            let i = curves + HEIGHT + power;
            of.matrix[(i, i)] += HEIGHT_SLOPE.powi(-2);
            of.gradient[i] -= at[i] * HEIGHT_SLOPE.powi(-2);
            of.cost += (at[i] / HEIGHT_SLOPE).powi(2);
        }
        of
    }

    fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let mut matrix = self.matrix.clone();
        for i in 0..matrix.nrows() {
            matrix[(i, i)] += damping * matrix[(i, i)].max(f64::MIN_POSITIVE);
        }
        Some(matrix.cholesky()?.solve(&self.gradient))
    }
}

#[cfg(test)]
mod tests {
    use brdf::{Brdf, Fitted};

    use super::*;
    use crate::{Distribution, Pdv, spread};

    /// The planes of config/jobs/three-planes.toml, or of fly.toml, read on a material by arms whose angles are off by
    /// known amounts, curve by curve.
    fn read(material: &Fitted, readings: usize, shifts_deg: [f64; 3]) -> Vec<Vec<Crossing>> {
        let planes = [20.0_f64, 45.0, 70.0].into_iter().zip(shifts_deg);
        let plane = |(deg, shift_deg): (f64, f64)| {
            let theta_r = deg.to_radians();
            let sine = 85_f64.to_radians().sin();
            let reach = [
                theta_r.sin() - sine..=theta_r.sin() - (theta_r - 0.09).sin().abs(),
                theta_r.sin() - (theta_r - 0.09).sin().abs()..=theta_r.sin() + sine,
            ];
            let spread = spread(Distribution::Lobe, theta_r, &reach, readings, 1.5e-3);
            let crossing = |&deviation: &f64| {
                let light = (deviation - theta_r.sin()).clamp(-1.0, 1.0).asin();
                let (incident, exitant) = Pdv::in_plane(theta_r, deviation).directions()?;
                let shift = shift_deg.to_radians();
                let f = material.eval(incident, exitant).element_sum() / 3.0;
                Some(Crossing {
                    half_rad: (light + theta_r) / 2.0 + shift,
                    difference_rad: (theta_r - light) / 2.0,
                    f,
                    u: 0.002 * f,
                })
            };
            spread.deviations.iter().filter_map(crossing).collect()
        };
        planes.map(plane).collect()
    }

    /// Of all materials that were fitted by others than this file: those with a sharp lobe tell where it stands, the
    /// others say nothing, and the stated uncertainty holds.
    #[test]
    fn the_lobe_of_every_fitted_material_stands_where_it_was_put_or_is_not_told() {
        let shifts = [0.25, -0.1, 0.06];
        for readings in [14, 40] {
            let (mut told, mut within, mut worst) = (0, 0, 0.0_f64);
            for (name, material) in Fitted::all() {
                let found = centres(&read(&material, readings, shifts)).curves;
                for (centre, shift) in found.into_iter().zip(shifts) {
                    let Some(centre) = centre else { continue };
                    let off_deg = centre.half_rad.to_degrees() - shift;
                    let u_deg = 2.0 * centre.u_rad.to_degrees();
                    told += 1;
                    within += usize::from(off_deg.abs() <= u_deg);
                    worst = worst.max(off_deg.abs());
                    println!("{readings} {name}: {off_deg:+.3}° ± {u_deg:.3}°");
                }
            }
            println!("{readings} readings: {within} of {told} within, {worst:.3}° at worst");
            assert!(told >= 60, "{told} curves tell where their lobe stands");
            assert!(within * 100 >= told * 93, "{within} of {told} within k = 2");
        }
    }

    #[test]
    fn what_cannot_tell_says_nothing() {
        let flat: Vec<Crossing> = (-20..=20)
            .map(|i| Crossing {
                half_rad: f64::from(i) * 0.02,
                difference_rad: 0.6,
                f: 0.3,
                u: 0.001,
            })
            .collect();
        let sharp = |half: f64| (1.0 + (half / 0.01).powi(2)).recip();
        let one_sided: Vec<Crossing> = (0..20)
            .map(|i| Crossing {
                half_rad: f64::from(i) * 0.01,
                difference_rad: 0.6,
                f: sharp(f64::from(i) * 0.01),
                u: 0.0,
            })
            .collect();
        for curves in [vec![flat], vec![one_sided, Vec::new()], Vec::new()] {
            assert_eq!(centres(&curves).curves, vec![None; curves.len()]);
        }
    }
}
