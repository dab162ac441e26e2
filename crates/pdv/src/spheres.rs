use std::f64::consts::PI;

use brdf::Brdf;
use glam::DVec3;
use serde::Serialize;

use crate::metric::quantile;

/// Pixels along the side of a picture.
const PIXELS: usize = 56;
/// Directions of the sky; they are as even as a Fibonacci lattice is.
const SKY: usize = 180;
/// Lamps are cut into so many pieces along either side.
const PIECES: usize = 6;
/// The share of the reference's pixels that lie below [`WHITE`].
const EXPOSED: f64 = 0.97;
/// The linear level that the brightest pixels but a few are brought to.
const WHITE: f64 = 0.9;
/// What is further apart than this is seen as the same: the PSNR of two pictures that do not differ, dB.
const SAME_DB: f64 = 120.0;
/// White of sRGB (D65) as XYZ.
const D65: DVec3 = DVec3::new(0.950_47, 1.0, 1.088_83);

/// How far two lit spheres are apart as pictures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spheres {
    /// Peak signal-to-noise ratio of the sRGB pixels, dB, at most 120.
    pub psnr_db: f64,
    /// Mean CIE 1976 colour difference of the pixels.
    pub delta_e: f64,
}

/// Compares pictures of a sphere under three lamps and a sky, of a reference and of estimates of it.
///
/// The sphere is seen from afar. It is lit by a wide lamp beside the viewer, a narrow one low at the side, one behind it
/// that is seen at grazing angles, and a sky that is brighter towards the horizon; 288 directions altogether, always the
/// same. All pictures are exposed alike: 97 % of the pixels of the reference lie below 0.9, linear, and what is brighter
/// than 1 is clipped, as a screen does. A reference that is black everywhere is exposed as it is.
///
/// ```
/// use brdf::Lambert;
/// use pdv::metric::spheres;
///
/// let (half, darker) = (Lambert::new(0.5)?, Lambert::new(0.45)?);
/// let found = spheres(&half, &[&half, &darker]);
/// assert_eq!((found[0].psnr_db, found[0].delta_e), (120.0, 0.0));
/// assert!(found[1].psnr_db > 20.0 && found[1].psnr_db < 40.0);
/// # Ok::<(), brdf::Error>(())
/// ```
pub fn spheres(reference: &(impl Brdf + ?Sized), estimates: &[&dyn Brdf]) -> Vec<Spheres> {
    let (lights, frames) = (lights(), frames());
    let truth = picture(reference, &lights, &frames);
    let mut levels: Vec<f64> = truth.iter().flat_map(DVec3::to_array).collect();
    let level = quantile(&mut levels, EXPOSED).filter(|level| *level > 0.0);
    let exposure = WHITE / level.unwrap_or(WHITE);
    let truth: Vec<DVec3> = truth.iter().map(|rgb| srgb(*rgb * exposure)).collect();
    let compared = |estimate: &&dyn Brdf| {
        let found = picture(*estimate, &lights, &frames);
        let (mut squares, mut differences) = (0.0, 0.0);
        for (a, b) in truth.iter().zip(found) {
            let b = srgb(b * exposure);
            squares += (*a - b).length_squared() / 3.0;
            differences += (lab(*a) - lab(b)).length();
        }
        let pixels = truth.len() as f64;
        Spheres {
            psnr_db: (-10.0 * (squares / pixels).log10()).min(SAME_DB),
            delta_e: differences / pixels,
        }
    };
    estimates.iter().map(compared).collect()
}

/// A direction from which light comes, and the irradiance that it gives a surface which faces it.
struct Light {
    direction: DVec3,
    irradiance: DVec3,
}

/// Tangent, second tangent and normal of each pixel of the sphere; the viewer stands at +z.
fn frames() -> Vec<[DVec3; 3]> {
    let place = |n: usize| (2 * n + 1) as f64 / PIXELS as f64 - 1.0;
    let pixels = (0..PIXELS).flat_map(|row| (0..PIXELS).map(move |column| (place(column), -place(row))));
    let frame = |(x, y): (f64, f64)| {
        let height = ((1.0 - x * x) - y * y).max(0.0).sqrt();
        // The very rim is seen so flat that it would be a pixel of nothing but grazing angles.
        (height > 0.07).then(|| {
            let normal = DVec3::new(x, y, height);
            let (tangent, second) = normal.any_orthonormal_pair();
            [tangent, second, normal]
        })
    };
    pixels.filter_map(frame).collect()
}

/// The lamps and the sky.
fn lights() -> Vec<Light> {
    let lamps = [
        lamp(
            DVec3::new(1.8, 2.2, 2.4),
            [DVec3::new(0.7, 0.0, -0.5), DVec3::new(-0.1, 0.6, -0.4)],
            DVec3::new(15.0, 14.0, 13.0),
        ),
        lamp(
            DVec3::new(-2.8, 0.4, 0.8),
            [DVec3::new(0.1, 0.0, 0.3), DVec3::new(0.0, 1.3, 0.0)],
            DVec3::new(8.0, 9.0, 11.0),
        ),
        lamp(
            DVec3::new(0.9, 1.0, -2.8),
            [DVec3::new(0.9, 0.0, 0.3), DVec3::new(0.0, 0.5, 0.2)],
            DVec3::new(20.0, 17.0, 14.0),
        ),
    ];
    lamps.into_iter().flatten().chain(sky()).collect()
}

/// A lamp about a centre that reaches as far as two half sides lead, of some radiance, as pieces.
fn lamp(centre: DVec3, half_sides: [DVec3; 2], radiance: DVec3) -> impl Iterator<Item = Light> {
    let step = |n: usize| (2 * n + 1) as f64 / PIECES as f64 - 1.0;
    let area = 4.0 * half_sides[0].cross(half_sides[1]).length() / (PIECES * PIECES) as f64;
    let facing = half_sides[0].cross(half_sides[1]).normalize();
    (0..PIECES * PIECES).map(move |n| {
        let at = centre + half_sides[0] * step(n % PIECES) + half_sides[1] * step(n / PIECES);
        let direction = at.normalize();
        Light {
            direction,
            irradiance: radiance * (facing.dot(direction).abs() * area / at.length_squared()),
        }
    })
}

/// The sky: bluish above, brighter at the horizon, and what the ground throws back below.
fn sky() -> impl Iterator<Item = Light> {
    let golden = PI * (1.0 + 5.0_f64.sqrt());
    (0..SKY).map(move |n| {
        let share = (2 * n + 1) as f64 / SKY as f64;
        let height = 1.0 - share;
        let flat = ((1.0 - height) * (1.0 + height)).max(0.0).sqrt();
        let (sin, cos) = (golden * (n as f64 + 0.5)).sin_cos();
        let radiance = if height > 0.0 {
            DVec3::new(0.3, 0.42, 0.6) + 0.45 * (-6.0 * height * height).exp()
        } else {
            DVec3::new(0.16, 0.13, 0.1)
        };
        Light {
            direction: DVec3::new(flat * cos, height, flat * sin),
            irradiance: radiance * (4.0 * PI / SKY as f64),
        }
    })
}

/// Radiance of each pixel.
fn picture(brdf: &(impl Brdf + ?Sized), lights: &[Light], frames: &[[DVec3; 3]]) -> Vec<DVec3> {
    let pixel = |frame: &[DVec3; 3]| {
        let local = |direction: DVec3| DVec3::from_array(frame.map(|axis| axis.dot(direction)));
        let exitant = local(DVec3::Z);
        let light = |light: &Light| {
            let incident = local(light.direction);
            if incident.z > 0.0 {
                brdf.eval(incident, exitant) * light.irradiance * incident.z
            } else {
                DVec3::ZERO
            }
        };
        lights.iter().map(light).sum()
    };
    frames.iter().map(pixel).collect()
}

/// sRGB of linear RGB, clipped to 0 … 1.
fn srgb(linear: DVec3) -> DVec3 {
    linear.clamp(DVec3::ZERO, DVec3::ONE).map(|x| {
        if x <= 0.003_130_8 {
            12.92 * x
        } else {
            1.055 * x.powf(1.0 / 2.4) - 0.055
        }
    })
}

/// CIE L*a*b* of sRGB.
fn lab(srgb: DVec3) -> DVec3 {
    let rgb = srgb.map(|x| {
        if x <= 0.040_45 {
            x / 12.92
        } else {
            ((x + 0.055) / 1.055).powf(2.4)
        }
    });
    let xyz = DVec3::new(
        rgb.dot(DVec3::new(0.412_456, 0.357_576, 0.180_438)),
        rgb.dot(DVec3::new(0.212_673, 0.715_152, 0.072_175)),
        rgb.dot(DVec3::new(0.019_334, 0.119_192, 0.950_304)),
    );
    let f = (xyz / D65).map(|x| {
        if x > 216.0 / 24389.0 {
            x.cbrt()
        } else {
            (24389.0 / 27.0 * x + 16.0) / 116.0
        }
    });
    DVec3::new(116.0 * f.y - 16.0, 500.0 * (f.x - f.y), 200.0 * (f.y - f.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use brdf::{Black, Fitted, Lambert};

    /// An estimate that lies a share beside the reference.
    struct Scaled<'a>(&'a Fitted, f64);

    impl Brdf for Scaled<'_> {
        fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
            self.0.eval(incident, exitant) * self.1
        }
    }

    #[test]
    fn what_is_farther_off_looks_farther_off() {
        for (name, material) in Fitted::all().step_by(20) {
            let estimates = [1.0, 1.02, 1.1, 1.5].map(|scale| Scaled(&material, scale));
            let found = spheres(&material, &estimates.each_ref().map(|e| e as &dyn Brdf));
            assert_eq!((found[0].psnr_db, found[0].delta_e), (SAME_DB, 0.0), "{name}");
            let falls = |w: &[Spheres]| w[0].psnr_db > w[1].psnr_db && w[0].delta_e < w[1].delta_e;
            assert!(found.windows(2).all(falls), "{name}: {found:?}");
        }
    }

    #[test]
    fn black_has_pictures_too() {
        let half = Lambert::new(0.5).unwrap();
        let found = spheres(&Black, &[&Black, &half]);
        assert_eq!(found[0].psnr_db, SAME_DB);
        assert!(found[1].psnr_db < 20.0, "{found:?}");
        let found = spheres(&half, &[&Black])[0];
        assert!(found.psnr_db < 10.0 && found.delta_e.is_finite(), "{found:?}");
    }

    #[test]
    fn colours_of_the_screen_are_where_cie_has_them() {
        let white = lab(srgb(DVec3::ONE));
        assert!(
            (white - DVec3::new(100.0, 0.0, 0.0)).abs().max_element() < 0.02,
            "{white}"
        );
        // Lindbloom's calculator: sRGB red under D65.
        let red = lab(DVec3::X);
        assert!(
            (red - DVec3::new(53.24, 80.09, 67.2)).abs().max_element() < 0.05,
            "{red}"
        );
    }
}
