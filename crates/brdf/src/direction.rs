use glam::DVec3;

/// A direction in spherical coordinates of the specimen frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spherical {
    /// Angle from the normal, rad, 0 … π.
    pub theta: f64,
    /// Azimuth from +x towards +y, rad; −π … π where it was computed, any where it is given.
    pub phi: f64,
}

impl Spherical {
    /// The coordinates of a direction of any length but zero; φ = 0 along the normal.
    ///
    /// `atan2` keeps full precision at the pole and at the horizon, where `acos z` would lose half the digits.
    ///
    /// ```
    /// use brdf::Spherical;
    /// use glam::DVec3;
    ///
    /// let east = Spherical::from_direction(DVec3::X);
    /// assert_eq!((east.theta.to_degrees(), east.phi), (90.0, 0.0));
    /// // 1e-12 rad from the normal, which an arc cosine would lose.
    /// let near = Spherical::from_direction(DVec3::new(0.0, 1e-12, 1.0));
    /// assert!((near.theta / 1e-12 - 1.0).abs() < 1e-14);
    /// ```
    pub fn from_direction(direction: DVec3) -> Self {
        Self {
            theta: direction.x.hypot(direction.y).atan2(direction.z),
            phi: direction.y.atan2(direction.x),
        }
    }

    /// The unit vector (sin θ cos φ, sin θ sin φ, cos θ).
    ///
    /// ```
    /// use brdf::Spherical;
    /// use std::f64::consts::FRAC_PI_4;
    ///
    /// let direction = Spherical { theta: FRAC_PI_4, phi: 0.0 }.direction();
    /// assert!((direction.x - direction.z).abs() < 1e-15 && direction.y == 0.0);
    /// ```
    pub fn direction(self) -> DVec3 {
        let (sin_theta, cos_theta) = self.theta.sin_cos();
        let (sin_phi, cos_phi) = self.phi.sin_cos();
        DVec3::new(sin_theta * cos_phi, sin_theta * sin_phi, cos_theta)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    proptest! {
        #[test]
        fn prop_spherical_round_trip(theta in 1e-6..PI - 1e-6, phi in -PI..PI) {
            let back = Spherical::from_direction(Spherical { theta, phi }.direction());
            prop_assert!((back.theta - theta).abs() < 1e-14, "{back:?}");
            prop_assert!((back.phi - phi).abs() < 1e-14, "{back:?}");
        }
    }

    #[test]
    fn the_normal_has_azimuth_zero() {
        assert_eq!(
            Spherical::from_direction(DVec3::Z),
            Spherical { theta: 0.0, phi: 0.0 }
        );
    }

    #[test]
    fn a_tiny_zenith_angle_survives() {
        let back = Spherical::from_direction(
            Spherical {
                theta: 1e-12,
                phi: 1.0,
            }
            .direction(),
        );
        assert!((back.theta / 1e-12 - 1.0).abs() < 1e-14, "{back:?}");
    }
}
