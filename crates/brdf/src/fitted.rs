use std::f64::consts::FRAC_1_PI;
use std::sync::LazyLock;

use glam::DVec3;

use crate::Brdf;

/// One of the 100 MERL materials (Matusik et al. 2003) as an analytic fit.
///
/// Per channel f = k_d/π + (k_1 D_1 + k_2 D_2)(1 + rise·s) V + sheen·s, with D_j = (1 + b_j (1 − cos θ_h))^(−c_j),
/// s = (1 − cos θ_d)⁵ and V = 1/((c_i (1−a) + a)(c_o (1−a) + a)) of the zenith cosines c_i, c_o. Reciprocal by
/// construction; fitted over θ_i, θ_o < 80°, beyond that a continuation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fitted {
    diffuse: DVec3,
    lobes: [Lobe; 2],
    rise: DVec3,
    a: f64,
    sheen: DVec3,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Lobe {
    k: DVec3,
    b: f64,
    c: f64,
}

/// Name and parameters, in the order of the file.
static TABLE: LazyLock<Vec<(&'static str, Fitted)>> = LazyLock::new(|| {
    include_str!("../merl-fit.csv")
        .lines()
        .skip(1)
        .map(|line| parse(line).expect("the built-in table is whole, as a test shows"))
        .collect()
});

fn parse(line: &'static str) -> Option<(&'static str, Fitted)> {
    let (name, numbers) = line.split_once(',')?;
    let v: Vec<f64> = numbers
        .split(',')
        .map(str::parse)
        .collect::<Result<_, _>>()
        .ok()?;
    let rgb = |at: usize| Some(DVec3::new(*v.get(at)?, *v.get(at + 1)?, *v.get(at + 2)?));
    let lobe = |at: usize| {
        Some(Lobe {
            k: rgb(at)?,
            b: *v.get(at + 3)?,
            c: *v.get(at + 4)?,
        })
    };
    let fitted = Fitted {
        diffuse: rgb(0)? * FRAC_1_PI,
        lobes: [lobe(3)?, lobe(8)?],
        rise: rgb(13)?,
        a: *v.get(16)?,
        sheen: rgb(17)?,
    };
    Some((name, fitted))
}

impl Fitted {
    /// The material of that name, e.g. `"alum-bronze"`; `None` where there is none.
    ///
    /// ```
    /// use brdf::Fitted;
    ///
    /// assert!(Fitted::named("alum-bronze").is_some());
    /// assert!(Fitted::named("unobtainium").is_none());
    /// ```
    pub fn named(name: &str) -> Option<Self> {
        TABLE
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, fitted)| *fitted)
    }

    /// All materials with their names, in alphabetical order.
    ///
    /// ```
    /// use brdf::Fitted;
    ///
    /// assert_eq!(Fitted::all().len(), 100);
    /// assert_eq!(Fitted::all().next().map(|(name, _)| name), Some("alum-bronze"));
    /// ```
    pub fn all() -> impl ExactSizeIterator<Item = (&'static str, Self)> {
        TABLE.iter().copied()
    }
}

impl Brdf for Fitted {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let (c_i, c_o) = (incident.z, exitant.z);
        if !(c_i > 0.0 && c_o > 0.0) {
            return DVec3::ZERO;
        }
        let sum = incident + exitant;
        let length = sum.length();
        // 1 − cos x = sin² x/(1 + cos x) does not cancel at the peak; |ω_i + ω_o| = 2 cos θ_d.
        let u_h = (sum.x * sum.x + sum.y * sum.y) / (length * (length + sum.z));
        let u_d = incident.distance_squared(exitant) / (2.0 * (2.0 + length));
        let s = u_d.powi(2).powi(2) * u_d;
        let [first, second] = self
            .lobes
            .map(|lobe| lobe.k * (-lobe.c * (lobe.b * u_h).ln_1p()).exp());
        let visibility = 1.0 / ((c_i * (1.0 - self.a) + self.a) * (c_o * (1.0 - self.a) + self.a));
        self.diffuse + (first + second) * (DVec3::ONE + self.rise * s) * visibility + self.sheen * s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Spherical;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn the_table_holds_100_materials_in_order() {
        let lines = include_str!("../merl-fit.csv").lines().skip(1);
        assert_eq!(lines.clone().filter_map(parse).count(), 100);
        assert_eq!(lines.count(), 100);
        assert!(Fitted::all().map(|(name, _)| name).is_sorted());
        assert!(Fitted::named("alum-bronze").is_some());
        assert!(Fitted::named("unobtainium").is_none());
    }

    /// The numbers of the first row, put through the formula by hand.
    #[test]
    fn follows_the_formula() {
        let theta_i = 0.7_f64;
        let theta_o = 0.5_f64;
        let incident = Spherical {
            theta: theta_i,
            phi: PI,
        }
        .direction();
        let exitant = Spherical {
            theta: theta_o,
            phi: 0.0,
        }
        .direction();
        let (theta_h, theta_d) = (0.1_f64, 0.6_f64);
        let s = (1.0 - theta_d.cos()).powi(5);
        let d1 = (1.0 + 26094.0 * (1.0 - theta_h.cos())).powf(-0.9323);
        let d2 = (1.0 + 39.737 * (1.0 - theta_h.cos())).powf(-1.6782);
        let a = 0.2804;
        let v = 1.0 / ((theta_i.cos() * (1.0 - a) + a) * (theta_o.cos() * (1.0 - a) + a));
        let red = 0.013806 / PI + (4.5992 * d1 + 0.099193 * d2) * (1.0 + 25.689 * s) * v + 1.0541e-6 * s;
        let found = Fitted::named("alum-bronze").unwrap().eval(incident, exitant).x;
        assert!((found / red - 1.0).abs() < 1e-12, "{found} instead of {red}");
    }

    proptest! {
        #[test]
        fn prop_every_material_is_reciprocal_and_finite(
            material in 0_usize..100,
            theta in (0.0..FRAC_PI_2, 0.0..FRAC_PI_2),
            phi in (-PI..PI, -PI..PI),
        ) {
            let (name, fitted) = Fitted::all().nth(material).unwrap();
            let incident = Spherical { theta: theta.0, phi: phi.0 }.direction();
            let exitant = Spherical { theta: theta.1, phi: phi.1 }.direction();
            let there = fitted.eval(incident, exitant);
            prop_assert!(there.is_finite() && there.min_element() >= 0.0, "{} gives {}", name, there);
            let back = fitted.eval(exitant, incident);
            prop_assert!((there - back).abs().max_element() <= 1e-12 * there.max_element(), "{}", name);
        }
    }

    #[test]
    fn is_zero_at_and_below_the_horizon() {
        let fitted = Fitted::named("chrome").unwrap();
        assert_eq!(fitted.eval(DVec3::X, DVec3::Z), DVec3::ZERO);
        assert_eq!(fitted.eval(DVec3::Z, DVec3::NEG_Z), DVec3::ZERO);
        assert!(fitted.eval(DVec3::Z, DVec3::Z).is_finite());
    }
}
