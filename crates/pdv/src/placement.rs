use brdf::Brdf;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// How a specimen lies on the stage: first turned about its own normal, then tilted by a wedge under it.
///
/// Flat and not turned, the frame of the specimen is that of the rig: x in the plane of the arms, z away from the stage.
/// A wedge about an axis in the plane of the arms (`axis` 0) takes their sweeps out of a plane with the normal; one about
/// an axis across it (`axis` 90°) only shifts both angles. A turn shows an isotropic specimen nothing new.
///
/// ```
/// use brdf::HalfDifference;
/// use pdv::Placement;
///
/// let wedge = Placement { tilt: 20_f64.to_radians(), ..Placement::FLAT };
/// // The mirror direction of the flat specimen, arms at ∓30°: the half vector leans by the tilt, 60° lie between the arms.
/// let pair = wedge.pair(-30_f64.to_radians(), 30_f64.to_radians()).expect("both stand above the specimen");
/// let angles = HalfDifference::from_directions(pair.0, pair.1);
/// assert!((angles.theta_h.to_degrees() - 20.0).abs() < 1e-12);
/// assert!((angles.theta_d.to_degrees() - 30.0).abs() < 1e-12);
/// // 70° from the normal of a wedge of 80° across the arms, an arm at 20° stands at the horizon.
/// let across = Placement { tilt: 80_f64.to_radians(), axis: 90_f64.to_radians(), ..Placement::FLAT };
/// assert!(across.pair(0.0, 20_f64.to_radians()).is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// By how much the specimen is turned about its normal, rad, from +x towards +y.
    pub azimuth: f64,
    /// Angle of the wedge, rad, 0 … below π/2: how far the normal leans.
    pub tilt: f64,
    /// Azimuth of the line on the stage about which the wedge tilts, rad, from +x towards +y; the normal leans towards
    /// `axis` + 90°.
    pub axis: f64,
}

impl Placement {
    /// On the stage itself, not turned.
    pub const FLAT: Self = Self {
        azimuth: 0.0,
        tilt: 0.0,
        axis: 0.0,
    };

    /// The normal of the specimen in the frame of the rig.
    ///
    /// ```
    /// use pdv::Placement;
    ///
    /// let wedge = Placement { tilt: 0.3, ..Placement::FLAT };
    /// assert!((wedge.normal() - glam::DVec3::new(0.0, 0.3_f64.sin(), 0.3_f64.cos())).length() < 1e-15);
    /// ```
    pub fn normal(&self) -> DVec3 {
        self.of_rig().row(2)
    }

    /// A direction of the rig's frame in the frame of the specimen.
    ///
    /// ```
    /// use glam::DVec3;
    /// use pdv::Placement;
    ///
    /// let direction = DVec3::new(0.6, 0.0, 0.8);
    /// assert_eq!(Placement::FLAT.seen(direction), direction);
    /// let wedge = Placement { tilt: 0.3, ..Placement::FLAT };
    /// assert!((wedge.seen(wedge.normal()) - DVec3::Z).length() < 1e-15);
    /// ```
    pub fn seen(&self, of_rig: DVec3) -> DVec3 {
        self.of_rig() * of_rig
    }

    /// The direction of an arm at `alpha`, rad from the rig's normal, as a unit vector in the frame of the specimen.
    ///
    /// For a wedge about the plane of the arms it is (sin α, −cos α sin τ, cos α cos τ).
    pub fn direction(&self, alpha: f64) -> DVec3 {
        let (sin, cos) = alpha.sin_cos();
        self.seen(DVec3::new(sin, 0.0, cos))
    }

    /// The true directions to light and sensor, whose arms stand at these angles, rad; `None` where either stands at the
    /// specimen's horizon or below, or an angle is not finite.
    pub fn pair(&self, light: f64, sensor: f64) -> Option<(DVec3, DVec3)> {
        let (incident, exitant) = (self.direction(light), self.direction(sensor));
        (incident.z > 0.0 && exitant.z > 0.0).then_some((incident, exitant))
    }

    /// What takes a vector of the rig's frame into that of the specimen.
    fn of_rig(&self) -> DMat3 {
        // The normal leans to the left of the axis, which is a negative turn about it.
        DMat3::from_rotation_z(-self.azimuth)
            * DMat3::from_axis_angle(DVec3::new(self.axis.cos(), self.axis.sin(), 0.0), self.tilt)
    }
}

/// A reading of a specimen that does not lie flat, by its true directions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WedgeReading {
    /// Unit vector to the light, in the frame of the specimen.
    pub incident: DVec3,
    /// Unit vector to the sensor.
    pub exitant: DVec3,
    /// Reflectance in sr⁻¹.
    pub rgb: DVec3,
}

impl WedgeReading {
    /// What a perfect instrument would read on a BRDF with its arms at these angles, rad; `None` as [`Placement::pair`].
    ///
    /// ```
    /// use brdf::Lambert;
    /// use pdv::{Placement, WedgeReading};
    ///
    /// let wedge = Placement { tilt: 0.3, ..Placement::FLAT };
    /// let half = Lambert::new(0.5)?;
    /// let reading = WedgeReading::of(&half, &wedge, -0.5, 0.5).expect("both arms stand above it");
    /// assert_eq!(reading.rgb.x, 0.5 / std::f64::consts::PI);
    /// # Ok::<(), brdf::Error>(())
    /// ```
    pub fn of(brdf: &(impl Brdf + ?Sized), on: &Placement, light: f64, sensor: f64) -> Option<Self> {
        let (incident, exitant) = on.pair(light, sensor)?;
        Some(Self {
            incident,
            exitant,
            rgb: brdf.eval(incident, exitant),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use brdf::HalfDifference;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Rounding of a few products of sines.
    const LITTLE: f64 = 1e-14;

    fn placement() -> impl Strategy<Value = Placement> {
        (-PI..PI, 0.0..1.5, -PI..PI).prop_map(|(azimuth, tilt, axis)| Placement { azimuth, tilt, axis })
    }

    fn alpha() -> std::ops::Range<f64> {
        -FRAC_PI_2..FRAC_PI_2
    }

    proptest! {
        /// A placement is a turn: lengths and angles stay, and the cosine of a zenith angle is that to the leaning normal.
        #[test]
        fn prop_a_placement_keeps_angles(on in placement(), light in alpha(), sensor in alpha()) {
            let (i, o) = (on.direction(light), on.direction(sensor));
            prop_assert!((i.length() - 1.0).abs() < LITTLE);
            prop_assert!((i.dot(o) - (light - sensor).cos()).abs() < LITTLE);
            let of_rig = DVec3::new(light.sin(), 0.0, light.cos());
            prop_assert!((i.z - on.normal().dot(of_rig)).abs() < LITTLE);
            prop_assert!((on.normal().z - on.tilt.cos()).abs() < LITTLE, "the normal leans by the tilt");
            let towards = on.axis + FRAC_PI_2;
            let leans = DVec3::new(towards.cos(), towards.sin(), 0.0) * on.tilt.sin();
            prop_assert!((on.normal().with_z(0.0) - leans).length() < LITTLE, "towards axis + 90°");
        }

        /// Arms at m ± δ over a wedge about their plane: θ_d = δ, cos θ_h = cos m cos τ, E = sin² τ sin² δ.
        #[test]
        fn prop_a_wedge_about_the_plane_of_the_arms_leads_out_of_it(
            tilt in 0.01..1.4_f64, m in -1.3..1.3_f64, delta in 0.01..1.3_f64,
        ) {
            let wedge = Placement { tilt, ..Placement::FLAT };
            let (sin, cos) = (m - delta).sin_cos();
            let written = DVec3::new(sin, -cos * tilt.sin(), cos * tilt.cos());
            prop_assert!((wedge.direction(m - delta) - written).length() < LITTLE);
            let (i, o) = (wedge.direction(m - delta), wedge.direction(m + delta));
            let angles = HalfDifference::from_directions(i, o);
            prop_assert!((angles.theta_d - delta).abs() < 1e-12);
            prop_assert!((angles.theta_h.cos() - m.cos() * tilt.cos()).abs() < 1e-12);
            let out = (angles.theta_h.sin() * angles.theta_d.sin() * angles.phi_d.sin()).powi(2);
            prop_assert!((out - (tilt.sin() * delta.sin()).powi(2)).abs() < 1e-12, "{}", out);
            let above = (m - delta).abs() < FRAC_PI_2 && (m + delta).abs() < FRAC_PI_2;
            prop_assert_eq!(wedge.pair(m - delta, m + delta).is_some(), above);
        }

        /// A wedge about an axis across the arms shifts both angles by its own, and leads nowhere else.
        #[test]
        fn prop_a_wedge_across_the_arms_shifts_their_angles(tilt in 0.0..1.5, alpha in alpha()) {
            let across = Placement { tilt, axis: FRAC_PI_2, ..Placement::FLAT };
            let shifted = alpha + tilt;
            let written = DVec3::new(shifted.sin(), 0.0, shifted.cos());
            prop_assert!((across.direction(alpha) - written).length() < LITTLE);
        }

        /// A turn about its normal is nothing to an isotropic specimen, and without a tilt there is no axis.
        #[test]
        fn prop_a_turn_changes_no_pair(on in placement(), azimuth in -PI..PI, light in alpha(), sensor in alpha()) {
            let turned = Placement { azimuth, ..on };
            let pair = |on: &Placement| (on.direction(light), on.direction(sensor));
            let ((a, b), (i, o)) = (pair(&on), pair(&turned));
            prop_assert!((a.z - i.z).abs() < LITTLE && (b.z - o.z).abs() < LITTLE);
            prop_assert!((a.dot(b) - i.dot(o)).abs() < LITTLE);
            let flat = Placement { tilt: 0.0, axis: on.axis, azimuth: 0.0 };
            prop_assert!((flat.direction(light) - Placement::FLAT.direction(light)).length() < LITTLE);
        }
    }

    #[test]
    fn an_arm_beneath_the_specimen_has_no_pair() {
        let across = Placement {
            tilt: 0.5,
            axis: FRAC_PI_2,
            ..Placement::FLAT
        };
        assert!(across.pair(1.2, 0.0).is_none() && across.pair(0.0, 1.2).is_none());
        assert!(across.pair(-1.2, 0.9).is_some());
        assert!(Placement::FLAT.pair(f64::NAN, 0.0).is_none());
    }
}
