use glam::DVec3;

/// A bidirectional reflectance distribution function.
pub trait Brdf: Send + Sync {
    /// Reflectance f_r(ω_i, ω_o) as linear RGB in sr⁻¹, finite and ≥ 0.
    ///
    /// ω_i points to the light, ω_o to the viewer; both are unit vectors in the specimen frame (z the normal).
    /// Zero where either is at or below the horizon (z ≤ 0).
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3;

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

    fn valid(&self, incident: DVec3, exitant: DVec3) -> bool {
        (**self).valid(incident, exitant)
    }
}

impl<B: Brdf + ?Sized> Brdf for std::sync::Arc<B> {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        (**self).eval(incident, exitant)
    }

    fn valid(&self, incident: DVec3, exitant: DVec3) -> bool {
        (**self).valid(incident, exitant)
    }
}
