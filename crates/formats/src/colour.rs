//! Linear sRGB, CIE XYZ and spectra.

use glam::{DMat3, DVec3};

/// Luminance of a linear RGB value (ITU-R BT.709).
pub(crate) fn luminance(rgb: DVec3) -> f64 {
    rgb.dot(DVec3::new(0.212_639, 0.715_169, 0.072_192))
}

/// CIE XYZ of linear sRGB with white at D65 (IEC 61966-2-1).
const XYZ_OF_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(0.412_390_8, 0.212_639, 0.019_330_8),
    DVec3::new(0.357_584_3, 0.715_168_7, 0.119_194_8),
    DVec3::new(0.180_480_8, 0.072_192_3, 0.950_532_2),
);

/// CIE XYZ of a linear sRGB reflectance, Y of white being 1.
pub(crate) fn xyz_of_rgb(rgb: DVec3) -> DVec3 {
    XYZ_OF_RGB * rgb
}

/// Linear sRGB of CIE XYZ; negative parts, which sRGB cannot show, become 0.
pub(crate) fn rgb_of_xyz(xyz: DVec3) -> DVec3 {
    (XYZ_OF_RGB.inverse() * xyz).max(DVec3::ZERO)
}

/// For each wavelength (nm, ascending), what it adds to linear sRGB: the weights of a constant spectrum sum to 1 in each
/// channel.
///
/// Three wavelengths are taken for the channels blue, green and red themselves, one for all of them. More are weighted
/// by the CIE 1931 colour-matching functions in the analytic form of Wyman, Sloan and Shirley ("Simple Analytic
/// Approximations to the CIE XYZ Color Matching Functions", JCGT 2(2) 2013), under a light that makes a constant
/// spectrum white.
pub(crate) fn channels_of_spectrum(wavelengths_nm: &[f64]) -> Vec<DVec3> {
    match wavelengths_nm.len() {
        1 => return vec![DVec3::ONE],
        3 => return vec![DVec3::Z, DVec3::Y, DVec3::X],
        _ => {}
    }
    let last = wavelengths_nm.len().saturating_sub(1);
    let width = |n: usize| {
        let (below, above) = (n.saturating_sub(1), (n + 1).min(last));
        (wavelengths_nm[above] - wavelengths_nm[below]) / 2.0
    };
    let xyz = (0..wavelengths_nm.len()).map(|n| matching(wavelengths_nm[n]) * width(n));
    let rgb: Vec<DVec3> = xyz.map(|xyz| XYZ_OF_RGB.inverse() * xyz).collect();
    let white: DVec3 = rgb.iter().sum();
    let share = |rgb: DVec3| DVec3::select(white.cmpgt(DVec3::ZERO), rgb / white, DVec3::ZERO);
    rgb.into_iter().map(share).collect()
}

/// CIE 1931 x̄, ȳ, z̄ at a wavelength in nm, as Wyman, Sloan and Shirley fit them.
fn matching(nm: f64) -> DVec3 {
    let lobe = |mean: f64, below: f64, above: f64| {
        let t = (nm - mean) * if nm < mean { below } else { above };
        (-0.5 * t * t).exp()
    };
    DVec3::new(
        0.362 * lobe(442.0, 0.0624, 0.0374) + 1.056 * lobe(599.8, 0.0264, 0.0323)
            - 0.065 * lobe(501.1, 0.0490, 0.0382),
        0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322),
        1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn xyz_and_rgb_go_back_and_forth() {
        let rgb = DVec3::new(0.2, 0.5, 0.7);
        assert!((rgb_of_xyz(xyz_of_rgb(rgb)) - rgb).abs().max_element() < 1e-12);
        // White is D65: x 0.3127, y 0.3290.
        let white = xyz_of_rgb(DVec3::ONE);
        let sum = white.element_sum();
        assert!((white.x / sum - 0.3127).abs() < 1e-4 && (white.y / sum - 0.3290).abs() < 1e-4);
    }

    #[test]
    fn a_constant_spectrum_is_white_and_a_long_wave_one_is_red() {
        let nm: Vec<f64> = (0..65).map(|n| 360.0 + 10.0 * f64::from(n)).collect();
        let weights = channels_of_spectrum(&nm);
        let white: DVec3 = weights.iter().sum();
        assert!((white - DVec3::ONE).abs().max_element() < 1e-12, "{white}");
        let red: DVec3 = weights
            .iter()
            .zip(&nm)
            .filter(|(_, nm)| **nm > 600.0)
            .map(|(w, _)| *w)
            .sum();
        assert!(red.x > 0.5 && red.y < 0.3 && red.z < 0.1, "{red}");
    }
}
