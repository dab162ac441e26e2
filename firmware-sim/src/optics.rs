use std::sync::Arc;

use arms::{ArmAngle, Envelope, Pose};
use brdf::Brdf;
use glam::DVec3;
use pdv::Placement;
use rig::Filling;

/// What light does between lamp and photometer: reflectance averaged over both apertures, cosine, occlusion.
pub(crate) struct Optics {
    specimen: Arc<dyn Brdf>,
    /// How it lies on the stage; the arms do not know of it.
    place: Placement,
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
            place: Placement::FLAT,
            envelope,
            filling,
            source,
            detector,
        }
    }

    /// Puts the specimen on a wedge, or turns it.
    pub(crate) fn place(&mut self, place: Placement) {
        self.place = place;
    }

    /// A direction of the rig's frame in that of the specimen.
    fn seen(&self, direction: DVec3) -> DVec3 {
        // Most specimens lie flat, and this is asked for often.
        if self.place == Placement::FLAT {
            return direction;
        }
        self.place.seen(direction)
    }

    /// f·cos in sr⁻¹: mean reflectance over the apertures times the cosine of the filling; 0 where one arm shadows
    /// the other.
    pub(crate) fn signal(&self, pose: Pose) -> DVec3 {
        if self.envelope.occluded(pose) {
            return DVec3::ZERO;
        }
        let cos = match self.filling {
            Filling::Over => self.seen(pose.incident()).z,
            Filling::Under => self.seen(pose.exitant()).z,
        };
        let exitant = self.detector.iter().map(|&at| within(pose.sensor, at));
        let exitant: Vec<DVec3> = exitant.map(|direction| self.seen(direction)).collect();
        let mut sum = DVec3::ZERO;
        for &at in &self.source {
            let incident = self.seen(within(pose.light, at));
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

#[cfg(test)]
mod tests {
    use super::*;

    use arms::Limits;
    use brdf::Mirror;

    fn envelope() -> Envelope {
        let limits = Limits {
            min: ArmAngle::from_deg(-88.0),
            max: ArmAngle::from_deg(88.0),
        };
        Envelope {
            light: limits,
            sensor: limits,
            separation_rad: 5f64.to_radians(),
            can_pass: true,
        }
    }

    fn optics(text: &str, filling: Filling, apertures_deg: [f64; 2]) -> Optics {
        let specimen = brdf::specimen(text).unwrap();
        Optics::new(specimen, envelope(), filling, apertures_deg.map(f64::to_radians))
    }

    #[test]
    fn the_disc_has_the_moments_of_a_disc() {
        let radius = 0.01_f64;
        let points = disc(radius.atan());
        let mean = |f: &dyn Fn(f64, f64) -> f64| {
            points
                .iter()
                .map(|&[x, y]| f(x / radius, y / radius))
                .sum::<f64>()
                / points.len() as f64
        };
        let moments = [
            mean(&|x, _| x),
            mean(&|x, y| x * y),
            mean(&|x, _| x * x) - 1.0 / 4.0,
            mean(&|_, y| y.powi(4)) - 1.0 / 8.0,
            mean(&|x, y| (x * y).powi(2)) - 1.0 / 24.0,
            mean(&|x, _| x.powi(5)),
        ];
        for (i, moment) in moments.into_iter().enumerate() {
            assert!(moment.abs() < 1e-12, "moment {i} is off by {moment}");
        }
    }

    #[test]
    fn the_cosine_is_that_of_the_declared_filling() {
        let pose = Pose::from_deg(-60.0, 20.0);
        let f = 0.5 / std::f64::consts::PI;
        for (filling, cos) in [(Filling::Over, 0.5), (Filling::Under, 20f64.to_radians().cos())] {
            for apertures in [[0.0, 0.0], [0.5, 1.0]] {
                let signal = optics("lambert:0.5", filling, apertures).signal(pose);
                assert!(
                    (signal - DVec3::splat(f * cos)).length() < 1e-15,
                    "{filling:?}: {signal}"
                );
            }
        }
    }

    #[test]
    fn on_a_wedge_the_specimen_is_seen_from_where_the_arms_really_stand() {
        let place = Placement {
            azimuth: 0.4,
            tilt: 0.5,
            axis: 0.2,
        };
        let gold = brdf::specimen("gold-paint").unwrap();
        let pose = Pose::from_deg(-60.0, 20.0);
        let (incident, exitant) = place.pair(pose.light.rad(), pose.sensor.rad()).unwrap();
        for (filling, cos) in [(Filling::Over, incident.z), (Filling::Under, exitant.z)] {
            let mut optics = optics("gold-paint", filling, [0.0, 0.0]);
            optics.place(place);
            let expected = gold.eval(incident, exitant) * cos;
            assert!((optics.signal(pose) - expected).length() < 1e-12, "{filling:?}");
        }
        // Beneath it there is no light.
        let mut optics = optics("lambert:0.5", Filling::Over, [0.0, 0.0]);
        optics.place(Placement {
            tilt: 0.6,
            axis: 90f64.to_radians(),
            ..Placement::FLAT
        });
        assert_eq!(optics.signal(Pose::from_deg(-20.0, 80.0)), DVec3::ZERO);
    }

    #[test]
    fn arms_that_are_too_close_shadow_each_other() {
        let optics = optics("lambert:0.5", Filling::Over, [0.25, 0.25]);
        assert_eq!(optics.signal(Pose::from_deg(30.0, 34.9)), DVec3::ZERO);
        assert_ne!(optics.signal(Pose::from_deg(30.0, 35.1)), DVec3::ZERO);
    }

    #[test]
    fn apertures_average_a_mirror() {
        // Against the mean over many points of both discs; in units of the mirror's peak.
        let [kappa, source, detector] = [0.5, 0.3, 0.4];
        let averaged = optics("mirror:1", Filling::Under, [source, detector]);
        let peak = Mirror::new(1.0, Mirror::HALF_ANGLE_RAD)
            .unwrap()
            .eval(DVec3::Z, DVec3::Z)
            .x;
        for off in [0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.3] {
            let reading = averaged.signal(Pose::from_deg(-30.0 - off, 30.0)).x / peak;
            let share = mirror_share(off, kappa, source, detector);
            assert!(
                (reading - share).abs() < 0.06,
                "{off}° off: {reading}, not {share}"
            );
        }
    }

    /// Share of the pairs of points of two discs whose directions differ by at most `kappa`, in a plane.
    fn mirror_share(off: f64, kappa: f64, source: f64, detector: f64) -> f64 {
        let points = |radius: f64| {
            let n = 24;
            let grid = (0..n * n).map(move |i| {
                let at = |i: i32| radius * (f64::from(2 * i + 1) / f64::from(n) - 1.0);
                [at(i % n), at(i / n)]
            });
            grid.filter(|[x, y]| x.hypot(*y) <= radius).collect::<Vec<_>>()
        };
        let (sources, detectors) = (points(source), points(detector));
        let hits = sources
            .iter()
            .flat_map(|s| {
                detectors
                    .iter()
                    .map(move |d| (off + s[0] - d[0]).hypot(s[1] - d[1]))
            })
            .filter(|&distance| distance <= kappa)
            .count();
        hits as f64 / (sources.len() * detectors.len()) as f64
    }
}
