use brdf::Brdf;
use glam::DVec3;

use crate::bisected::Pair;
use crate::model::Basis;
use crate::surface::Surface;
use crate::sweeps::Sweeps;
use crate::table::Table;
use crate::{Error, FactorTable, Model, Observation, PlainTable, Shape};

/// A reciprocal BRDF of one or more planes and an arc.
///
/// In the plane f = A (c_i c_o)^κ + s V expm1(G(θ_h, θ_d)·F(θ_d)), c_i and c_o the cosines of the zenith angles,
/// V = 1/((c_i(1−a)+a)(c_o(1−a)+a)): a diffuse floor and a lobe G over the half angle whose peak F is read on the arc,
/// where θ_h = 0 and θ_i = θ_o = θ_d. For s → ∞ it is the product of lobe and Fresnel-like arc; below that a power law
/// whose lobe narrows as its peak rises, as the paper's Eq. 3 (s = 1, A = 0, V = 1).
///
/// Out of the plane a pair takes the value of the pair in the plane with the same half angle and the same product of
/// cosines, B(θ_h, c_i c_o). It always exists, so that nothing is asked for beyond the horizon. Its difference angle is
/// smaller, cos² θ_d* = c_i c_o + sin² θ_h, and with it what grows towards grazing with the difference angle; 0.4 of
/// the logarithm by which the pair with the same θ_d and product is brighter is added, at least 0 and at most E/(2 cos²
/// θ_d + E) ≈ ln(cos θ_d*/cos θ_d), E = sin² θ_h sin² θ_d sin² φ_d. Everything is symmetric, so that light and viewer
/// may be swapped.
///
/// [`Brdf::eval`] reads a table in f32 that was baked of this; [`Planes::exact`] is the formula itself, in f64.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    surface: Surface,
    table: Table,
    /// What the table loses.
    loss: f64,
    error: Option<f64>,
    dropped: usize,
}

impl Planes {
    /// The model of planes and an arc, with the shape that best predicts each side of each plane from the others.
    ///
    /// Readings that are not finite or where no light can stand are dropped and counted, negative ones count as 0,
    /// several at one pose are averaged. Without an arc the planes' own peaks take its place. Where there are no two
    /// sides to compare the shape is [`Shape::DEFAULT`].
    ///
    /// # Errors
    /// No usable reading of any plane, none of an arc that is not empty, or θ_r within a plane that differ by more
    /// than 0.02 rad.
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
    /// use pdv::{Model, Planes};
    ///
    /// let model = Planes::from_observations(&[plane(0.3), plane(1.0)], &arc)?;
    /// let (incident, exitant) = plane(0.3)[3].pdv().directions().expect("it was read there");
    /// let found = model.exact(incident, exitant);
    /// assert!((found / plane(0.3)[3].rgb - 1.0).abs().max_element() < 1e-6, "it gives back what was read");
    /// assert!(!model.extrapolated(incident, exitant));
    /// assert!(Planes::from_observations(&[], &arc).is_err());
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn from_observations(planes: &[Vec<Observation>], arc: &[Observation]) -> Result<Self, Error> {
        let sweeps = Sweeps::new(planes, arc)?;
        let (surface, error) = crate::choice::choose(&sweeps)?;
        let (table, loss) = Table::bake(|pose| surface.at(pose, None), sweeps.light());
        Ok(Self {
            surface,
            table,
            loss,
            error,
            dropped: sweeps.dropped,
        })
    }

    /// [`Planes::exact`] of other readings of the same specimen, with this model's shape.
    ///
    /// # Errors
    /// As [`Planes::from_observations`].
    pub(crate) fn surface_of(
        &self,
        planes: &[Vec<Observation>],
        arc: &[Observation],
    ) -> Result<Surface, Error> {
        Surface::new(&Sweeps::new(planes, arc)?, self.shape())
    }

    /// Reflectance as [`Brdf::eval`] gives it, but by the formula and in f64, not from the table.
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
    /// let model = pdv::Planes::from_observations(&[plane(0.3), plane(1.0)], &arc)?;
    /// let (incident, exitant) = plane(1.0)[4].pdv().directions().expect("it was read there");
    /// let (table, formula) = (model.eval(incident, exitant), model.exact(incident, exitant));
    /// assert!((table / formula - 1.0).abs().max_element() < 0.1);
    /// // Light and viewer may be swapped.
    /// assert_eq!(formula, model.exact(exitant, incident));
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn exact(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        self.surface.eval(incident, exitant)
    }

    /// What the table loses: mean |ln(1 + f̂ c) − ln(1 + f c)| over pairs in the plane, c = √(cos θ_i cos θ_o), that
    /// stand for pairs even in angle below 80°.
    pub fn loss(&self) -> f64 {
        self.loss
    }

    /// The numbers of the table that [`Brdf::eval`] reads.
    ///
    /// ```
    /// # use pdv::Observation;
    /// # let grey = brdf::Lambert::new(0.5).expect("0.5 is an albedo");
    /// # let plane: Vec<_> = [-0.1, 0.0, 0.2].iter().filter_map(|&d| Observation::of(&grey, 0.5, d)).collect();
    /// let model = pdv::Planes::from_observations(&[plane], &[])?;
    /// let table = model.plain_table();
    /// assert_eq!(table.logs.len(), 3 * table.columns * table.rows);
    /// // Three readings of a perfect diffuser say little of what lies far from them, and never more than there can be.
    /// assert!(table.logs.iter().all(|log| log.is_finite() && *log < 0.0));
    /// # Ok::<(), pdv::Error>(())
    /// ```
    pub fn plain_table(&self) -> PlainTable<'_> {
        self.table.plain()
    }

    /// f32 numbers of the table, 4 bytes each.
    pub fn numbers(&self) -> usize {
        self.table.numbers()
    }

    /// The shape that was chosen.
    pub fn shape(&self) -> Shape {
        self.surface.excess.shape
    }

    /// A, the diffuse floor towards the normal, sr⁻¹.
    pub fn diffuse(&self) -> DVec3 {
        self.surface.excess.diffuse
    }

    /// How far each side of a plane is from what the others predict: the mean of
    /// |ln(f̂ cos θ_i + 0.1) − ln(f cos θ_i + 0.1)|; `None` where there was but one side.
    pub fn error(&self) -> Option<f64> {
        self.error
    }

    /// Readings that were not finite, or where no light can stand.
    pub fn dropped(&self) -> usize {
        self.dropped
    }
}

impl Brdf for Planes {
    #[inline]
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !(incident.z > 0.0 && exitant.z > 0.0) {
            return DVec3::ZERO;
        }
        self.table.reflectance(incident, exitant)
    }

    fn eval_all(&self, incident: &[[f64; 3]], exitant: &[[f64; 3]], rgb: &mut [[f64; 3]]) {
        assert_eq!(
            (incident.len(), exitant.len()),
            (rgb.len(), rgb.len()),
            "one result a pair"
        );
        self.table.reflectances(incident, exitant, rgb);
    }
}

impl Model for Planes {
    fn basis(&self, incident: DVec3, exitant: DVec3) -> Basis {
        self.surface.basis(Pair::new(incident, exitant).same_half())
    }

    fn about(&self) -> String {
        let Shape {
            scale,
            diffuse,
            shadowing,
            darkening,
        } = self.shape();
        let why = self.error.map_or_else(
            || "a moderate shape, taken untested, for there are no two sides to compare".to_owned(),
            |error| {
                format!(
                    "the shape with which its sides predict each other best, to {error:.4} in ln(f cos + 0.1)"
                )
            },
        );
        format!(
            "the reciprocal model of {} sides of planes and an arc, with {why}: s = {scale:.3} 1/sr, q = {diffuse:.2}, \
             a = {shadowing:.2}, κ = {darkening:.2}; {} readings dropped; as a table of \
             {} numbers it loses {:.1e} of ln(1 + f cos)",
            self.surface.lobe.rows().count(),
            self.dropped,
            self.numbers(),
            self.loss
        )
    }

    fn factors(&self) -> Vec<FactorTable> {
        self.surface.factors()
    }
}
