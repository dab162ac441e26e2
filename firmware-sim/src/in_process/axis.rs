use std::time::Duration;

use arms::{Arm, ArmAngle, Profile};
use rig::dynamixel::register::{Register, common, servo};
use rig::dynamixel::{Braking, Model};
use rig::{Actuator, ArmSettings, Device, Estop, Identity, Location, MotionSettings, RigFile};

use super::{InProcessError, SharedBench};

/// Value of Bus Watchdog once it has tripped.
const TRIPPED: i64 = 0xFF;
/// Operating Mode: position within one turn.
const POSITION: i64 = 3;

/// One servo of the simulated rig.
#[derive(Debug)]
pub struct InProcessAxis {
    bench: SharedBench,
    device: Device,
    arm: ArmSettings,
    motion: MotionSettings,
    /// Counts between which the arm may be.
    range: [f64; 2],
}

impl InProcessAxis {
    pub(super) fn new(bench: SharedBench, file: &RigFile, arm: Arm) -> Self {
        let settings = file.arm(arm).clone();
        let limits = file.envelope.limits(arm);
        let ends = [limits.min, limits.max].map(|angle| settings.axis.counts(angle));
        Self {
            bench,
            device: arm.into(),
            arm: settings,
            motion: file.motion.clone(),
            range: [ends[0].min(ends[1]), ends[0].max(ends[1])],
        }
    }

    pub(super) fn counts(&self, angle: ArmAngle) -> i64 {
        self.arm.axis.counts(angle).round() as i64
    }

    fn read(&self, register: Register) -> Result<i64, InProcessError> {
        self.bench.read(self.device, register)
    }

    fn write(&self, register: Register, value: i64) -> Result<(), InProcessError> {
        self.bench.write(self.device, register, value)
    }

    pub(super) fn look(&self) -> Result<Location, InProcessError> {
        let angle = |counts: i64| self.arm.axis.angle(counts as f64);
        Ok(Location {
            goal: angle(self.read(servo::GOAL_POSITION)?),
            measured: angle(self.read(servo::PRESENT_POSITION)?),
            in_position: self.read(servo::MOVING_STATUS)? & 1 == 1,
            moving: self.read(servo::MOVING)? == 1,
            torque: self.read(servo::TORQUE_ENABLE)? == 1,
            hardware_error: self.hardware_error()?,
        })
    }

    fn hardware_error(&self) -> Result<u8, InProcessError> {
        self.read(common::HARDWARE_ERROR_STATUS).map(|bits| bits as u8)
    }

    /// Each way in which the servo is not what the rig file says.
    fn differences(&self) -> Result<Vec<String>, InProcessError> {
        let [velocity, _] = self.arm.axis.profile_registers(self.arm.profile);
        let exactly = |value: i64| value..=value;
        let model = self.arm.model;
        let (first, last) = model.positions().into_inner();
        let homing = i64::from(model.homing_offset_max());
        let rules = [
            (servo::OPERATING_MODE, exactly(POSITION)),
            (servo::DRIVE_MODE, exactly(0)),
            (common::STATUS_RETURN_LEVEL, exactly(2)),
            (
                common::RETURN_DELAY_TIME,
                exactly(self.arm.return_delay.as_micros() as i64 / 2),
            ),
            // Beyond, position mode ignores it.
            (servo::HOMING_OFFSET, -homing..=homing),
            (
                servo::MIN_POSITION_LIMIT,
                first.into()..=self.range[0].round() as i64,
            ),
            (
                servo::MAX_POSITION_LIMIT,
                self.range[1].round() as i64..=last.into(),
            ),
            (
                servo::VELOCITY_LIMIT,
                i64::from(velocity)..=i64::from(self.arm.axis.units.velocity_max),
            ),
        ];
        let mut differences = Vec::new();
        for (register, wanted) in rules {
            let found = self.read(register)?;
            if !wanted.contains(&found) {
                let Register { name, address, .. } = model.at(register);
                let (min, max) = wanted.into_inner();
                differences.push(format!(
                    "{name} is {found}, allowed: {min} … {max}; write it to address {address}"
                ));
            }
        }
        Ok(differences)
    }
}

impl Actuator for InProcessAxis {
    type Error = InProcessError;

    async fn identify(&mut self) -> Result<Identity, InProcessError> {
        let device = self.device;
        let number = self.read(common::MODEL_NUMBER)?;
        let model = u16::try_from(number).ok().and_then(Model::numbered);
        let name = model.map_or_else(|| format!("model number {number}"), |model| model.name.to_owned());
        let mut differences = self.differences()?;
        if model != Some(self.arm.model) {
            differences.insert(0, format!("it is a {name}, must be a {}", self.arm.model.name));
        }
        if !differences.is_empty() {
            return Err(InProcessError::Mismatch { device, differences });
        }
        match self.hardware_error()? {
            0 => Ok(Identity {
                id: self.arm.id,
                model: name,
                firmware: self.read(common::FIRMWARE_VERSION)? as u8,
            }),
            bits => Err(InProcessError::Hardware { device, bits }),
        }
    }

    async fn engage(&mut self, profile: Profile) -> Result<(), InProcessError> {
        let [velocity, acceleration] = self.arm.axis.profile_registers(profile);
        self.write(common::BUS_WATCHDOG, 0)?;
        self.write(servo::PROFILE_ACCELERATION, i64::from(acceleration))?;
        self.write(servo::PROFILE_VELOCITY, i64::from(velocity))?;
        if self.read(servo::TORQUE_ENABLE)? == 1 {
            self.write(servo::GOAL_POSITION, self.read(servo::PRESENT_POSITION)?)?;
        }
        self.write(servo::TORQUE_ENABLE, 1)?;
        if self.read(servo::TORQUE_ENABLE)? == 0 {
            return Err(InProcessError::Hardware {
                device: self.device,
                bits: self.hardware_error()?,
            });
        }
        self.write(common::BUS_WATCHDOG, super::watchdog_units(self.motion.watchdog))
    }

    async fn steer(&mut self, goal: ArmAngle, profile: Profile) -> Result<(), InProcessError> {
        let [velocity, acceleration] = self.arm.axis.profile_registers(profile);
        self.write(servo::PROFILE_ACCELERATION, i64::from(acceleration))?;
        self.write(servo::PROFILE_VELOCITY, i64::from(velocity))?;
        self.write(servo::GOAL_POSITION, self.counts(goal))
    }

    async fn location(&mut self) -> Result<Location, InProcessError> {
        self.look()
    }

    async fn stop(&mut self) -> Result<(), InProcessError> {
        if self.read(common::BUS_WATCHDOG)? == TRIPPED {
            // It stands already, and takes no goal.
            return Ok(());
        }
        let register = |register| Ok::<_, InProcessError>(self.read(register)? as i32);
        let braking = Braking {
            acceleration: register(servo::PROFILE_ACCELERATION)?,
            goal: register(servo::GOAL_POSITION)?,
            velocity: register(servo::PRESENT_VELOCITY)?,
            position: register(servo::PRESENT_POSITION)?,
            velocity_trajectory: register(servo::VELOCITY_TRAJECTORY)?,
            position_trajectory: register(servo::POSITION_TRAJECTORY)?,
        };
        match braking.rest(&self.arm.axis, self.range, Duration::ZERO) {
            Some(goal) => self.write(servo::GOAL_POSITION, goal.into()),
            None => Ok(()),
        }
    }

    async fn halt(&mut self) -> Result<(), InProcessError> {
        if self.motion.estop == Estop::Limp {
            return self.write(servo::TORQUE_ENABLE, 0);
        }
        self.write(servo::PROFILE_ACCELERATION, 0)?;
        self.write(servo::PROFILE_VELOCITY, 0)?;
        if self.read(common::BUS_WATCHDOG)? == TRIPPED {
            return Ok(());
        }
        self.write(servo::GOAL_POSITION, self.read(servo::PRESENT_POSITION)?)
    }

    async fn disengage(&mut self) -> Result<(), InProcessError> {
        self.write(common::BUS_WATCHDOG, 0)?;
        match self.motion.estop {
            Estop::Limp => self.write(servo::TORQUE_ENABLE, 0),
            Estop::Hold => Ok(()),
        }
    }
}
