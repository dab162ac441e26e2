use arms::{ArmAngle, Pose};
use serde::{Deserialize, Serialize};

use super::linearity::Linearity;
use crate::{Gain, RigFile};

/// What was found out about a rig by calibrating it, part by part. It is stored, named in each run that uses it, and
/// holds for one rig file and a limited time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// Id, never reused.
    pub id: String,
    /// Its place in the order in which the certificates of a directory were made, from 1: the highest number is the
    /// newest, whatever the clock said. 0: a program that did not number them made it.
    #[serde(default)]
    pub number: u64,
    /// When the last part was made, RFC 3339, UTC. It tells the age, not the order.
    pub made: String,
    /// [`RigFile::fingerprint`] of the rig file for which it holds.
    pub rig: String,
    /// What a white reference said.
    pub white: Option<White>,
    /// What a black trap said.
    pub trap: Option<Trap>,
    /// What a mirror said.
    pub zero: Option<Zero>,
    /// Colour patches that were measured so far.
    #[serde(default)]
    pub patches: Vec<Patch>,
    /// What they said, once there are enough of them.
    pub colour: Option<Colour>,
    /// What is worth a look before its values are believed, in full sentences, found when it was chosen for a run; none
    /// of it is stored with the certificate.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

/// How a part of a certificate was made.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Conditions {
    /// When, RFC 3339, UTC.
    pub made: String,
    /// The run whose readings it is made of.
    pub run: String,
    /// What lay on the stage.
    pub standard: String,
    /// Mean temperature of the photometer, °C.
    pub temperature_c: f64,
}

/// Responsivity, gains and linearity, from a white reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct White {
    /// How it was made.
    pub conditions: Conditions,
    /// Counts per µs at gain ×1 for f·cos = 1 sr⁻¹ at nominal lamp output; red, green, blue.
    pub responsivity: [f64; 3],
    /// Relative standard uncertainty of each, the reference's own included.
    pub u_responsivity: [f64; 3],
    /// What the gain steps really amplify; the first is 1.
    pub gains: [f64; 3],
    /// Relative standard uncertainty of each; that of the first is 0, since the others are told by it.
    #[serde(default = "u_gains_built_in")]
    pub u_gains: [f64; 3],
    /// Share of the counts that is lost where the signal reaches full scale; the loss grows with the square of the
    /// signal.
    pub nonlinearity: f64,
    /// Standard uncertainty of that share.
    pub u_nonlinearity: f64,
}

/// Light that reaches the sensor past the specimen, from a black trap in its place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trap {
    /// How it was made.
    pub conditions: Conditions,
    /// Pose, and counts per µs at gain ×1 and nominal lamp output; red, green, blue.
    pub points: Vec<(Pose, [f64; 3])>,
    /// Standard uncertainty between the points, in the same unit.
    pub u: [f64; 3],
}

/// By how much the arms' zeros are off, from the symmetry of a mirror's lobe.
///
/// The lobe stands where both true angles add up to 0, so it tells the sum of both zeros alone: half of the sum is added to
/// each arm. Where one zero is too large by as much as the other is too small nothing moves, so their difference stays as
/// unsure as it was; see [`ZeroUncertainty`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Zero {
    /// How it was made.
    pub conditions: Conditions,
    /// To be added to each arm's measured angle, rad.
    pub offset_rad: f64,
    /// Standard uncertainty of half the sum of both zeros, rad.
    pub u_rad: f64,
}

/// How unsure the zeros of both arms are. Half their sum turns both arms the same way and half their difference turns
/// them towards each other; the two are independent of each other, the zeros of the arms are not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroUncertainty {
    /// Standard uncertainty of half the sum of both zeros, rad.
    pub half_sum_rad: f64,
    /// Standard uncertainty of half the difference, light less sensor, rad.
    pub half_difference_rad: f64,
}

impl ZeroUncertainty {
    /// Of two arms whose zeros are independent of each other and each so unsure, rad.
    pub fn of_each_arm(zero_rad: f64) -> Self {
        Self {
            half_sum_rad: zero_rad / std::f64::consts::SQRT_2,
            half_difference_rad: zero_rad / std::f64::consts::SQRT_2,
        }
    }

    /// Standard uncertainty of one arm's zero, whatever the other one's is, rad.
    pub fn arm_rad(self) -> f64 {
        self.half_sum_rad.hypot(self.half_difference_rad)
    }

    /// Variance of a value that changes by so much for each radian that the light's and the sensor's zero are off.
    pub fn variance(self, [light, sensor]: [f64; 2]) -> f64 {
        ((light + sensor) * self.half_sum_rad).powi(2) + ((light - sensor) * self.half_difference_rad).powi(2)
    }
}

/// A colour patch as the sensor saw it and as it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Patch {
    /// Its name; a patch measured again takes the place of the one before.
    pub name: String,
    /// Reflectance factor in the sensor's own colours.
    pub sensor: [f64; 3],
    /// Reflectance factor in linear sRGB, as certified.
    pub rgb: [f64; 3],
}

/// From the sensor's colours to linear sRGB.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Colour {
    /// How it was made.
    pub conditions: Conditions,
    /// Row by row; what the sensor's red, green and blue reflectance is multiplied by.
    pub matrix: [[f64; 3]; 3],
    /// Root mean square of what is left over the patches, relative to white.
    pub residual: f64,
    /// Standard uncertainty of what the matrix makes of a reading, relative to its brightest channel, by what is left over
    /// the patches for each freedom that the matrix leaves; `None` of three patches, which leave none.
    #[serde(default)]
    pub u: Option<f64>,
}

/// Relative standard uncertainties of the gains in certificates that were stored without: the built-in rig file's.
fn u_gains_built_in() -> [f64; 3] {
    let known = RigFile::default().uncertainty;
    Gain::ALL.map(|gain| known.of_gain(gain))
}

impl White {
    /// What the rig file says, where no white reference was measured.
    pub fn nominal(file: &RigFile) -> Self {
        Self {
            conditions: Conditions::default(),
            responsivity: file.calibration.responsivity,
            u_responsivity: [file.uncertainty.responsivity; 3],
            gains: Gain::ALL.map(Gain::factor),
            u_gains: Gain::ALL.map(|gain| file.uncertainty.of_gain(gain)),
            nonlinearity: 0.0,
            u_nonlinearity: file.uncertainty.nonlinearity,
        }
    }

    /// Counts of light that a linear photometer would have shown, of counts above the dark level and of those that the dark
    /// current shows beside them, and by what relative share the uncertainty of the non-linearity leaves them unsure.
    pub(crate) fn straighten(&self, net: f64, current: f64, full_scale: f64) -> (f64, f64) {
        let linearity = Linearity {
            loss: self.nonlinearity,
            full_scale,
        };
        let (all, dark) = (linearity.signal(net + current), linearity.signal(current));
        (all - dark, self.u_nonlinearity * linearity.sensitivity(all))
    }
}

impl Trap {
    /// Stray light at a pose, counts per µs: of the points, weighted by the inverse square of their distance.
    pub fn at(&self, pose: Pose) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let mut weights = 0.0;
        for (at, rates) in &self.points {
            let square = (at.light - pose.light).powi(2) + (at.sensor - pose.sensor).powi(2);
            let weight = 1.0 / (square + 1e-8);
            weights += weight;
            for (sum, rate) in sum.iter_mut().zip(rates) {
                *sum += weight * rate;
            }
        }
        if weights == 0.0 {
            return sum;
        }
        sum.map(|sum| sum / weights)
    }
}

impl Certificate {
    /// Where the arms really were, when their encoders said `pose`.
    pub fn aligned(&self, pose: Pose) -> Pose {
        let offset = self.zero.as_ref().map_or(0.0, |zero| zero.offset_rad);
        Pose {
            light: ArmAngle::from_rad(pose.light.rad() + offset),
            sensor: ArmAngle::from_rad(pose.sensor.rad() + offset),
        }
    }

    /// How unsure the zeros of both arms are: as the rig file says, but for their sum where a mirror was measured.
    pub fn u_zero(&self, file: &RigFile) -> ZeroUncertainty {
        let known = ZeroUncertainty::of_each_arm(file.uncertainty.zero_rad);
        match &self.zero {
            Some(zero) => ZeroUncertainty {
                half_sum_rad: zero.u_rad,
                ..known
            },
            None => known,
        }
    }

    /// When each part that it has was made, with its name.
    pub fn parts(&self) -> impl Iterator<Item = (&'static str, &Conditions)> {
        let white = self.white.as_ref().map(|part| ("white", &part.conditions));
        let trap = self.trap.as_ref().map(|part| ("trap", &part.conditions));
        let zero = self.zero.as_ref().map(|part| ("mirror", &part.conditions));
        let colour = self.colour.as_ref().map(|part| ("colour", &part.conditions));
        [white, trap, zero, colour].into_iter().flatten()
    }
}
