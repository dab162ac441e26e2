use serde::{Deserialize, Serialize};

use crate::amount::UpTo;

/// How a servo and the arm on it depart from ideal ones: what friction, gears, load and encoder do.
///
/// Counts are those of the servo's encoder. The goal is reached by a proportional controller, so static error,
/// stiction and gravity grow as its gain is lowered: the figures hold for the gain that a servo has from the factory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanics {
    /// By how many counts the shaft stops short of its goal, on the side from which it came: what friction takes.
    pub static_error_counts: f64,
    /// By how many counts it stops short where it also ignores a goal within twice as many of where it rests.
    pub stiction_counts: f64,
    /// The last counts of a motion, which it creeps.
    pub creep: Creep,
    /// A limit cycle about the goal, as an integral gain makes it on friction.
    pub hunting: Hunting,
    /// Largest excursion of a tremble that never ends, counts.
    pub jitter_counts: f64,
    /// How an arm swings after a motion.
    pub ring: Ring,
    /// By how many counts an arm that lies horizontally hangs below its goal, counts · sin(angle from the normal).
    pub gravity_counts: f64,
    /// How fast an arm without torque falls away from the normal, degrees of the arm per second, to 100°.
    pub sag_deg_per_s: f64,
    /// By how much the encoder shows more than the angle of the arm, once or more often round the turn.
    pub encoder_error: EncoderError,
    /// Standard deviation of what the encoder shows at each look, degrees of the arm.
    pub encoder_noise_deg: f64,
}

impl Mechanics {
    /// A decent servo of the X series as it is delivered: friction takes three counts, and it trembles by one.
    pub const DEFAULT: Self = Self {
        static_error_counts: 3.0,
        jitter_counts: 1.0,
        ..Self::NONE
    };

    /// Nothing departs.
    pub const NONE: Self = Self {
        static_error_counts: 0.0,
        stiction_counts: 0.0,
        creep: Creep {
            counts: UpTo(0.0),
            counts_per_s: UpTo(0.0),
        },
        hunting: Hunting {
            counts: UpTo(0.0),
            hz: UpTo(0.0),
        },
        jitter_counts: 0.0,
        ring: Ring {
            counts: UpTo(0.0),
            hz: UpTo(0.0),
            tau_s: UpTo(0.0),
        },
        gravity_counts: 0.0,
        sag_deg_per_s: 0.0,
        encoder_error: EncoderError {
            amplitude_deg: UpTo(0.0),
            periods: UpTo(1.0),
        },
        encoder_noise_deg: 0.0,
    };
}

/// The last counts of a motion and how fast they pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Creep {
    /// How many counts before the goal it begins, 0 … 100.
    pub counts: UpTo<100>,
    /// Counts per second, 0 … 1000; 0: it does not creep.
    pub counts_per_s: UpTo<1000>,
}

/// A sine that a held shaft goes through without end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hunting {
    /// Amplitude, counts, 0 … 100.
    pub counts: UpTo<100>,
    /// Frequency, Hz, 0 … 50.
    pub hz: UpTo<50>,
}

/// A swing that dies out after a motion of 100 counts or more; after a shorter one it is as much smaller.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ring {
    /// Amplitude at the end of the motion, counts, 0 … 500.
    pub counts: UpTo<500>,
    /// Frequency, Hz, 0 … 50.
    pub hz: UpTo<50>,
    /// Time in which it falls to 1/e, s, 0 … 60.
    pub tau_s: UpTo<60>,
}

/// A sine over the turn by which an encoder errs, as one does whose magnet is not centred.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EncoderError {
    /// Amplitude, degrees of the arm, 0 … 5.
    pub amplitude_deg: UpTo<5>,
    /// Periods in a turn of the arm, 0 … 64.
    pub periods: UpTo<64>,
}

/// Keys of `[sim]`, `[sim.light]` and `[sim.sensor]`, of orders and of faults, that set [`Mechanics`]; what is not
/// given stays as it was.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MechanicsKeys {
    /// [`Mechanics::static_error_counts`], 0 … 100.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub static_error_counts: Option<UpTo<100>>,
    /// [`Mechanics::stiction_counts`], 0 … 100.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiction_counts: Option<UpTo<100>>,
    /// [`Mechanics::creep`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub creep: Option<Creep>,
    /// [`Mechanics::hunting`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hunting: Option<Hunting>,
    /// [`Mechanics::jitter_counts`], 0 … 50.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub jitter_counts: Option<UpTo<50>>,
    /// [`Mechanics::ring`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ring: Option<Ring>,
    /// [`Mechanics::gravity_counts`], 0 … 500.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity_counts: Option<UpTo<500>>,
    /// [`Mechanics::sag_deg_per_s`], 0 … 90.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sag_deg_per_s: Option<UpTo<90>>,
    /// [`Mechanics::encoder_error`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_error: Option<EncoderError>,
    /// [`Mechanics::encoder_noise_deg`], 0 … 5.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_noise_deg: Option<UpTo<5>>,
}

impl MechanicsKeys {
    /// What these keys make of given mechanics.
    pub fn over(self, base: Mechanics) -> Mechanics {
        let amount = |given: Option<f64>, base: f64| given.unwrap_or(base);
        Mechanics {
            static_error_counts: amount(self.static_error_counts.map(f64::from), base.static_error_counts),
            stiction_counts: amount(self.stiction_counts.map(f64::from), base.stiction_counts),
            creep: self.creep.unwrap_or(base.creep),
            hunting: self.hunting.unwrap_or(base.hunting),
            jitter_counts: amount(self.jitter_counts.map(f64::from), base.jitter_counts),
            ring: self.ring.unwrap_or(base.ring),
            gravity_counts: amount(self.gravity_counts.map(f64::from), base.gravity_counts),
            sag_deg_per_s: amount(self.sag_deg_per_s.map(f64::from), base.sag_deg_per_s),
            encoder_error: self.encoder_error.unwrap_or(base.encoder_error),
            encoder_noise_deg: amount(self.encoder_noise_deg.map(f64::from), base.encoder_noise_deg),
        }
    }
}
