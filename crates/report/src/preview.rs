use brdf::Brdf;
use glam::{DMat3, DVec3};

use crate::Picture;

/// Pixels along a side of the preview.
const SIDE: usize = 256;

/// Two distant lamps, direction to them and irradiance across their beam: a key light from the upper left that shows
/// lobe and body of the material, and a low one from behind that shows grazing angles.
const LAMPS: [([f64; 3], f64); 2] = [([-0.55, 0.65, 0.65], 3.0), ([0.9, -0.1, -0.25], 1.5)];

/// A sphere of the material, lit by two distant lamps and seen from afar: radiance, linear RGB, black outside.
///
/// Frame: x right, y up, z towards the viewer. Four rays per pixel.
pub fn sphere(material: &(impl Brdf + ?Sized)) -> Picture {
    let half = SIDE as f64 / 2.0;
    Picture::of(SIDE, SIDE, |column, row| {
        let mut sum = DVec3::ZERO;
        for (dx, dy) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
            // The margin keeps the rim off the border.
            let x = (column as f64 + dx - half) / (half * 0.96);
            let y = (half - row as f64 - dy) / (half * 0.96);
            sum += radiance(material, x, y);
        }
        sum / 4.0
    })
}

/// What the header of preview.exr says.
pub(crate) const ATTRIBUTES: [(&str, &str); 2] = [
    (
        "lamps",
        "(-0.55, 0.65, 0.65) 3.0; (0.9, -0.1, -0.25) 1.5: direction and irradiance, x right, y up, z to the viewer",
    ),
    ("unit", "radiance; 1/sr times irradiance"),
];

/// The exposure that a preview is shown with: the key light on a white diffuser facing it becomes 1 − exp(−1.5).
pub const EXPOSURE: f64 = 1.5 * std::f64::consts::PI / LAMPS[0].1;

/// Radiance towards the viewer at (x, y) of the unit disk.
fn radiance(material: &(impl Brdf + ?Sized), x: f64, y: f64) -> DVec3 {
    let z_squared = 1.0 - x * x - y * y;
    if z_squared <= 0.0 {
        return DVec3::ZERO;
    }
    let normal = DVec3::new(x, y, z_squared.sqrt());
    let tangent = normal.any_orthonormal_vector();
    let to_local = DMat3::from_cols(tangent, normal.cross(tangent), normal).transpose();
    let exitant = to_local * DVec3::Z;
    LAMPS
        .into_iter()
        .map(|(direction, irradiance)| {
            let incident = to_local * DVec3::from(direction).normalize();
            material.eval(incident, exitant) * (irradiance * incident.z.max(0.0))
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    struct White;
    impl Brdf for White {
        fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
            if incident.z > 0.0 && exitant.z > 0.0 {
                DVec3::splat(std::f64::consts::FRAC_1_PI)
            } else {
                DVec3::ZERO
            }
        }
    }

    #[test]
    fn a_white_sphere_is_brightest_towards_the_key_light() {
        let picture = sphere(&White);
        let at = |x: usize, y: usize| picture.pixels[y * picture.width + x].x;
        assert_eq!(at(0, 0), 0.0, "outside the sphere");
        let (mut brightest, mut place) = (0.0, (0, 0));
        for y in 0..SIDE {
            for x in 0..SIDE {
                if at(x, y) > brightest {
                    (brightest, place) = (at(x, y), (x, y));
                }
            }
        }
        assert!(place.0 < SIDE / 2 && place.1 < SIDE / 2, "{place:?}");
        let white = LAMPS[0].1 / std::f64::consts::PI;
        assert!((brightest / white - 1.0).abs() < 1e-3, "{brightest}");
    }
}
