use brdf::Brdf;
use glam::DVec3;

use crate::model::Basis;
use crate::sides::Sides;
use crate::{Error, Factor, FactorTable, Model, Observation};

/// G(x) below this, ln(1 + 1e-6 sr⁻¹), is black: no ratio can be made of it.
const BLACK: f64 = 1e-6;
/// What rounding may carry a squared sine below the first that was read.
const ROUNDING: f64 = 1e-12;
/// How far, as a factor, ρ may lie above the brightest reading of its channel: F is a ratio, and where G(x) is faint it
/// would carry noise to wherever G is bright.
const ABOVE: f64 = 2.0;
/// Largest difference of θ_r within a plane, rad: what a servo may stand off its goal, and no other plane.
pub(crate) const THETA_R_SPREAD: f64 = 0.02;
/// Largest difference of d_p within an arc.
const OFFSET_SPREAD: f64 = 0.05;

/// The paper's separable model ln(1 + ρ) = F(θ_r)·G(d_p) (Eq. 3), with F = F_m(θ_r)/G(x).
///
/// G is what a plane at θ_r^dp measures and F_m what an arc measures that keeps d_p = x; both in ln(1 + ρ), per
/// channel. Where G was measured on both sides of the mirror direction they are averaged, see
/// [`Separable::from_observations`]. Beyond the measured ranges both factors are held constant, which
/// [`Model::extrapolated`] tells; in each channel ρ is kept within 0 … twice the brightest reading of that channel. Not
/// reciprocal, since F depends on ω_o alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Separable {
    theta_r: f64,
    intersection: f64,
    /// Over sin² θ_r and d_p², which need neither angle nor root at evaluation.
    f: Factor,
    g: Factor,
    /// The largest ln(1 + ρ).
    most: DVec3,
    dropped: usize,
}

impl Separable {
    /// The model of one plane and one arc.
    ///
    /// - The readings of both sides of the plane become one G: at the mirror direction both have the same weight,
    ///   outwards that of the outward side fades linearly to none at its end, from where on the side towards the
    ///   normal stands alone.
    /// - x is the mean deviation of the arc and G(x) is taken on its side, so that F(θ_r^dp) is 1 where nothing is
    ///   wrong. Where G(x) is black (below 1e-6) in a channel, F is 1 in it.
    /// - Without an arc F is 1 everywhere, and all but the plane's θ_r is extrapolated.
    /// - Readings that are not finite are dropped and counted; negative ones count as 0.
    ///
    /// # Errors
    /// No finite reading of the plane, none of an arc that is not empty, or θ_r of the plane or d_p of the arc that
    /// differ by more than 0.02 rad or 0.05 and so belong to several sweeps.
    ///
    /// ```
    /// # use pdv::Observation;
    /// # let gold = brdf::Fitted::named("gold-paint").expect("one of the fitted materials");
    /// # let plane = |theta_r: f64| -> Vec<Observation> {
    /// #     let deviations = [-0.04, 0.0, 0.02, 0.06, 0.15, 0.4, 0.8];
    /// #     deviations.iter().filter_map(|&d| Observation::of(&gold, theta_r, d)).collect()
    /// # };
    /// # let arc: Vec<_> = [0.1, 0.5, 0.9, 1.3].iter().filter_map(|&t| Observation::of(&gold, t, 0.0)).collect();
    ///
    /// use brdf::Brdf;
    ///
    /// let model = pdv::Separable::from_observations(&plane(0.5), &arc)?;
    /// // F is 1 where the arc crosses the plane, so that the plane is given back.
    /// let (incident, exitant) = plane(0.5)[4].pdv().directions().expect("it was read there");
    /// assert!((model.eval(incident, exitant) / plane(0.5)[4].rgb - 1.0).abs().max_element() < 0.05);
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn from_observations(plane: &[Observation], arc: &[Observation]) -> Result<Self, Error> {
        let sides = Sides::new(plane)?;
        let readings = plane.iter().chain(arc).filter(|o| o.rgb.is_finite());
        let brightest = readings.fold(DVec3::ZERO, |most, o| most.max(o.rgb));
        let most = (ABOVE * brightest).map(f64::ln_1p);
        let g = sides.factor()?;
        let theta_r = steady(
            "θ_r of a plane, in rad,",
            plane.iter().map(|o| o.theta_r),
            THETA_R_SPREAD,
        )?;
        if arc.is_empty() {
            let f = Factor::over_squares("F", [(theta_r.sin(), DVec3::ONE)])?;
            return Ok(Self {
                theta_r,
                intersection: 0.0,
                f,
                g,
                most,
                dropped: sides.dropped(),
            });
        }
        let intersection = steady("d_p of an arc", arc.iter().map(|o| o.deviation), OFFSET_SPREAD)?;
        let measured = Factor::over_squares("F", arc.iter().map(|o| (o.theta_r.sin(), o.log())))?;
        let dropped = sides.dropped() + measured.dropped();
        let at_x = sides.at(intersection);
        let black = at_x.cmplt(DVec3::splat(BLACK));
        let f = measured.map(|f| DVec3::select(black, DVec3::ONE, f / at_x.max(DVec3::splat(BLACK))));
        Ok(Self {
            theta_r,
            intersection,
            f,
            g,
            most,
            dropped,
        })
    }

    /// The model of a BRDF as a perfect instrument would see it: a plane at `theta_r` (rad) read at signed
    /// `deviations`, and an arc read at `arc` (θ_r in rad) at the deviation `intersection`. Poses that do not exist
    /// are left out.
    ///
    /// # Errors
    /// No pose exists.
    ///
    /// ```
    /// use brdf::Lambert;
    /// use pdv::Separable;
    ///
    /// let model = Separable::sample(&Lambert::new(0.5)?, 0.5, &[-0.2, 0.0, 0.5], &[0.2, 0.5, 1.0], 0.0)?;
    /// assert!((model.g().at(0.0).x - (0.5 / std::f64::consts::PI).ln_1p()).abs() < 1e-15);
    /// assert!((model.f().at(0.5_f64.sin().powi(2)).x - 1.0).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn sample(
        brdf: &(impl Brdf + ?Sized),
        theta_r: f64,
        deviations: &[f64],
        arc: &[f64],
        intersection: f64,
    ) -> Result<Self, Error> {
        let plane: Vec<_> = deviations
            .iter()
            .filter_map(|&d| Observation::of(brdf, theta_r, d))
            .collect();
        let arc: Vec<_> = arc
            .iter()
            .filter_map(|&theta| Observation::of(brdf, theta, intersection))
            .collect();
        Self::from_observations(&plane, &arc)
    }

    /// θ_r^dp, where the plane was measured, rad.
    pub fn theta_r(&self) -> f64 {
        self.theta_r
    }

    /// x, the signed deviation at which the arc crosses the plane.
    pub fn intersection(&self) -> f64 {
        self.intersection
    }

    /// F over sin² θ_r, normalised: 1 at θ_r^dp.
    pub fn f(&self) -> &Factor {
        &self.f
    }

    /// G over d_p², as ln(1 + ρ).
    pub fn g(&self) -> &Factor {
        &self.g
    }

    /// Readings that were not finite.
    pub fn dropped(&self) -> usize {
        self.dropped
    }
}

impl Separable {
    /// Whether a d_p² lies where the light of the plane would stand before the sensor: between the readings next to
    /// the retro-reflection at 2 sin θ_r, where they are farther apart than their neighbours.
    fn in_hole(&self, d_p: f64) -> bool {
        let nodes: Vec<f64> = self.g.points().map(|(square, _)| square).collect();
        let retro = (2.0 * self.theta_r.sin()).powi(2);
        let after = nodes.partition_point(|&node| node < retro);
        if after == 0 || after == nodes.len() || !(nodes[after - 1] < d_p && d_p < nodes[after]) {
            return false;
        }
        let width = |n: usize| {
            nodes
                .get(n)
                .zip(nodes.get(n.wrapping_sub(1)))
                .map(|(b, a)| b.sqrt() - a.sqrt())
        };
        let here = width(after).unwrap_or_default();
        [after.wrapping_sub(1), after + 1]
            .into_iter()
            .filter_map(width)
            .all(|next| here > next)
    }
}

impl Brdf for Separable {
    #[inline]
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        let [sin_o, d_p] = squares(incident, exitant);
        let log = self.f.at(sin_o) * self.g.at(d_p);
        DVec3::new(
            exp_m1(log.x, self.most.x),
            exp_m1(log.y, self.most.y),
            exp_m1(log.z, self.most.z),
        )
    }
}

impl Model for Separable {
    fn basis(&self, incident: DVec3, exitant: DVec3) -> Basis {
        let [sin_o, d_p] = squares(incident, exitant);
        let below = sin_o < self.f.range().0 - ROUNDING;
        let gap = below || self.in_hole(d_p);
        match gap || self.f.extrapolated(sin_o) || self.g.extrapolated(d_p) {
            true => Basis::Extrapolated,
            false => Basis::Interpolated,
        }
    }

    fn phi_p_constant(&self) -> bool {
        true
    }

    fn about(&self) -> String {
        format!(
            "the separable model of a plane at {:.2}° and an arc that crosses it at d_p = {:.4}; {} readings dropped",
            self.theta_r.to_degrees(),
            self.intersection,
            self.dropped
        )
    }

    fn factors(&self) -> Vec<FactorTable> {
        let f = self
            .f
            .points()
            .map(|(sin, value)| (sin.sqrt().min(1.0).asin().to_degrees(), value));
        let g = self.g.points().map(|(square, value)| (square.sqrt(), value));
        vec![
            FactorTable {
                name: "F",
                variable: "theta_r_deg",
                rows: f.collect(),
            },
            FactorTable {
                name: "G",
                variable: "d_p",
                rows: g.collect(),
            },
        ]
    }
}

/// eˣ − 1 with x kept within 0 … `most`: rounding may put a cubic just below its nodes.
#[inline]
fn exp_m1(x: f64, most: f64) -> f64 {
    let x = if x > 0.0 { x } else { 0.0 };
    (if x < most { x } else { most }).exp_m1()
}

/// sin² θ_o and d_p² with d_p = |L_p − R_p| and R_p = −V_p, from unit vectors without any angle.
#[inline]
fn squares(incident: DVec3, exitant: DVec3) -> [f64; 2] {
    let (view, deviation) = (exitant.truncate(), incident.truncate() + exitant.truncate());
    [view.length_squared(), deviation.length_squared()]
}

/// Mean of what should stand still; non-finite values are left out.
pub(crate) fn steady(
    what: &'static str,
    values: impl Iterator<Item = f64>,
    allowed: f64,
) -> Result<f64, Error> {
    let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if high - low > allowed {
        return Err(Error::Mixed {
            what,
            low,
            high,
            allowed,
        });
    }
    Ok(values.iter().sum::<f64>() / values.len().max(1) as f64)
}
