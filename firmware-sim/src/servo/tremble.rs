//! What the shaft does beside the path that its controller leads it along: it hangs, trembles, hunts and rings. All of
//! it is a closed form of time.

use std::f64::consts::TAU;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{Servo, reg};
use crate::Mechanics;

/// Sines that add up to a tremble without a period of its own: share of the whole, Hz.
const JITTER: [(f64, f64); 3] = [(0.5, 11.3), (0.3, 17.9), (0.2, 29.3)];
/// A swing is over when it is below this share of where it began.
const RUNG_OUT: f64 = 1e-4;
/// Motions shorter than this ring as much less, counts.
const FULL_RING: f64 = 100.0;
/// A P gain n of the table pulls with n/128 units of PWM per count; an I gain n with n/65,536 per count and ms.
const P_UNIT: f64 = 128.0;
const I_UNIT: f64 = 65.536;
/// Nothing falls further than this from the normal, degrees.
const LOWEST_DEG: f64 = 100.0;

impl Servo {
    /// How much more a count of error is than at the model's Position P Gain from the factory, for which the figures of
    /// the mechanics hold (e-manual, "Position PID Gain").
    fn softness(&self) -> f64 {
        let [.., factory] = self.fitting.model.gains;
        f64::from(factory) / (self.node.table.get(reg::POSITION_P_GAIN) as f64).max(1.0)
    }

    /// Seconds by which the shaft is late behind its profile: the error by which a proportional controller pulls.
    pub(super) fn lag_s(&self) -> f64 {
        self.fitting.lag.as_secs_f64() * self.softness()
    }

    /// Counts short of a goal at which friction holds the shaft: static error and stiction.
    pub(super) fn short(&self) -> [f64; 2] {
        let at_this_gain = |counts: f64| counts * self.softness();
        [
            at_this_gain(self.mechanics.static_error_counts),
            at_this_gain(self.mechanics.stiction_counts),
        ]
    }

    /// The last counts of a motion and how fast they are crept, counts and counts/s: as set, or what an integral gain
    /// makes of what a proportional one leaves.
    pub(super) fn creep(&self) -> Option<[f64; 2]> {
        let creep = self.mechanics.creep;
        let set = [creep.counts.0, creep.counts_per_s.0];
        (set[0] > 0.0 && set[1] > 0.0).then_some(set)
    }

    /// How fast an integral gain takes away an error of so many counts, counts/s; 0 without one.
    pub(super) fn integral_rate(&self, error: f64) -> f64 {
        let i = self.node.table.get(reg::POSITION_I_GAIN) as f64 / I_UNIT;
        let p = (self.node.table.get(reg::POSITION_P_GAIN) as f64 / P_UNIT).max(1.0 / P_UNIT);
        error * i / p
    }

    /// By how many counts the shaft is off its path, and how fast that changes, counts/s.
    pub(super) fn off(&self, t_s: f64) -> (f64, f64) {
        let mut off = (0.0, 0.0);
        if !self.torque() {
            return off;
        }
        let mut add = |(counts, per_s): (f64, f64)| off = (off.0 + counts, off.1 + per_s);
        if self.mechanics.gravity_counts != 0.0 {
            let angle_rad = self.fitting.axis.angle(self.shaft.at(t_s).0).rad();
            let hangs = self.fitting.axis.sign * self.mechanics.gravity_counts * self.softness();
            add((hangs * angle_rad.sin(), 0.0));
        }
        for (share, hz) in JITTER {
            add(sine(self.mechanics.jitter_counts * share, hz, t_s + self.phase_s));
        }
        let hunting = self.mechanics.hunting;
        add(sine(hunting.counts.0, hunting.hz.0, t_s + self.phase_s));
        if let Some((amplitude, since_s)) = self.ringing(t_s) {
            let (counts, per_s) = sine(amplitude, self.mechanics.ring.hz.0, since_s);
            let left = (-since_s / self.mechanics.ring.tau_s.0).exp();
            add((
                counts * left,
                per_s * left - counts * left / self.mechanics.ring.tau_s.0,
            ));
        }
        off
    }

    /// Amplitude of the swing that the last motion left, counts, and the seconds since; `None` when it has died out.
    fn ringing(&self, t_s: f64) -> Option<(f64, f64)> {
        let ring = self.mechanics.ring;
        let (since_s, way) = self.shaft.since_motion(t_s)?;
        let lasts_s = -ring.tau_s.0 * RUNG_OUT.ln();
        (ring.counts.0 > 0.0 && since_s < lasts_s)
            .then_some((ring.counts.0 * (way.abs() / FULL_RING).min(1.0), since_s))
    }

    /// Whether the shaft is still but for what [`Self::off`] says, and that is constant.
    pub(super) fn trembles(&self, t_s: f64) -> bool {
        let Mechanics {
            jitter_counts,
            hunting,
            ..
        } = self.mechanics;
        self.torque() && (jitter_counts > 0.0 || hunting.counts.0 > 0.0 || self.ringing(t_s).is_some())
    }

    /// By how many counts the encoder shows more than where the shaft is.
    pub(super) fn encoder_error(&self, shaft: f64) -> f64 {
        let error = self.mechanics.encoder_error;
        let angle_rad = self.fitting.axis.angle(shaft).rad();
        self.counts(error.amplitude_deg.0) * (error.periods.0 * angle_rad).sin()
    }

    /// What noise adds to one look at the encoder, counts.
    pub(super) fn encoder_noise(&self) -> f64 {
        match self.mechanics.encoder_noise_deg {
            0.0 => 0.0,
            sigma_deg => {
                let mut random = ChaCha8Rng::seed_from_u64(self.fitting.seed);
                random.set_stream(self.node.now.as_nanos() as u64);
                let normal: f64 = StandardNormal.sample(&mut random);
                self.counts(sigma_deg) * normal
            }
        }
    }

    /// An angle of the arm in counts, without a sign.
    fn counts(&self, deg: f64) -> f64 {
        deg.to_radians() / self.fitting.axis.resolution_rad()
    }

    /// Where an arm without torque falls to and how fast, counts and counts/s; `None` where it does not.
    pub(super) fn falls(&self, shaft: f64) -> Option<[f64; 2]> {
        let rate = self.counts(self.mechanics.sag_deg_per_s);
        let deg = self.fitting.axis.angle(shaft).deg();
        let lowest = arms::ArmAngle::from_deg(LOWEST_DEG.copysign(deg));
        (rate > 0.0 && !self.torque() && deg.abs() < LOWEST_DEG)
            .then(|| [self.fitting.axis.counts(lowest), rate])
    }

    /// Somebody turns the arm, which gives way where there is no torque.
    pub(super) fn turn(&mut self, deg: f64) {
        if self.torque() {
            return;
        }
        let now_s = self.node.now.as_secs_f64();
        let by = self.fitting.axis.sign * self.counts(deg);
        self.shaft.jump(now_s, self.shaft.at(now_s).0 + by);
        self.stand();
    }
}

/// A sine and its slope.
fn sine(amplitude: f64, hz: f64, t_s: f64) -> (f64, f64) {
    let (sin, cos) = (TAU * hz * t_s).sin_cos();
    (amplitude * sin, amplitude * TAU * hz * cos)
}
