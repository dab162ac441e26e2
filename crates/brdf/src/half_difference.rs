use glam::DVec3;

/// A pair of directions of an isotropic BRDF by half vector and difference vector (Rusinkiewicz 1998).
///
/// h = (ω_i + ω_o)/|ω_i + ω_o|; ω_i turned by −φ_h about z and −θ_h about y is the difference vector d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfDifference {
    /// Zenith angle of the half vector, rad, 0 … π/2 for directions above the horizon.
    pub theta_h: f64,
    /// Angle between half vector and either direction, rad, 0 … π/2.
    pub theta_d: f64,
    /// Azimuth of the difference vector about the half vector, rad, −π … π; φ_d and φ_d + π differ by swapping the
    /// directions.
    pub phi_d: f64,
}

impl HalfDifference {
    /// The coordinates of two unit vectors.
    ///
    /// Total: where the half vector is the normal its azimuth is taken as 0, where the directions coincide φ_d is 0,
    /// and opposite directions, which have no half vector, are given the normal. φ_d is conditioned like
    /// 1/(sin θ_h · sin θ_d), the directions that belong to it are not.
    ///
    /// ```
    /// use brdf::HalfDifference;
    /// use glam::DVec3;
    ///
    /// // A light that grazes one way and a viewer that looks along the normal.
    /// let angles = HalfDifference::from_directions(DVec3::X, DVec3::Z);
    /// assert!((angles.theta_h.to_degrees() - 45.0).abs() < 1e-12);
    /// assert!((angles.theta_d.to_degrees() - 45.0).abs() < 1e-12);
    /// ```
    pub fn from_directions(incident: DVec3, exitant: DVec3) -> Self {
        let sum = incident + exitant;
        let difference = incident - exitant;
        let across = sum.x.hypot(sum.y);
        let length = sum.length();
        // |ω_i − ω_o| = 2 sin θ_d and |ω_i + ω_o| = 2 cos θ_d: no acos of a dot product near 1.
        let theta_d = difference.length().atan2(length);
        let (sin_phi, cos_phi) = if across > 0.0 {
            (sum.y / across, sum.x / across)
        } else {
            (0.0, 1.0)
        };
        let (sin_theta, cos_theta) = if length > 0.0 {
            (across / length, sum.z / length)
        } else {
            (0.0, 1.0)
        };
        // The difference is perpendicular to h and points as d does, without cancelling the common part.
        let along = cos_theta * (cos_phi * difference.x + sin_phi * difference.y) - sin_theta * difference.z;
        let beside = cos_phi * difference.y - sin_phi * difference.x;
        Self {
            theta_h: across.atan2(sum.z),
            theta_d,
            phi_d: beside.atan2(along),
        }
    }

    /// Incident and exitant unit vectors with the half vector in the x–z plane; either may lie below the horizon.
    ///
    /// ```
    /// use brdf::HalfDifference;
    ///
    /// let angles = HalfDifference { theta_h: 0.3, theta_d: 0.5, phi_d: 1.0 };
    /// let (incident, exitant) = angles.directions();
    /// assert!((incident.dot(exitant) - 1.0_f64.cos()).abs() < 1e-15, "2 θ_d lie between them");
    /// let back = HalfDifference::from_directions(incident, exitant);
    /// assert!((back.phi_d - 1.0).abs() < 1e-14);
    /// ```
    pub fn directions(self) -> (DVec3, DVec3) {
        let (sin_h, cos_h) = self.theta_h.sin_cos();
        let (sin_d, cos_d) = self.theta_d.sin_cos();
        let (sin_phi, cos_phi) = self.phi_d.sin_cos();
        let half = DVec3::new(sin_h, 0.0, cos_h) * cos_d;
        let deviation = DVec3::new(cos_h * cos_phi, sin_phi, -sin_h * cos_phi) * sin_d;
        (half + deviation, half - deviation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Spherical;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    fn upper() -> impl Strategy<Value = DVec3> {
        (0.0..FRAC_PI_2, -PI..PI).prop_map(|(theta, phi)| Spherical { theta, phi }.direction())
    }

    proptest! {
        #[test]
        fn prop_coordinates_round_trip(
            theta_h in 1e-3..FRAC_PI_2 - 1e-3,
            theta_d in 1e-3..FRAC_PI_2 - 1e-3,
            phi_d in -PI + 1e-9..PI,
        ) {
            let (incident, exitant) = HalfDifference { theta_h, theta_d, phi_d }.directions();
            let back = HalfDifference::from_directions(incident, exitant);
            let loss = 1.0 / (theta_h.sin() * theta_d.sin() * theta_d.cos());
            prop_assert!((back.theta_h - theta_h).abs() < 4e-15 / theta_d.cos(), "{back:?}");
            prop_assert!((back.theta_d - theta_d).abs() < 4e-15, "{back:?}");
            prop_assert!((back.phi_d - phi_d).abs() < 4e-15 * loss, "{back:?}");
        }

        /// Zenith cosines and the angle between the directions are all that an isotropic BRDF depends on.
        #[test]
        fn prop_directions_round_trip(incident in upper(), exitant in upper()) {
            let (i, o) = HalfDifference::from_directions(incident, exitant).directions();
            prop_assert!((i.z - incident.z).abs() < 1e-14);
            prop_assert!((o.z - exitant.z).abs() < 1e-14);
            prop_assert!((i.dot(o) - incident.dot(exitant)).abs() < 1e-14);
        }

        #[test]
        fn prop_swapping_the_directions_turns_phi_d_by_half_a_turn(incident in upper(), exitant in upper()) {
            let there = HalfDifference::from_directions(incident, exitant);
            let back = HalfDifference::from_directions(exitant, incident);
            prop_assert_eq!(there.theta_h, back.theta_h);
            prop_assert_eq!(there.theta_d, back.theta_d);
            let turn = (there.phi_d - back.phi_d).abs();
            prop_assert!(there.theta_d == 0.0 || (turn - PI).abs() < 1e-14, "{}", turn);
        }
    }

    #[test]
    fn normal_incidence_and_equal_directions_are_defined() {
        let along = HalfDifference::from_directions(DVec3::Z, DVec3::Z);
        assert_eq!((along.theta_h, along.theta_d, along.phi_d), (0.0, 0.0, 0.0));
        let direction = Spherical { theta: 1.0, phi: 2.0 }.direction();
        let retro = HalfDifference::from_directions(direction, direction);
        assert!((retro.theta_h - 1.0).abs() < 1e-15);
        assert_eq!(retro.theta_d, 0.0);
    }

    #[test]
    fn opposite_directions_at_the_horizon_are_defined() {
        let grazing = HalfDifference::from_directions(DVec3::X, DVec3::NEG_X);
        assert_eq!((grazing.theta_h, grazing.theta_d), (0.0, FRAC_PI_2));
    }
}
