use glam::DVec3;

/// Two directions in one plane with the normal, by their half vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bisected {
    /// Angle between half vector and normal, rad.
    pub(crate) theta_h: f64,
    /// Angle between half vector and either direction, rad.
    pub(crate) theta_d: f64,
}

impl Bisected {
    /// Two unit vectors that stand so.
    pub(crate) fn directions(self) -> [DVec3; 2] {
        [self.theta_h + self.theta_d, self.theta_h - self.theta_d]
            .map(|alpha| DVec3::new(alpha.sin(), 0.0, alpha.cos()))
    }

    /// cos θ_i cos θ_o and cos θ_i + cos θ_o.
    #[inline]
    pub(crate) fn cosines(self) -> Cosines {
        let (sin_h, cos_h) = self.theta_h.sin_cos();
        let cos_d = self.theta_d.cos();
        Cosines {
            // cos² θ_d − sin² θ_h, without cancellation towards the horizon.
            product: ((cos_d - sin_h) * (cos_d + sin_h)).max(0.0),
            sum: 2.0 * cos_h * cos_d,
        }
    }
}

/// The cosines of two zenith angles, by what does not change when they are swapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cosines {
    pub(crate) product: f64,
    pub(crate) sum: f64,
}

/// How much of what the pair of the same difference angle is brighter is believed.
pub(crate) const RISE: f64 = 0.4;

/// Any two directions above the horizon, by squared sines and cosines of half and difference angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pair {
    pub(crate) sin_h: f64,
    pub(crate) cos_h: f64,
    pub(crate) sin_d: f64,
    cos_d: f64,
    /// cos θ_i cos θ_o.
    pub(crate) product: f64,
    /// E = sin² θ_h sin² θ_d sin² φ_d: how far they are from one plane with the normal.
    pub(crate) out: f64,
}

impl Pair {
    /// Of unit vectors above the horizon; the same to the last bit where they are swapped.
    #[inline(always)]
    pub(crate) fn new(incident: DVec3, exitant: DVec3) -> Self {
        let sum = incident + exitant;
        // Opposite at the horizon there is no half vector.
        let length = sum.length_squared().max(f64::MIN_POSITIVE);
        let inverse = 1.0 / length;
        let across = incident.x * exitant.y - incident.y * exitant.x;
        Self {
            sin_h: (sum.x * sum.x + sum.y * sum.y) * inverse,
            cos_h: sum.z * sum.z * inverse,
            sin_d: 0.25 * (incident - exitant).length_squared(),
            cos_d: 0.25 * length,
            product: incident.z * exitant.z,
            out: across * across * inverse,
        }
    }

    /// Half and difference angle as they are.
    pub(crate) fn bisected(&self) -> Bisected {
        Bisected {
            theta_h: angle(self.sin_h, self.cos_h),
            theta_d: angle(self.sin_d, self.cos_d),
        }
    }

    /// The pair in the plane with the same half angle and the same product of cosines.
    pub(crate) fn same_half(&self) -> Bisected {
        Bisected {
            theta_h: angle(self.sin_h, self.cos_h),
            theta_d: angle(self.sin_d - self.out, self.product + self.sin_h),
        }
    }

    /// The pair in the plane with the same difference angle and the same product of cosines.
    pub(crate) fn same_difference(&self) -> Bisected {
        Bisected {
            theta_h: angle(self.sin_h - self.out, self.product + self.sin_d),
            theta_d: angle(self.sin_d, self.cos_d),
        }
    }

    /// The largest rise of ln f: ½ ln(cos² θ_d*/cos² θ_d) by the first term of its series, below 1.
    #[inline(always)]
    pub(crate) fn most(&self) -> f64 {
        self.out / (2.0 * self.cos_d + self.out)
    }
}

/// The angle of a squared sine and cosine, rad, 0 … π/2.
fn angle(sin: f64, cos: f64) -> f64 {
    sin.max(0.0).sqrt().atan2(cos.max(0.0).sqrt())
}
