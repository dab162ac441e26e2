use brdf::Brdf;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::Pdv;

/// A calibrated reading in the plane of the arms: what a factor is made of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observation {
    /// Zenith angle of the sensor, rad, 0 … π/2.
    pub theta_r: f64,
    /// Signed deviation from the mirror direction: |·| is d_p; positive towards the normal (φ_p = 0), negative
    /// outwards (φ_p = π).
    pub deviation: f64,
    /// Reflectance in sr⁻¹.
    pub rgb: DVec3,
}

impl Observation {
    /// What a perfect instrument would read on a BRDF; `None` where light or sensor cannot stand there.
    ///
    /// ```
    /// use brdf::Lambert;
    /// use pdv::Observation;
    ///
    /// let half = Lambert::new(0.5)?;
    /// let reading = Observation::of(&half, 0.6, 0.1).expect("light can stand there");
    /// assert_eq!(reading.rgb.x, 0.5 / std::f64::consts::PI);
    /// // Outwards there is only 1 − sin θ_r.
    /// assert!(Observation::of(&half, 0.6, -0.5).is_none());
    /// # Ok::<(), brdf::Error>(())
    /// ```
    pub fn of(brdf: &(impl Brdf + ?Sized), theta_r: f64, deviation: f64) -> Option<Self> {
        let (incident, exitant) = Pdv::in_plane(theta_r, deviation).directions()?;
        Some(Self {
            theta_r,
            deviation,
            rgb: brdf.eval(incident, exitant),
        })
    }

    /// PDV coordinates, φ_p 0 or π.
    ///
    /// ```
    /// use brdf::Lambert;
    /// use pdv::Observation;
    ///
    /// let outwards = Observation::of(&Lambert::new(0.5)?, 0.6, -0.1).expect("light can stand there").pdv();
    /// assert_eq!((outwards.d_p, outwards.phi_p), (0.1, std::f64::consts::PI));
    /// # Ok::<(), brdf::Error>(())
    /// ```
    pub fn pdv(&self) -> Pdv {
        Pdv::in_plane(self.theta_r, self.deviation)
    }

    /// ln(1 + ρ), the domain in which the paper separates (section 4); a negative reading counts as 0.
    pub(crate) fn log(&self) -> DVec3 {
        DVec3::from_array(
            self.rgb
                .to_array()
                .map(|rho| if rho < 0.0 { 0.0 } else { rho.ln_1p() }),
        )
    }
}
