use std::f64::consts::{FRAC_PI_2, PI};

use brdf::Spherical;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// How far beyond the rim of the disk rounding may carry a projected direction.
const RIM: f64 = 1.0 + 4.0 * f64::EPSILON;

/// A pair of directions of an isotropic BRDF in Projected Deviation Vector coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pdv {
    /// Zenith angle of the viewer and so of its mirror direction, rad, 0 … π/2.
    pub theta_r: f64,
    /// Length of the deviation from the mirror direction on the projected disk, 0 … 2.
    pub d_p: f64,
    /// Azimuth of the deviation, rad, −π … π; 0 points from the mirror direction across the normal.
    pub phi_p: f64,
}

impl Pdv {
    /// The coordinates of a pair of directions given by angles (Algorithm 1 of the paper).
    ///
    /// `None` where a zenith angle is outside 0 … π/2 or a number is not finite.
    ///
    /// ```
    /// use brdf::Spherical;
    /// use pdv::Pdv;
    ///
    /// let (light, viewer) = (Spherical { theta: 0.4, phi: 3.0 }, Spherical { theta: 0.6, phi: 3.0 });
    /// let same_side = Pdv::from_angles(light, viewer).expect("both are above the horizon");
    /// assert!((same_side.d_p - (0.4_f64.sin() + 0.6_f64.sin())).abs() < 1e-15);
    /// assert!(Pdv::from_angles(Spherical { theta: 1.6, phi: 0.0 }, viewer).is_none());
    /// ```
    pub fn from_angles(incident: Spherical, exitant: Spherical) -> Option<Self> {
        let upper = 0.0..=FRAC_PI_2;
        if !(upper.contains(&incident.theta) && upper.contains(&exitant.theta)) {
            return None;
        }
        let light = DVec2::from_angle(incident.phi - exitant.phi) * incident.theta.sin();
        let deviation = light + DVec2::X * exitant.theta.sin();
        Self::from_deviation(exitant.theta, deviation)
    }

    /// The coordinates of two unit vectors, ω_i to the light and ω_o to the viewer.
    ///
    /// `None` where either lies below the horizon or is not finite. Viewed along the normal, the azimuth of the
    /// viewer is taken as 0.
    ///
    /// ```
    /// use glam::DVec3;
    /// use pdv::Pdv;
    ///
    /// let viewer = DVec3::new(0.6, 0.0, 0.8);
    /// // In the mirror direction there is no deviation, along the normal one of sin θ_r.
    /// let mirror = Pdv::from_directions(DVec3::new(-0.6, 0.0, 0.8), viewer).expect("above the horizon");
    /// let normal = Pdv::from_directions(DVec3::Z, viewer).expect("above the horizon");
    /// assert_eq!((mirror.d_p, normal.d_p, normal.phi_p), (0.0, 0.6, 0.0));
    /// ```
    pub fn from_directions(incident: DVec3, exitant: DVec3) -> Option<Self> {
        if !(incident.z >= 0.0 && exitant.z >= 0.0) {
            return None;
        }
        let sin_o = exitant.x.hypot(exitant.y);
        let view = if sin_o > 0.0 {
            exitant.truncate() / sin_o
        } else {
            DVec2::X
        };
        let light = DVec2::new(view.dot(incident.truncate()), view.perp_dot(incident.truncate()));
        Self::from_deviation(sin_o.atan2(exitant.z), light + DVec2::X * sin_o)
    }

    fn from_deviation(theta_r: f64, deviation: DVec2) -> Option<Self> {
        (theta_r.is_finite() && deviation.is_finite()).then(|| Self {
            theta_r,
            d_p: deviation.x.hypot(deviation.y),
            phi_p: deviation.y.atan2(deviation.x),
        })
    }

    /// The coordinates in the plane of the arms by the signed deviation: positive towards the normal (φ_p = 0),
    /// negative outwards (φ_p = π).
    ///
    /// ```
    /// use pdv::Pdv;
    ///
    /// assert_eq!(Pdv::in_plane(0.6, 0.2).phi_p, 0.0);
    /// assert_eq!(Pdv::in_plane(0.6, -0.2).phi_p, std::f64::consts::PI);
    /// ```
    pub fn in_plane(theta_r: f64, deviation: f64) -> Self {
        Self {
            theta_r,
            d_p: deviation.abs(),
            phi_p: if deviation < 0.0 { PI } else { 0.0 },
        }
    }

    /// Where the light stands on the projected disk, with the viewer at azimuth 0; `None` off the disk.
    fn light(self) -> Option<DVec2> {
        if !(0.0..=FRAC_PI_2).contains(&self.theta_r) || self.d_p.is_nan() || self.d_p < 0.0 {
            return None;
        }
        let (sin_p, cos_p) = self.phi_p.sin_cos();
        let light = DVec2::new(self.d_p * cos_p - self.theta_r.sin(), self.d_p * sin_p);
        let length = light.x.hypot(light.y);
        // Rounding may put a light that stands at the rim just beyond it.
        (length <= RIM).then(|| if length > 1.0 { light / length } else { light })
    }

    /// Incident and exitant direction by angles, the viewer at azimuth 0 (Algorithm 2 of the paper); `None` where
    /// the paper returns null: the deviation leads beyond the rim of the disk, or θ_r beyond the horizon.
    ///
    /// The paper divides by cos φ_i, which is 0 at φ_i = ±90°; sin θ_i = |L_p| needs no division. θ_i is conditioned
    /// like 1/cos θ_i: at the rim half the digits are lost, and going back regains them.
    ///
    /// ```
    /// use pdv::Pdv;
    ///
    /// // Where the paper divides by cos φ_i = 0: a light beside the plane.
    /// let pdv = Pdv { theta_r: 0.0, d_p: 0.5, phi_p: std::f64::consts::FRAC_PI_2 };
    /// let (light, _) = pdv.angles().expect("it is on the disk");
    /// assert!((light.theta.sin() - 0.5).abs() < 1e-15);
    /// assert!((light.phi - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    /// ```
    pub fn angles(self) -> Option<(Spherical, Spherical)> {
        let light = self.light()?;
        let sin = light.x.hypot(light.y);
        let incident = Spherical {
            theta: sin.atan2(cos_from_sin(sin)),
            phi: light.y.atan2(light.x),
        };
        Some((
            incident,
            Spherical {
                theta: self.theta_r,
                phi: 0.0,
            },
        ))
    }

    /// Incident and exitant unit vectors, the viewer at azimuth 0; `None` as in [`Pdv::angles`].
    ///
    /// ```
    /// use pdv::Pdv;
    ///
    /// let pdv = Pdv { theta_r: 0.7, d_p: 0.3, phi_p: 1.0 };
    /// let (incident, exitant) = pdv.directions().expect("it is on the disk");
    /// let back = Pdv::from_directions(incident, exitant).expect("above the horizon");
    /// assert!((back.d_p - 0.3).abs() < 1e-15 && (back.phi_p - 1.0).abs() < 1e-14);
    /// assert!(Pdv { d_p: 1.9, ..pdv }.directions().is_none());
    /// ```
    pub fn directions(self) -> Option<(DVec3, DVec3)> {
        let light = self.light()?;
        let (sin_o, cos_o) = self.theta_r.sin_cos();
        // sin 90° is 1 and cos 90° is 6e-17 in f64, never negative.
        Some((
            light.extend(cos_from_sin(light.x.hypot(light.y))),
            DVec3::new(sin_o, 0.0, cos_o),
        ))
    }
}

/// √(1 − s²) without cancellation, for 0 ≤ s ≤ 1.
fn cos_from_sin(sin: f64) -> f64 {
    ((1.0 - sin) * (1.0 + sin)).max(0.0).sqrt()
}

/// Signed angle of the light from the normal, rad, at a signed deviation with the viewer at +θ_r in the same plane;
/// `None` where no light can stand.
///
/// ```
/// use pdv::light_angle;
///
/// assert_eq!(light_angle(0.6, 0.6_f64.sin()), Some(0.0), "the light stands on the normal");
/// assert!((light_angle(0.6, 0.0).expect("the mirror direction") + 0.6).abs() < 1e-15);
/// assert_eq!(light_angle(0.6, 1.9), None);
/// ```
pub fn light_angle(theta_r: f64, deviation: f64) -> Option<f64> {
    let sin = deviation - theta_r.sin();
    (sin.abs() <= RIM).then(|| sin.atan2(cos_from_sin(sin.abs())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn direction(theta_max: f64) -> impl Strategy<Value = DVec3> {
        (0.0..theta_max, -PI..PI).prop_map(|(theta, phi)| Spherical { theta, phi }.direction())
    }

    /// Difference of two azimuths, the short way round.
    fn turn(a: f64, b: f64) -> f64 {
        let turn = (a - b).rem_euclid(2.0 * PI);
        turn.min(2.0 * PI - turn)
    }

    proptest! {
        #[test]
        fn prop_pdv_to_directions_and_back(theta_r in 0.0..1.5_f64, d_p in 1e-3..2.0_f64, phi_p in -PI..PI) {
            let pdv = Pdv { theta_r, d_p, phi_p };
            let Some((incident, exitant)) = pdv.directions() else { return Err(TestCaseError::reject("off the disk")) };
            let back = Pdv::from_directions(incident, exitant).expect("above the horizon");
            prop_assert!((back.theta_r - theta_r).abs() < 1e-12, "{:?}", back);
            prop_assert!((back.d_p - d_p).abs() < 1e-12, "{:?}", back);
            prop_assert!(turn(back.phi_p, phi_p) < 1e-12, "{:?}", back);

            let (incident, exitant) = pdv.angles().expect("on the disk");
            let back = Pdv::from_angles(incident, exitant).expect("above the horizon");
            prop_assert!((back.theta_r - theta_r).abs() < 1e-12, "{:?}", back);
            prop_assert!((back.d_p - d_p).abs() < 1e-12, "{:?}", back);
            prop_assert!(turn(back.phi_p, phi_p) < 1e-12, "{:?}", back);
        }

        /// Towards d_p = 0 the length keeps its absolute precision, the azimuth loses as 1/d_p.
        #[test]
        fn prop_loss_near_the_mirror_direction(theta_r in 0.0..1.5_f64, log in -12.0..-3.0_f64, phi_p in -PI..PI) {
            let d_p = 10.0_f64.powf(log);
            let (incident, exitant) = Pdv { theta_r, d_p, phi_p }.directions().expect("near the mirror direction");
            let back = Pdv::from_directions(incident, exitant).expect("above the horizon");
            prop_assert!((back.d_p - d_p).abs() < 1e-15, "{:?}", back);
            prop_assert!(turn(back.phi_p, phi_p) < 1e-15 / d_p, "{:?}", back);
        }

        /// The other way round: θ_i loses as 1/cos θ_i towards the rim, where the projection flattens.
        #[test]
        fn prop_directions_to_pdv_and_back(
            log in -7.5..0.0_f64, phi in -PI..PI, exitant in direction(FRAC_PI_2),
        ) {
            let theta = FRAC_PI_2 - 10.0_f64.powf(log).min(FRAC_PI_2);
            let incident = Spherical { theta, phi }.direction();
            let pdv = Pdv::from_directions(incident, exitant).expect("above the horizon");
            let (i, o) = pdv.angles().expect("it comes from directions");
            prop_assert!((i.theta - theta).abs() < 1e-15 / theta.cos(), "{:?} instead of {}", i, theta);
            let view = Spherical::from_direction(exitant);
            prop_assert!((o.theta - view.theta).abs() < 1e-15, "{:?}", o);
            prop_assert!(turn(i.phi, phi - view.phi) < 4e-15 / theta.sin(), "{:?}", i);
        }

        #[test]
        fn prop_angles_and_vectors_agree(incident in direction(1.57), exitant in direction(1.57)) {
            let by_vectors = Pdv::from_directions(incident, exitant).expect("above the horizon");
            let by_angles =
                Pdv::from_angles(Spherical::from_direction(incident), Spherical::from_direction(exitant))
                    .expect("above the horizon");
            prop_assert!((by_vectors.d_p - by_angles.d_p).abs() < 1e-14);
            prop_assert!(turn(by_vectors.phi_p, by_angles.phi_p) * by_vectors.d_p < 1e-14);
        }

        #[test]
        fn prop_d_p_is_reciprocal_and_tells_the_half_angle(incident in direction(1.5), exitant in direction(1.5)) {
            let there = Pdv::from_directions(incident, exitant).expect("above the horizon");
            let back = Pdv::from_directions(exitant, incident).expect("above the horizon");
            prop_assert!((there.d_p - back.d_p).abs() < 1e-15);
            let half = brdf::HalfDifference::from_directions(incident, exitant);
            let tangent = there.d_p / (incident.z + exitant.z);
            prop_assert!((tangent.atan() - half.theta_h).abs() < 1e-14);
        }

        #[test]
        fn prop_nothing_panics(numbers in prop::array::uniform6(prop::num::f64::ANY)) {
            let [a, b, c, d, e, f] = numbers;
            let _ = Pdv { theta_r: a, d_p: b, phi_p: c }.directions();
            let _ = Pdv { theta_r: a, d_p: b, phi_p: c }.angles();
            let _ = Pdv::from_directions(DVec3::new(a, b, c), DVec3::new(d, e, f));
            let _ = Pdv::from_angles(Spherical { theta: a, phi: b }, Spherical { theta: c, phi: d });
            let _ = light_angle(e, f);
        }
    }

    /// Where the paper's Algorithm 2 divides by cos φ_i = 0.
    #[test]
    fn the_light_beside_the_plane_is_exact() {
        for side in [FRAC_PI_2, -FRAC_PI_2] {
            let light = Spherical {
                theta: 0.6,
                phi: side,
            };
            let pdv = Pdv::from_angles(light, Spherical { theta: 0.4, phi: 0.0 }).unwrap();
            let (back, _) = pdv.angles().unwrap();
            assert!(
                (back.theta - 0.6).abs() < 1e-15 && (back.phi - side).abs() < 1e-15,
                "{back:?}"
            );
        }
    }

    #[test]
    fn the_normal_and_the_rim_are_exact() {
        let normal = Pdv::from_directions(DVec3::Z, DVec3::Z).unwrap();
        assert_eq!(
            normal,
            Pdv {
                theta_r: 0.0,
                d_p: 0.0,
                phi_p: 0.0
            }
        );
        assert_eq!(normal.directions(), Some((DVec3::Z, DVec3::Z)));
        // Both at the horizon: mirror direction, and retro with the largest d_p there is.
        let mirror = Pdv::from_directions(DVec3::NEG_X, DVec3::X).unwrap();
        assert_eq!((mirror.theta_r, mirror.d_p), (FRAC_PI_2, 0.0));
        let retro = Pdv::from_directions(DVec3::X, DVec3::X).unwrap();
        assert_eq!((retro.d_p, retro.phi_p), (2.0, 0.0));
        let (incident, _) = retro.angles().unwrap();
        assert_eq!(
            incident,
            Spherical {
                theta: FRAC_PI_2,
                phi: 0.0
            }
        );
        for n in 0..360 {
            let light = Spherical {
                theta: FRAC_PI_2,
                phi: f64::from(n).to_radians(),
            };
            let pdv = Pdv::from_angles(light, Spherical { theta: 0.7, phi: 0.0 }).unwrap();
            let (back, _) = pdv.angles().expect("the rim belongs to the disk");
            assert!((back.theta - FRAC_PI_2).abs() < 1e-7, "{n}°: {back:?}");
        }
    }

    #[test]
    fn beyond_the_disk_there_is_nothing() {
        let at = |theta_r, d_p, phi_p| Pdv { theta_r, d_p, phi_p }.directions();
        assert_eq!(at(0.5, 1.9, 0.0), None);
        assert_eq!(at(0.5, 0.6, PI), None, "outwards there is only 1 − sin θ_r");
        assert_eq!(at(1.6, 0.1, 0.0), None);
        assert_eq!(at(0.5, -0.1, 0.0), None);
        assert_eq!(at(0.5, f64::NAN, 0.0), None);
        assert_eq!(Pdv::from_directions(DVec3::NEG_Z, DVec3::Z), None);
        assert_eq!(light_angle(0.5, 1.6), None);
    }

    #[test]
    fn in_the_plane_the_sign_tells_the_side() {
        let theta_r = 0.9_f64;
        for deviation in [-0.2, 0.0, 0.5, 1.5] {
            let alpha = light_angle(theta_r, deviation).unwrap();
            let (incident, exitant) = Pdv::in_plane(theta_r, deviation).directions().unwrap();
            assert!(
                (incident - DVec3::new(alpha.sin(), 0.0, alpha.cos())).length() < 1e-15,
                "{deviation}"
            );
            assert!((incident.x + exitant.x - deviation).abs() < 1e-15, "{deviation}");
        }
    }
}
