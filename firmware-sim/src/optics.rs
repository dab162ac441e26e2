use std::sync::Arc;

use arms::{ArmAngle, Envelope, Pose};
use brdf::Brdf;
use glam::DVec3;
use rig::Filling;

/// What light does between lamp and photometer: reflectance averaged over both apertures, cosine, occlusion.
pub(crate) struct Optics {
    specimen: Arc<dyn Brdf>,
    envelope: Envelope,
    filling: Filling,
    /// Offsets within the source's and the detector's aperture, as tangents of angles.
    source: Vec<[f64; 2]>,
    detector: Vec<[f64; 2]>,
}

impl std::fmt::Debug for Optics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Optics")
            .field("envelope", &self.envelope)
            .field("filling", &self.filling)
            .finish_non_exhaustive()
    }
}

impl Optics {
    /// Apertures are half angles in rad, of discs seen from the specimen; 0 is a point.
    pub(crate) fn new(
        specimen: Arc<dyn Brdf>,
        envelope: Envelope,
        filling: Filling,
        apertures: [f64; 2],
    ) -> Self {
        let [source, detector] = apertures.map(disc);
        Self {
            specimen,
            envelope,
            filling,
            source,
            detector,
        }
    }

    /// f·cos in sr⁻¹: mean reflectance over the apertures times the cosine of the filling; 0 where one arm shadows
    /// the other.
    pub(crate) fn signal(&self, pose: Pose) -> DVec3 {
        if self.envelope.occluded(pose) {
            return DVec3::ZERO;
        }
        let cos = match self.filling {
            Filling::Over => pose.incident().z,
            Filling::Under => pose.exitant().z,
        };
        let exitant: Vec<DVec3> = self.detector.iter().map(|&at| within(pose.sensor, at)).collect();
        let mut sum = DVec3::ZERO;
        for &at in &self.source {
            let incident = within(pose.light, at);
            for &exitant in &exitant {
                sum += self.specimen.eval(incident, exitant);
            }
        }
        sum * (cos.max(0.0) / (self.source.len() * self.detector.len()) as f64)
    }
}

/// A direction of the aperture that an arm carries.
fn within(angle: ArmAngle, [along, across]: [f64; 2]) -> DVec3 {
    if along == 0.0 && across == 0.0 {
        return angle.direction();
    }
    let (sin, cos) = angle.rad().sin_cos();
    (DVec3::new(sin, 0.0, cos) + along * DVec3::new(cos, 0.0, -sin) + across * DVec3::Y).normalize()
}

/// Equally weighted points of a disc: two rings of six at the Gauss–Legendre nodes of r², turned against each other.
/// Exact for polynomials up to degree 5.
fn disc(half_angle_rad: f64) -> Vec<[f64; 2]> {
    if half_angle_rad == 0.0 {
        return vec![[0.0, 0.0]];
    }
    let node = 1.0 / 3.0_f64.sqrt();
    let ring = |r2: f64, turn: f64| {
        let radius = half_angle_rad.tan() * r2.sqrt();
        (0..6).map(move |i| {
            let (sin, cos) = ((f64::from(i) + turn) * std::f64::consts::FRAC_PI_3).sin_cos();
            [radius * cos, radius * sin]
        })
    };
    ring((1.0 - node) / 2.0, 0.0)
        .chain(ring((1.0 + node) / 2.0, 0.5))
        .collect()
}
