use glam::DVec3;

/// A bidirectional reflectance distribution function.
pub trait Brdf: Send + Sync {
    /// Reflectance f_r(ω_i, ω_o) as linear RGB in sr⁻¹, finite and ≥ 0.
    ///
    /// ω_i points to the light, ω_o to the viewer; both are unit vectors in the specimen frame (z the normal).
    /// Zero where either is at or below the horizon (z ≤ 0).
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3;

    /// Evaluates many pairs of directions, each as [`Brdf::eval`] does; all slices have one length.
    ///
    /// A table that can look up several pairs at once overrides it.
    ///
    /// # Panics
    /// The slices differ in length.
    ///
    /// ```
    /// use brdf::{Brdf, Lambert};
    ///
    /// let mut rgb = [[0.0; 3]; 2];
    /// let (up, down) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
    /// Lambert::new(0.5)?.eval_all(&[up, up], &[up, down], &mut rgb);
    /// assert_eq!(rgb, [[0.5 / std::f64::consts::PI; 3], [0.0; 3]]);
    /// # Ok::<(), brdf::Error>(())
    /// ```
    fn eval_all(&self, incident: &[[f64; 3]], exitant: &[[f64; 3]], rgb: &mut [[f64; 3]]) {
        assert_eq!(
            (incident.len(), exitant.len()),
            (rgb.len(), rgb.len()),
            "one result a pair"
        );
        for ((incident, exitant), rgb) in incident.iter().zip(exitant).zip(rgb) {
            *rgb = self
                .eval(DVec3::from_array(*incident), DVec3::from_array(*exitant))
                .to_array();
        }
    }

    /// Whether the answer for these directions rests on anything: false where a measured table has only invalid
    /// entries around them. Analytic BRDFs are valid everywhere.
    fn valid(&self, _incident: DVec3, _exitant: DVec3) -> bool {
        true
    }
}

impl<B: Brdf + ?Sized> Brdf for Box<B> {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        (**self).eval(incident, exitant)
    }

    fn eval_all(&self, incident: &[[f64; 3]], exitant: &[[f64; 3]], rgb: &mut [[f64; 3]]) {
        (**self).eval_all(incident, exitant, rgb);
    }

    fn valid(&self, incident: DVec3, exitant: DVec3) -> bool {
        (**self).valid(incident, exitant)
    }
}

impl<B: Brdf + ?Sized> Brdf for std::sync::Arc<B> {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        (**self).eval(incident, exitant)
    }

    fn eval_all(&self, incident: &[[f64; 3]], exitant: &[[f64; 3]], rgb: &mut [[f64; 3]]) {
        (**self).eval_all(incident, exitant, rgb);
    }

    fn valid(&self, incident: DVec3, exitant: DVec3) -> bool {
        (**self).valid(incident, exitant)
    }
}
