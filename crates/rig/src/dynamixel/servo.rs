use std::f64::consts::TAU;
use std::time::Duration;

use arms::{ArmAngle, Limits, Profile};

use super::block::{self, Block, State, i32_at, u32_of};
use super::node::Node;
use super::register::{MODELS, common, servo};
use crate::axis::{ACCELERATION_UNIT_RAD_S2, COUNTS_PER_TURN, VELOCITY_UNIT_RAD_S};
use crate::{Actuator, ArmSettings, Estop, Identity, Location, RigError};

/// An arm that is further from where it stood before its torque came on has moved, counts (about 1°).
const STILL: i32 = 12;

/// First firmware with the bus watchdog and the drive mode register as used here (e-manual, "Bus Watchdog(98)").
const FIRMWARE_MIN: u8 = 38;

/// Value of Bus Watchdog once it has tripped (e-manual, "Bus Watchdog(98)").
const TRIPPED: u8 = 255;

/// Homing offsets beyond this are ignored in position mode (e-manual, "Homing Offset(20)").
const HOMING_OFFSET_MAX: i32 = 1024;

/// The servo of one arm.
#[derive(Debug)]
pub struct Servo {
    pub(super) node: Node,
    pub(super) settings: ArmSettings,
    pub(super) limits: Limits,
    pub(super) watchdog: Duration,
    pub(super) latency: Duration,
    pub(super) estop: Estop,
    /// The indirect data show the state.
    pub(super) mapped: bool,
    pub(super) engaged: bool,
}

impl Servo {
    /// The state in the arm's terms.
    pub(super) fn place(&self, state: State) -> Location {
        let angle = |counts: i32| self.settings.axis.angle(f64::from(counts));
        Location {
            goal: angle(state.goal),
            measured: angle(state.position),
            in_position: state.in_position,
            moving: state.moving,
            torque: state.torque,
            hardware_error: state.hardware_error,
        }
    }

    /// Reads the state register by register, for a servo whose indirect data do not show it.
    pub(super) async fn state(&self) -> Result<State, RigError> {
        let byte = |bytes: Vec<u8>| bytes[0];
        let ask = |block: Block| self.node.ask(block);
        let torque = byte(ask(Block::of(servo::TORQUE_ENABLE)).await?.parameters);
        let hardware_error = self.node.hardware_error().await?;
        let moving = ask(block::MOVING).await?.parameters;
        Ok(State {
            torque: torque == 1,
            hardware_error,
            moving: moving[0] == 1,
            in_position: moving[1] & 1 == 1,
            goal: self.node.ask_i32(servo::GOAL_POSITION).await?,
            position: self.node.ask_i32(servo::PRESENT_POSITION).await?,
        })
    }

    /// Points the indirect data at the state. A servo may refuse that while its torque is on; then the state is read
    /// register by register.
    pub(crate) async fn map(&mut self) -> Result<(), RigError> {
        let wanted = block::state_map();
        self.mapped = self.node.read(block::STATE_MAP).await? == wanted;
        if !self.mapped {
            match self.node.write(servo::INDIRECT_ADDRESS_1, &wanted).await {
                Err(RigError::Refused { .. }) => {}
                result => result.map(|()| self.mapped = true)?,
            }
        }
        Ok(())
    }

    /// The goal at which a servo that moves comes to rest on its profile.
    async fn stopping_goal(&self) -> Result<i32, RigError> {
        let acceleration = self.node.ask_i32(servo::PROFILE_ACCELERATION).await?;
        let velocity = self.node.ask_i32(servo::PRESENT_VELOCITY).await?;
        let heading = f64::from(self.node.ask_i32(servo::GOAL_POSITION).await?);
        let position = self.node.ask_i32(servo::PRESENT_POSITION).await?;
        let counts = |rad: f64| rad * COUNTS_PER_TURN / TAU;
        let v = counts(f64::from(velocity) * VELOCITY_UNIT_RAD_S);
        let braking = match acceleration {
            0 => 0.0,
            units => v * v / (2.0 * counts(f64::from(units) * ACCELERATION_UNIT_RAD_S2)),
        };
        // The arm has gone on since its position was read; a goal too near would make it swing back.
        let ahead = braking + v.abs() * self.latency.as_secs_f64();
        let goal = f64::from(position) + ahead.round().copysign(v);
        // Nor may it lead beyond where the arm was going: the way was checked only up to there.
        let onward = (heading - f64::from(position)) * v > 0.0;
        let goal = match onward {
            true if v > 0.0 => goal.min(heading),
            true => goal.max(heading),
            false => goal,
        };
        // Braking must not lead out of the limits, nor back.
        let ends = [self.limits.min, self.limits.max].map(|end| self.settings.axis.counts(end).round());
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let position = f64::from(position);
        Ok(goal.clamp(low.min(position), high.max(position)) as i32)
    }

    /// Whether the bus watchdog has tripped.
    pub(crate) async fn watchdog_tripped(&self) -> Result<bool, RigError> {
        let watchdog = self.node.ask(Block::of(common::BUS_WATCHDOG)).await?;
        Ok(watchdog.parameters[0] == TRIPPED)
    }

    /// Restarts the servo: it answers, then is deaf for a while, and has no torque and no profile afterwards.
    pub(crate) async fn reboot(&mut self) -> Result<(), RigError> {
        self.engaged = false;
        self.mapped = false;
        self.node.reboot().await
    }

    /// Everything about the servo that differs from the rig file, each with what to do about it.
    async fn differences(&self) -> Result<(Identity, Vec<String>), RigError> {
        let model = self.node.read(Block::of(common::MODEL_NUMBER)).await?;
        let model = u16::from_le_bytes([model[0], model[1]]);
        let known = MODELS.iter().find(|&&(_, number)| number == model);
        let name = known.map_or_else(|| format!("unknown model {model}"), |&(name, _)| name.to_owned());
        let setup = self.node.read(block::SETUP).await?;
        let (firmware, return_delay_us) = (setup[0], u64::from(setup[3]) * 2);
        let identity = Identity {
            id: self.node.id,
            model: name.clone(),
            firmware,
        };
        let mut differences = Vec::new();
        let settings = &self.settings;
        if name != settings.model {
            differences.push(format!(
                "it is {name}, the rig file says {}: correct `model` or the wiring",
                settings.model
            ));
            // What an unknown device's other registers mean is anyone's guess.
            return Ok((identity, differences));
        }
        if firmware < FIRMWARE_MIN {
            differences.push(format!(
                "firmware {firmware} is older than {FIRMWARE_MIN}: update it"
            ));
        }
        let expected = settings.return_delay.as_micros() as u64;
        if return_delay_us != expected {
            differences.push(format!(
                "return delay is {return_delay_us} µs, the rig file says {expected} µs: write {} to address 9, or \
                 correct `return_delay_us`",
                expected / 2
            ));
        }
        self.compare_modes(&mut differences).await?;
        self.compare_limits(&mut differences).await?;
        Ok((identity, differences))
    }

    async fn compare_modes(&self, differences: &mut Vec<String>) -> Result<(), RigError> {
        let modes = self.node.read(block::MODES).await?;
        if modes[1] != 3 {
            differences.push(format!(
                "operating mode is {}, not 3 (position): write 3 to address 11",
                modes[1]
            ));
        }
        if modes[0] != 0 {
            differences.push(format!(
                "drive mode is {:#04x}, not 0 (direction belongs into `sign`, profiles are velocity-based, torque is \
                 never switched on by a goal): write 0 to address 10",
                modes[0]
            ));
        }
        let offset = self.node.read(Block::of(servo::HOMING_OFFSET)).await?;
        let offset = i32_at(&offset, 0);
        if offset.abs() > HOMING_OFFSET_MAX {
            differences.push(format!(
                "homing offset is {offset}, which position mode ignores beyond ±{HOMING_OFFSET_MAX}: write 0 to \
                 address 20 and put the offset into `zero_deg`"
            ));
        }
        let level = self.node.read_u8(common::STATUS_RETURN_LEVEL).await?;
        if level != 2 {
            differences.push(format!(
                "status return level is {level}, so writes are not acknowledged: write 2 to address 68"
            ));
        }
        Ok(())
    }

    async fn compare_limits(&self, differences: &mut Vec<String>) -> Result<(), RigError> {
        let bytes = self.node.read(block::LIMITS).await?;
        let at = |register| u32_of(&bytes, block::LIMITS, register);
        let axis = self.settings.axis;
        let [velocity, _] = axis.profile_registers(self.settings.profile);
        let limit = at(servo::VELOCITY_LIMIT);
        if velocity > limit {
            let allowed = (f64::from(limit) * VELOCITY_UNIT_RAD_S / axis.gear).to_degrees();
            differences.push(format!(
                "velocity limit is {limit}, the arm's speed needs {velocity}: lower `velocity_deg_s` to {allowed:.3} \
                 or raise address 44"
            ));
        }
        let ends = [self.limits.min, self.limits.max].map(|end| axis.counts(end).round() as i64);
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let (min, max) = (at(servo::MIN_POSITION_LIMIT), at(servo::MAX_POSITION_LIMIT));
        if low < i64::from(min) || high > i64::from(max) {
            differences.push(format!(
                "position limits are {min} … {max}, the arm's limits need {low} … {high}: narrow `min_deg` and \
                 `max_deg`, or widen addresses 52 and 48"
            ));
        }
        Ok(())
    }
}

impl Actuator for Servo {
    type Error = RigError;

    async fn identify(&mut self) -> Result<Identity, RigError> {
        let bits = match self.node.hardware_error().await {
            Ok(bits) => bits,
            Err(error) => return Err(self.node.explain(error).await),
        };
        if bits != 0 {
            return Err(self.node.hardware(bits));
        }
        let (identity, differences) = self.differences().await?;
        if !differences.is_empty() {
            return Err(RigError::Mismatch {
                device: self.node.device,
                id: self.node.id,
                differences,
            });
        }
        Ok(identity)
    }

    async fn engage(&mut self, profile: Profile) -> Result<(), RigError> {
        self.engaged = false;
        // Clears a watchdog that has tripped, which would refuse every goal.
        self.node.write(common::BUS_WATCHDOG, &[0]).await?;
        let [velocity, acceleration] = self.settings.axis.profile_registers(profile);
        // Acceleration and velocity are neighbours.
        let registers = [acceleration.to_le_bytes(), velocity.to_le_bytes()].concat();
        self.node.write(servo::PROFILE_ACCELERATION, &registers).await?;
        self.map().await?;
        let before = self.state().await?;
        let present = before.position.to_le_bytes();
        self.node.write(servo::GOAL_POSITION, &present).await?;
        self.node.write(servo::TORQUE_ENABLE, &[1]).await?;
        let after = self.state().await?;
        let near = |counts: i32| (counts - before.position).abs() <= STILL;
        if !after.torque || !near(after.goal) || !near(after.position) {
            self.node.tell(servo::TORQUE_ENABLE, &[0]).await?;
            return Err(RigError::Moved {
                device: self.node.device,
                before: self.place(before).measured,
                after: self.place(after).measured,
            });
        }
        let watchdog = (self.watchdog.as_millis() / 20) as u8;
        self.node.write(common::BUS_WATCHDOG, &[watchdog]).await?;
        self.engaged = true;
        Ok(())
    }

    async fn steer(&mut self, goal: ArmAngle, profile: Profile) -> Result<(), RigError> {
        // An arm that is not engaged may have no torque, and no watchdog.
        if !self.engaged {
            return Err(RigError::NotEngaged {
                device: self.node.device,
            });
        }
        let [velocity, acceleration] = self.settings.axis.profile_registers(profile);
        let goal = self.settings.axis.counts(goal).round() as i32;
        // Acceleration, velocity and goal are neighbours.
        let registers = [
            acceleration.to_le_bytes(),
            velocity.to_le_bytes(),
            goal.to_le_bytes(),
        ]
        .concat();
        self.node.write(servo::PROFILE_ACCELERATION, &registers).await
    }

    async fn location(&mut self) -> Result<Location, RigError> {
        if self.mapped {
            let state = block::state(&self.node.ask(block::STATE).await?.parameters);
            // After a restart the map is lost and everything reads 0.
            if state.torque {
                return Ok(self.place(state));
            }
        }
        Ok(self.place(self.state().await?))
    }

    async fn stop(&mut self) -> Result<(), RigError> {
        let torque = self.node.ask(Block::of(servo::TORQUE_ENABLE)).await?;
        if torque.parameters[0] == 1 {
            let goal = self.stopping_goal().await?;
            self.node.tell(servo::GOAL_POSITION, &goal.to_le_bytes()).await?;
        }
        Ok(())
    }

    async fn halt(&mut self) -> Result<(), RigError> {
        self.engaged = false;
        match self.estop {
            Estop::Limp => self.node.tell(servo::TORQUE_ENABLE, &[0]).await?,
            Estop::Hold => {
                self.node.tell(servo::PROFILE_ACCELERATION, &[0; 8]).await?;
                let position = self.node.ask_i32(servo::PRESENT_POSITION).await?;
                self.node
                    .tell(servo::GOAL_POSITION, &position.to_le_bytes())
                    .await?
            }
        };
        Ok(())
    }

    async fn disengage(&mut self) -> Result<(), RigError> {
        self.engaged = false;
        self.node.tell(common::BUS_WATCHDOG, &[0]).await?;
        if self.estop == Estop::Limp {
            self.node.tell(servo::TORQUE_ENABLE, &[0]).await?;
        }
        Ok(())
    }
}
