//! From registers to motion and back (e-manual, "Profile Velocity", "Moving Status").

use arms::Profile;

use super::{Servo, reg};
use crate::Disturbance;
use crate::table::Table;

/// In position: this close to the goal, turns. The manual names no figure; this is loose enough that the bit alone
/// does not mean settled.
const IN_POSITION: f64 = 5.0 / 4096.0;
/// Following error: this far behind the profile, turns; likewise no figure in the manual.
const FOLLOWING_ERROR: f64 = 50.0 / 4096.0;
/// Present Current while holding, while moving, units of 2.69 mA.
const HOLDING_CURRENT: i64 = 4;
const MOVING_CURRENT: i64 = 60;
/// Below this speed a shaft counts as held, counts/s.
const HOLDING_SPEED: f64 = 1.0;
/// Present Load of a shaft that is stuck, of a servo without current registers, 0.1 %.
const FULL_LOAD: u16 = 1000;
/// Supply to which [`Disturbance::SAG_V`] is the sag, V.
const SUPPLY_V: f64 = 12.0;
/// By how much the electronics are warmer than the room, °C, and how fast they become it.
const SELF_HEATING_C: f64 = 6.0;
const WARMING_S: f64 = 600.0;
/// Realtime Tick wraps after 32,767 ms.
const TICKS: u128 = 32_768;

/// Operating modes.
const POSITION: i64 = 3;
const EXTENDED: i64 = 4;
const CURRENT_BASED: i64 = 5;

impl Servo {
    /// Unit of velocity registers, counts/s.
    fn velocity_unit(&self) -> f64 {
        self.fitting.model.series.velocity_unit_rpm * self.counts_per_turn() / 60.0
    }

    /// Unit of Profile Acceleration, counts/s².
    fn acceleration_unit(&self) -> f64 {
        self.fitting.model.series.acceleration_unit_rpm2 * self.counts_per_turn() / 3600.0
    }

    /// +1, or −1 where the drive mode reverses.
    pub(super) fn direction(&self) -> f64 {
        match self.node.table.get(reg::DRIVE_MODE) & 1 {
            0 => 1.0,
            _ => -1.0,
        }
    }

    /// Whether Goal Position moves anything in this mode. Wheels and torque are not what an arm does: in the other
    /// modes the shaft stands still.
    pub(super) fn positions(&self) -> bool {
        matches!(
            self.node.table.get(reg::OPERATING_MODE),
            POSITION | EXTENDED | CURRENT_BASED
        )
    }

    /// Range of Goal Position in a single turn; `None` in the other modes.
    pub(super) fn goal_limits(&self) -> Option<(i64, i64)> {
        let limits = (
            self.node.table.get(reg::MIN_POSITION),
            self.node.table.get(reg::MAX_POSITION),
        );
        (self.node.table.get(reg::OPERATING_MODE) == POSITION).then_some(limits)
    }

    /// In position mode an offset of more than a quarter turn is ignored (e-manual, "Homing Offset").
    fn homing(&self) -> f64 {
        let offset = self.node.table.get(reg::HOMING_OFFSET);
        let ignored = self.node.table.get(reg::OPERATING_MODE) == POSITION
            && offset.abs() > i64::from(self.fitting.model.homing_offset_max());
        if ignored { 0.0 } else { offset as f64 }
    }

    /// A position of the shaft as a register shows it.
    fn shown(&self, shaft: f64) -> i64 {
        (self.direction() * shaft - self.lost_turns + self.homing()).round() as i64
    }

    /// The shaft's position for a register value.
    fn meant(&self, register: i64) -> f64 {
        self.direction() * (register as f64 - self.homing() + self.lost_turns)
    }

    fn present(&self) -> i64 {
        let now_s = self.node.now.as_secs_f64();
        self.shown(self.shaft.at(now_s).0 + self.off(now_s).0 + self.encoder_noise())
    }

    /// Speed of the shaft, counts/s.
    fn speed(&self, t_s: f64) -> f64 {
        self.shaft.at(t_s).1 + self.off(t_s).1
    }

    /// Whether a profile is under way or the shaft turns faster than the threshold.
    pub(super) fn moves(&self) -> bool {
        let now_s = self.node.now.as_secs_f64();
        let threshold = self.node.table.get(reg::MOVING_THRESHOLD) as f64 * self.velocity_unit();
        now_s < self.profile.end_s() || self.speed(now_s).abs() > threshold
    }

    /// Stops at once where the shaft is, which becomes the goal.
    pub(super) fn stand(&mut self) {
        let now_s = self.node.now.as_secs_f64();
        let (position, _) = self.shaft.at(now_s);
        self.shaft.jump(now_s, position);
        self.profile.jump(now_s, position);
        self.node.table.set(reg::GOAL_POSITION, self.present());
        if let Some([lowest, per_s]) = self.falls(position) {
            self.shaft.go(now_s, lowest, even(per_s));
        }
    }

    /// Sets off towards Goal Position, from the velocity that the profile has now.
    pub(super) fn set_off(&mut self) {
        if !self.torque() || !self.positions() {
            return;
        }
        let now_s = self.node.now.as_secs_f64();
        let goal = self.meant(self.node.table.get(reg::GOAL_POSITION));
        let limit = self.node.table.get(reg::VELOCITY_LIMIT) as f64 * self.velocity_unit();
        if limit == 0.0 {
            return;
        }
        let shaft_profile = match self.profile_towards(goal, limit) {
            Some(profile) => {
                self.profile.go(now_s, goal, profile);
                profile
            }
            None => {
                self.profile_type = 0;
                self.profile.jump(now_s, goal);
                even(limit)
            }
        };
        if self.stalled_until.is_none() {
            self.lead(now_s + self.lag_s(), goal, shaft_profile);
        }
    }

    /// Leads the shaft towards a goal from a moment on, as far as friction lets it come.
    fn lead(&mut self, start_s: f64, goal: f64, profile: Profile) {
        let (from, velocity) = self.shaft.at(start_s);
        let [static_error, stiction] = self.short();
        let way = goal - from;
        let at_rest = velocity == 0.0;
        if at_rest && stiction > 0.0 && way.abs() <= 2.0 * stiction {
            self.shaft.jump(start_s, from);
            return;
        }
        let short = (static_error + stiction).min(way.abs());
        let stop = goal - short.copysign(way);
        if at_rest && stop == from {
            self.shaft.jump(start_s, from);
            return;
        }
        match self.creep() {
            Some([counts, per_s]) if counts < (stop - from).abs() => {
                self.shaft.go(start_s, stop - counts.copysign(way), profile);
                self.shaft.go(self.shaft.end_s(), stop, even(per_s));
            }
            _ => self.shaft.go(start_s, stop, profile),
        }
        let rate = self.integral_rate(short);
        if rate > 0.0 {
            self.shaft.go(self.shaft.end_s(), goal, even(rate));
        }
    }

    /// What the profile registers say, in counts; `None`: no profile, the goal is taken as a step.
    fn profile_towards(&mut self, goal: f64, limit: f64) -> Option<Profile> {
        let velocity = self.node.table.get(reg::PROFILE_VELOCITY) as f64;
        let acceleration = self.node.table.get(reg::PROFILE_ACCELERATION) as f64;
        let distance = (goal - self.profile.at(self.node.now.as_secs_f64()).0).abs();
        let (velocity, acceleration) = if velocity == 0.0 {
            return None;
        } else if self.node.table.get(reg::DRIVE_MODE) & 4 == 0 {
            (
                (velocity * self.velocity_unit()).min(limit),
                acceleration * self.acceleration_unit(),
            )
        } else {
            // Time-based: the whole motion and its acceleration in ms, the latter at most half of it.
            let (whole_s, ramp_s) = (velocity / 1e3, acceleration.min(velocity / 2.0) / 1e3);
            let cruise = (distance / (whole_s - ramp_s)).clamp(f64::MIN_POSITIVE, limit);
            (cruise, if ramp_s == 0.0 { 0.0 } else { cruise / ramp_s })
        };
        if acceleration == 0.0 {
            self.profile_type = 1;
            return Some(Profile {
                velocity_rad_s: velocity,
                acceleration_rad_s2: f64::INFINITY,
            });
        }
        self.profile_type = if distance < velocity * velocity / acceleration {
            2
        } else {
            3
        };
        Some(Profile {
            velocity_rad_s: velocity,
            acceleration_rad_s2: acceleration,
        })
    }

    /// A stall ends: the shaft goes on to the goal from where it was stuck.
    pub(super) fn release(&mut self) {
        self.stalled_until = None;
        let now_s = self.node.now.as_secs_f64();
        self.profile.jump(now_s, self.shaft.at(now_s).0);
        self.set_off();
    }

    /// The table as it reads now.
    pub(super) fn live(&self) -> Table {
        let mut table = self.node.table.clone();
        let now_s = self.node.now.as_secs_f64();
        let (shaft, velocity) = (self.shaft.at(now_s).0, self.speed(now_s));
        let (planned, planned_velocity) = self.profile.at(now_s);
        let present = self.present();
        let behind = (planned - shaft).abs() > FOLLOWING_ERROR * self.counts_per_turn();
        let speed = |counts: f64| (self.direction() * counts / self.velocity_unit()).round() as i64;
        let holds = velocity.abs() < HOLDING_SPEED;
        let model = self.fitting.model;
        let strongest = match model.current_limit {
            Some(_) => table.get(reg::CURRENT_LIMIT),
            None => FULL_LOAD.into(),
        };
        let current = match (self.torque(), behind && self.stalled_until.is_some()) {
            (false, _) => 0,
            (true, true) => strongest * speed(planned - shaft).signum(),
            (true, false) if holds => HOLDING_CURRENT,
            (true, false) => MOVING_CURRENT * speed(velocity).signum(),
        };
        let limit = (table.get(reg::VELOCITY_LIMIT) as f64 * self.velocity_unit()).max(1.0);
        let full = f64::from(model.series.pwm_limit);
        let pwm = (self.direction() * velocity / limit * full).clamp(-full, full);
        let warmth = SELF_HEATING_C * -(-now_s / WARMING_S).exp_m1();
        table.set(reg::REALTIME_TICK, (self.node.now.as_millis() % TICKS) as i64);
        table.set(reg::MOVING, i64::from(self.moves()));
        table.set(reg::MOVING_STATUS, i64::from(self.moving_status(present, behind)));
        table.set(reg::PRESENT_PWM, pwm as i64);
        table.set(reg::PRESENT_CURRENT, current);
        table.set(reg::PRESENT_VELOCITY, speed(velocity));
        table.set(reg::PRESENT_POSITION, present);
        table.set(reg::VELOCITY_TRAJECTORY, speed(planned_velocity));
        table.set(reg::POSITION_TRAJECTORY, self.shown(planned));
        let sags = self.node.now < self.sags_until;
        let share = if sags { Disturbance::SAG_V / SUPPLY_V } else { 1.0 };
        table.set(
            reg::PRESENT_VOLTAGE,
            (model.supply_v * share * 10.0).round() as i64,
        );
        table.set(
            reg::PRESENT_TEMPERATURE,
            (self.fitting.ambient_c + warmth).round() as i64,
        );
        table
    }

    fn moving_status(&self, present: i64, behind: bool) -> u8 {
        if !self.torque() || !self.positions() {
            return 0;
        }
        let ongoing = self.node.now.as_secs_f64() < self.profile.end_s();
        let off = (present - self.node.table.get(reg::GOAL_POSITION)).abs() as f64;
        u8::from(off <= IN_POSITION * self.counts_per_turn())
            | u8::from(ongoing) << 1
            | u8::from(behind) << 3
            | if ongoing { self.profile_type << 4 } else { 0 }
    }
}

/// A motion at one speed, counts/s, from its first moment to its last.
fn even(counts_per_s: f64) -> Profile {
    Profile {
        velocity_rad_s: counts_per_s,
        acceleration_rad_s2: f64::INFINITY,
    }
}
