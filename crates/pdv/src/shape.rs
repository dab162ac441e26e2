use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::bisected::Cosines;
use crate::sweeps::Point;

/// What joins lobe, arc and diffuse floor of [`crate::Planes`]; the same for the channels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// s, sr⁻¹, above 0: lobe and arc multiply far below it, and the lobe narrows as its peak rises far above it.
    pub scale: f64,
    /// q, 0 … 1: the diffuse floor as a share of the smallest reading.
    pub diffuse: f64,
    /// a, 0 … 1: 1 without shadowing; towards 0 the lobe brightens to grazing like 1/(cos θ_i cos θ_o).
    pub shadowing: f64,
    /// κ ≥ 0: the diffuse floor darkens like (cos θ_i cos θ_o)^κ.
    pub darkening: f64,
}

impl Shape {
    /// Taken where the readings cannot tell, with one side of one plane: moderate in everything, and not fitted.
    pub const DEFAULT: Self = Self {
        scale: 1.0,
        diffuse: 0.9,
        shadowing: 0.3,
        darkening: 0.1,
    };

    /// s·V, V the shadowing of both directions.
    #[inline]
    pub(crate) fn lobe_scale(&self, Cosines { product, sum }: Cosines) -> f64 {
        let (a, b) = (self.shadowing, 1.0 - self.shadowing);
        self.scale / (product * b * b + sum * a * b + a * a)
    }

    /// What the diffuse floor is multiplied by.
    #[inline]
    pub(crate) fn falloff(&self, cosines: Cosines) -> f64 {
        if self.darkening == 0.0 {
            return 1.0;
        }
        cosines.product.powf(self.darkening)
    }
}

/// The diffuse floor and what lies above it, for one shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Excess {
    pub(crate) shape: Shape,
    /// A, the diffuse floor towards the normal, sr⁻¹.
    pub(crate) diffuse: DVec3,
    /// The least that counts as above the floor, sr⁻¹; 0 in a black channel.
    pub(crate) least: DVec3,
}

impl Excess {
    /// What lies this share of the floor above it is not told from it: a ratio of less would be one of noise.
    const TOLD: f64 = 1e-3;

    /// The floor of readings; `least` is what can be told from black, 0 in a black channel.
    pub(crate) fn new<'a>(shape: Shape, least: DVec3, readings: impl Iterator<Item = &'a Point>) -> Self {
        let smallest = readings
            .map(|p| p.rgb / shape.falloff(p.cosines))
            .fold(DVec3::INFINITY, DVec3::min);
        let diffuse = shape.diffuse * smallest;
        let black = least.cmpeq(DVec3::ZERO);
        Self {
            shape,
            diffuse,
            least: DVec3::select(black, DVec3::ZERO, least.max(Self::TOLD * diffuse)),
        }
    }

    /// G·F of a reflectance: ln(1 + excess/(s V)).
    #[inline]
    pub(crate) fn log(&self, rgb: DVec3, cosines: Cosines) -> DVec3 {
        let excess = (rgb - self.diffuse * self.shape.falloff(cosines)).max(self.least);
        (excess / self.shape.lobe_scale(cosines)).map(f64::ln_1p)
    }

    /// The reflectance of a G·F.
    #[inline]
    pub(crate) fn reflectance(&self, log: DVec3, cosines: Cosines) -> DVec3 {
        let lobe = log.map(f64::exp_m1);
        self.diffuse * self.shape.falloff(cosines) + lobe * self.shape.lobe_scale(cosines)
    }
}
