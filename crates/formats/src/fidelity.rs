use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fmt;

use brdf::{Brdf, Spherical};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use crate::colour::luminance;

/// Pairs of directions that are compared.
const PAIRS: u32 = 40_000;
/// Largest zenith angle of the pairs, rad: what lies beyond 80° is hardly ever measured.
const THETA_MAX_RAD: f64 = 80.0 * PI / 180.0;
/// Floor of relative errors, sr⁻¹: what a photometer of this kind can tell from nothing.
const FLOOR: f64 = 1e-3;
/// Zenith angles at which the directional albedo is compared, degrees.
const ALBEDO_AT_DEG: [f64; 3] = [0.0, 45.0, 75.0];
/// How far from the mirror direction it is looked at, rad: 0.25°, an aperture's half-angle. In the mirror direction itself half and
/// difference angles have no φ_d, and a measured table may have several values.
const PEAK_RAD: f64 = 0.25 * PI / 180.0;
/// Zenith angles whose mirror directions are compared, degrees.
const PEAKS_AT_DEG: [f64; 5] = [3.0, 20.0, 45.0, 60.0, 75.0];

/// How well a file gives back the BRDF that was written into it.
///
/// Directions are spread evenly over θ_i, θ_r (0 … 80°) and the azimuth between them (0 … 180°) by a sequence without
/// chance, so that the figures of the same file are always the same. Pairs that are not valid in both are left out.
///
/// ```
/// use brdf::Lambert;
/// use formats::Fidelity;
///
/// let (white, grey) = (Lambert::new(1.0).unwrap(), Lambert::new(0.5).unwrap());
/// let fidelity = Fidelity::between(&white, &grey);
/// assert!((fidelity.median - 0.5).abs() < 1e-12);
/// assert!((fidelity.albedo[1].1 - 0.5).abs() < 1e-3);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Fidelity {
    /// Pairs that were compared.
    pub pairs: usize,
    /// MALE: mean |ln(1 + f cos θ_i) − ln(1 + f̂ cos θ_i)| over pairs and channels.
    pub male: f64,
    /// Median of |f̂ − f| / max(f, 1e-3 sr⁻¹) over pairs and channels.
    pub median: f64,
    /// 95th percentile of the same.
    pub p95: f64,
    /// Directional albedo at 0°, 45° and 75°, luminance: of the BRDF and of the file.
    pub albedo: [(f64, f64); 3],
    /// Reflectance 0.25° about the mirror direction where it differs most, luminance in sr⁻¹: of the BRDF and of the file.
    pub peak: (f64, f64),
}

impl Fidelity {
    /// Compares what a file holds with what was written into it.
    pub fn between(source: &dyn Brdf, file: &dyn Brdf) -> Self {
        let mut errors: Vec<[f64; 2]> = (0..PAIRS)
            .into_par_iter()
            .map(pair)
            .filter(|&(incident, exitant)| source.valid(incident, exitant) && file.valid(incident, exitant))
            .flat_map_iter(|(incident, exitant)| {
                let f = source.eval(incident, exitant).to_array();
                let g = file.eval(incident, exitant).to_array();
                std::array::from_fn::<_, 3, _>(|c| {
                    let male = ((1.0 + g[c] * incident.z) / (1.0 + f[c] * incident.z)).ln();
                    [male.abs(), (g[c] - f[c]).abs() / f[c].max(FLOOR)]
                })
            })
            .collect();
        let count = errors.len().max(1);
        let male = errors.iter().map(|[male, _]| male).sum::<f64>() / count as f64;
        errors.sort_unstable_by(|[_, a], [_, b]| a.total_cmp(b));
        let quantile = |share: f64| {
            let at = (share * errors.len() as f64) as usize;
            errors
                .get(at.min(count - 1))
                .map_or(0.0, |&[_, relative]| relative)
        };
        let peaks = PEAKS_AT_DEG.map(|theta_deg| mirror_direction(source, file, theta_deg.to_radians()));
        let worst = |a: &&(f64, f64), b: &&(f64, f64)| relative(**a).total_cmp(&relative(**b));
        Self {
            pairs: errors.len() / 3,
            male,
            median: quantile(0.5),
            p95: quantile(0.95),
            albedo: ALBEDO_AT_DEG.map(|theta_deg| {
                let theta = theta_deg.to_radians();
                let of = |brdf: &dyn Brdf| luminance(albedo(brdf, theta));
                (of(source), of(file))
            }),
            peak: peaks.iter().max_by(worst).copied().unwrap_or_default(),
        }
    }

    /// Relative error of the directional albedo where it is largest; differences below 0.001 of the light count as none.
    pub fn albedo_error(&self) -> f64 {
        let error = |&(f, g): &(f64, f64)| ((g - f).abs() - 1e-3).max(0.0) / f.max(1e-3);
        self.albedo.iter().map(error).fold(0.0, f64::max)
    }

    /// Relative error in the mirror direction where it is largest.
    pub fn peak_error(&self) -> f64 {
        relative(self.peak)
    }
}

impl fmt::Display for Fidelity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [at_0, at_45, at_75] = self.albedo;
        write!(
            f,
            "read back over {} pairs: MALE {:.6}, median {:.3} %, p95 {:.3} %, albedo at 0°/45°/75° {:.4}/{:.4}/{:.4} of \
             {:.4}/{:.4}/{:.4}, peak {:.4} of {:.4} 1/sr",
            self.pairs,
            self.male,
            100.0 * self.median,
            100.0 * self.p95,
            at_0.1,
            at_45.1,
            at_75.1,
            at_0.0,
            at_45.0,
            at_75.0,
            self.peak.1,
            self.peak.0
        )
    }
}

/// Mean luminance of a BRDF and of a file on a ring about the mirror direction, of the directions that are valid in both.
fn mirror_direction(source: &dyn Brdf, file: &dyn Brdf, theta: f64) -> (f64, f64) {
    let (sin, cos) = theta.sin_cos();
    let incident = DVec3::new(-sin, 0.0, cos);
    let (mirror, up) = (DVec3::new(sin, 0.0, cos), DVec3::new(-cos, 0.0, sin));
    let (mut sums, mut count) = ((0.0, 0.0), 0.0);
    for n in 0..8 {
        let around = DVec2::from_angle((f64::from(n) + 0.5) * TAU / 8.0) * PEAK_RAD.sin();
        let exitant = mirror * PEAK_RAD.cos() + up * around.x + DVec3::Y * around.y;
        if source.valid(incident, exitant) && file.valid(incident, exitant) {
            sums.0 += luminance(source.eval(incident, exitant));
            sums.1 += luminance(file.eval(incident, exitant));
            count += 1.0;
        }
    }
    if count > 0.0 {
        (sums.0 / count, sums.1 / count)
    } else {
        (0.0, 0.0)
    }
}

/// |g − f| as a share of f, which is at least the floor.
fn relative((f, g): (f64, f64)) -> f64 {
    (g - f).abs() / f.max(FLOOR)
}

/// The n-th pair of directions, by the additive recurrence of the plastic number in three dimensions.
fn pair(n: u32) -> (DVec3, DVec3) {
    // Roots of x⁴ = x + 1: powers of 1/1.2207440846057596.
    const STEP: [f64; 3] = [
        0.819_172_513_396_164_4,
        0.671_043_606_703_789_2,
        0.549_700_477_901_970_3,
    ];
    let [a, b, c] = STEP.map(|step| (0.5 + step * f64::from(n)).fract());
    let incident = Spherical {
        theta: a * THETA_MAX_RAD,
        phi: c * PI,
    };
    let exitant = Spherical {
        theta: b * THETA_MAX_RAD,
        phi: 0.0,
    };
    (incident.direction(), exitant.direction())
}

/// Directional albedo of a BRDF for the viewer at zenith angle `theta_rad` (0 … π/2), linear RGB.
///
/// cos θ_i dω_i is area on the disk onto which directions project; rings about the mirror direction, dense where a lobe
/// is, are summed over 48 places of their arcs on the disk.
///
/// ```
/// let white = brdf::Lambert::new(1.0).unwrap();
/// assert!((formats::albedo(&white, 0.7).x - 1.0).abs() < 1e-3);
/// ```
pub fn albedo(brdf: &dyn Brdf, theta_rad: f64) -> DVec3 {
    const RINGS: usize = 600;
    const PLACES: usize = 48;
    let (s, cos) = theta_rad.clamp(0.0, FRAC_PI_2).sin_cos();
    let exitant = DVec3::new(s, 0.0, cos);
    let radius = |n: usize| (1.0 + s) * (n as f64 / RINGS as f64).powi(4);
    let mut sum = DVec3::ZERO;
    for ring in 0..RINGS {
        let (inner, outer) = (radius(ring), radius(ring + 1));
        let d = (0.5 * (inner * inner + outer * outer)).sqrt();
        let arc = if d <= 1.0 - s {
            TAU
        } else {
            2.0 * ((d * d + s * s - 1.0) / (2.0 * d * s)).clamp(-1.0, 1.0).acos()
        };
        let area = 0.5 * (outer * outer - inner * inner) * arc / PLACES as f64;
        for place in 0..PLACES {
            let phi = ((place as f64 + 0.5) / PLACES as f64 - 0.5) * arc;
            let light = DVec2::new(d * phi.cos() - s, d * phi.sin());
            let z_squared = 1.0 - light.length_squared();
            if z_squared > 0.0 {
                sum += brdf.eval(light.extend(z_squared.sqrt()), exitant) * area;
            }
        }
    }
    sum
}
