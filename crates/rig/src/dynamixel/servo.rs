use std::time::Duration;

use arms::{ArmAngle, Limits, Profile};

use super::block::{self, Block, State, i32_at};
use super::braking::{self, Braking};
use super::model::{Indirect, Model};
use super::node::Node;
use super::register::{Register, common, servo};
use crate::{Actuator, ArmSettings, Estop, Identity, Location, RigError};

/// A servo that is further from where it stood before its torque came on has moved, turns of it (about 1°).
const STILL: f64 = 12.0 / 4096.0;

/// Value of Bus Watchdog once it has tripped (e-manual, "Bus Watchdog(98)").
const TRIPPED: u8 = 255;

/// The servo of one arm.
#[derive(Debug)]
pub struct Servo {
    pub(super) node: Node,
    pub(super) settings: ArmSettings,
    pub(super) limits: Limits,
    pub(super) watchdog: Duration,
    pub(super) latency: Duration,
    pub(super) estop: Estop,
    /// Where the indirect data show the state, once they do.
    pub(super) mapped: Option<Indirect>,
    /// Its firmware, where the place of its indirect data depends on it and was looked for.
    pub(super) firmware: Option<u8>,
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

    /// Its model, as the rig file says.
    fn model(&self) -> &'static Model {
        self.settings.model
    }

    /// Where this servo has a register, for a message.
    fn address(&self, register: Register) -> u16 {
        self.node.place(register.address)
    }

    /// Points the indirect data at the state. A servo may refuse that while its torque is on, and one of old firmware may
    /// have no indirect data; then the state is read register by register.
    pub(crate) async fn map(&mut self) -> Result<(), RigError> {
        self.mapped = None;
        let Some(indirect) = self.indirect().await? else {
            return Ok(());
        };
        let wanted = block::state_map(self.model().series);
        let map = block::state_map_block(indirect);
        if self.node.read(map).await? != wanted {
            match self.node.write_block(map, &wanted).await {
                Err(RigError::Refused { .. }) => return Ok(()),
                result => result?,
            }
        }
        self.mapped = Some(indirect);
        Ok(())
    }

    /// Its indirect data, where its firmware has them at a known place.
    async fn indirect(&mut self) -> Result<Option<Indirect>, RigError> {
        let series = self.model().series;
        if series.indirect_from_firmware == 0 {
            return Ok(series.indirect(0));
        }
        let firmware = self.node.read_u8(common::FIRMWARE_VERSION).await?;
        self.firmware = Some(firmware);
        Ok(series.indirect(firmware))
    }

    /// Its firmware and the first one that has indirect data at a known place, where it was found to be older.
    pub(crate) fn lacks_indirect_data(&self) -> Option<(u8, u8)> {
        let needed = self.model().series.indirect_from_firmware;
        self.firmware
            .filter(|&firmware| firmware < needed)
            .map(|firmware| (firmware, needed))
    }

    /// The goal at which a servo that moves comes to rest on its profile.
    async fn stopping_goal(&self) -> Result<Option<i32>, RigError> {
        let registers = self.node.ask(braking::REGISTERS).await?;
        let ends = [self.limits.min, self.limits.max].map(|end| self.settings.axis.counts(end));
        Ok(Braking::read(&registers.parameters).rest(&self.settings.axis, ends, self.latency))
    }

    /// Whether the bus watchdog has tripped.
    pub(crate) async fn watchdog_tripped(&self) -> Result<bool, RigError> {
        let watchdog = self.node.ask(Block::of(common::BUS_WATCHDOG)).await?;
        Ok(watchdog.parameters[0] == TRIPPED)
    }

    /// Restarts the servo: it answers, then is deaf for a while, and has no torque and no profile afterwards.
    pub(crate) async fn reboot(&mut self) -> Result<(), RigError> {
        self.engaged = false;
        self.mapped = None;
        self.node.reboot().await
    }

    /// Everything about the servo that differs from the rig file, each with what to do about it.
    async fn differences(&self) -> Result<(Identity, Vec<String>), RigError> {
        let model = self.node.read(Block::of(common::MODEL_NUMBER)).await?;
        let model = u16::from_le_bytes([model[0], model[1]]);
        let known = Model::numbered(model);
        let name = known.map_or_else(|| format!("unknown model {model}"), |known| known.name.to_owned());
        let setup = self.node.read(block::SETUP).await?;
        let (firmware, return_delay_us) = (setup[0], u64::from(setup[3]) * 2);
        let identity = Identity {
            id: self.node.id,
            model: name.clone(),
            firmware,
        };
        let mut differences = Vec::new();
        let settings = &self.settings;
        if known != Some(settings.model) {
            differences.push(format!(
                "it is {name}, the rig file says {}: correct `model` or the wiring",
                settings.model.name
            ));
            // What an unknown device's other registers mean is anyone's guess.
            return Ok((identity, differences));
        }
        let oldest = settings.model.series.firmware_min;
        if firmware < oldest {
            differences.push(format!("firmware {firmware} is older than {oldest}: update it"));
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
        let most = self.model().homing_offset_max();
        if offset.unsigned_abs() > most.unsigned_abs() {
            differences.push(format!(
                "homing offset is {offset}, which position mode ignores beyond ±{most}: write 0 to address 20 and put \
                 the offset into `zero_deg`"
            ));
        }
        let level = self.node.read_u8(common::STATUS_RETURN_LEVEL).await?;
        if level != 2 {
            differences.push(format!(
                "status return level is {level}, so writes are not acknowledged: write 2 to address {}",
                self.address(common::STATUS_RETURN_LEVEL)
            ));
        }
        Ok(())
    }

    async fn compare_limits(&self, differences: &mut Vec<String>) -> Result<(), RigError> {
        let axis = self.settings.axis;
        let [velocity, acceleration] = axis.profile_registers(self.settings.profile);
        let limit = self.read_i32(servo::VELOCITY_LIMIT).await?;
        if i64::from(velocity) > i64::from(limit) {
            let allowed = (f64::from(limit) * axis.units.velocity_rad_s / axis.gear).to_degrees();
            differences.push(format!(
                "velocity limit is {limit}, the arm's speed needs {velocity}: lower `velocity_deg_s` to {allowed:.3} \
                 or raise address 44"
            ));
        }
        if self.model().acceleration_limit.is_some() {
            let limit = self.read_i32(servo::ACCELERATION_LIMIT).await?;
            if i64::from(acceleration) > i64::from(limit) {
                let allowed = (f64::from(limit) * axis.units.acceleration_rad_s2 / axis.gear).to_degrees();
                differences.push(format!(
                    "acceleration limit is {limit}, the arm's acceleration needs {acceleration}: lower \
                     `acceleration_deg_s2` to {allowed:.3} or raise address 40"
                ));
            }
        }
        let ends = [self.limits.min, self.limits.max].map(|end| axis.counts(end).round() as i64);
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let min = self.read_i32(servo::MIN_POSITION_LIMIT).await?;
        let max = self.read_i32(servo::MAX_POSITION_LIMIT).await?;
        if low < i64::from(min) || high > i64::from(max) {
            differences.push(format!(
                "position limits are {min} … {max}, the arm's limits need {low} … {high}: narrow `min_deg` and \
                 `max_deg`, or widen addresses 52 and 48"
            ));
        }
        Ok(())
    }

    async fn read_i32(&self, register: Register) -> Result<i32, RigError> {
        let bytes = self.node.read(Block::of(register)).await?;
        Ok(i32_at(&bytes, 0))
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
        let still = STILL * self.settings.axis.units.counts_per_turn;
        let near = |counts: i32| (f64::from(counts) - f64::from(before.position)).abs() <= still;
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
        if let Some(indirect) = self.mapped {
            let state = block::state(&self.node.ask(block::state_block(indirect)).await?.parameters);
            // After a restart the map is lost and everything reads 0.
            if state.torque {
                return Ok(self.place(state));
            }
        }
        Ok(self.place(self.state().await?))
    }

    async fn stop(&mut self) -> Result<(), RigError> {
        let torque = self.node.ask(Block::of(servo::TORQUE_ENABLE)).await?;
        if torque.parameters[0] == 1
            && let Some(goal) = self.stopping_goal().await?
        {
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
