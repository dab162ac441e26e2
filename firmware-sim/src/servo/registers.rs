//! Control table of the servos, named by where the X series has its registers (ROBOTIS e-manual, "Control Table of
//! EEPROM/RAM Area"); what differs between models and series is in their table.

use rig::dynamixel::{Indirect, Model, Series};

use crate::table::Access::{Eeprom, Ram, Read};
use crate::table::Register;

/// Largest value of a register of 4 bytes that is not otherwise limited.
const ANY_U32: (i64, i64) = (0, u32::MAX as i64);
/// Filled in from the model.
const BY_MODEL: (i64, i64) = (0, 0);
/// Signed, so that a register with a range of its model's is decoded as such.
const SIGNED_16: (i64, i64) = (i16::MIN as i64, i16::MAX as i64);
const SIGNED_32: (i64, i64) = (i32::MIN as i64, i32::MAX as i64);
const ANY_U16: (i64, i64) = (0, u16::MAX as i64);

pub(super) const MODEL_NUMBER: Register = Register::new(0, 2, Read, 0, ANY_U16);
pub(super) const MODEL_INFORMATION: Register = Register::new(2, 4, Read, 0, ANY_U32);
pub(super) const FIRMWARE: Register = Register::new(6, 1, Read, 0, (0, 255));
pub(super) const ID: Register = Register::new(7, 1, Eeprom, 1, (0, 252));
pub(super) const BAUD: Register = Register::new(8, 1, Eeprom, 1, BY_MODEL);
pub(super) const RETURN_DELAY: Register = Register::new(9, 1, Eeprom, 250, (0, 254));
pub(super) const DRIVE_MODE: Register = Register::new(10, 1, Eeprom, 0, (0, 15));
pub(super) const OPERATING_MODE: Register = Register::new(11, 1, Eeprom, 3, (0, 16));
pub(super) const SECONDARY_ID: Register = Register::new(12, 1, Eeprom, 255, (0, 255));
/// Largest secondary id; beyond, the servo belongs to no group.
pub(super) const SECONDARY_ID_MAX: u8 = 252;
pub(super) const PROTOCOL: Register = Register::new(13, 1, Eeprom, 2, (2, 2));
pub(super) const HOMING_OFFSET: Register = Register::new(20, 4, Eeprom, 0, SIGNED_32);
pub(super) const MOVING_THRESHOLD: Register = Register::new(24, 4, Eeprom, 10, BY_MODEL);
pub(super) const TEMPERATURE_LIMIT: Register = Register::new(31, 1, Eeprom, 0, (0, 100));
pub(super) const MAX_VOLTAGE: Register = Register::new(32, 2, Eeprom, 0, BY_MODEL);
pub(super) const MIN_VOLTAGE: Register = Register::new(34, 2, Eeprom, 0, BY_MODEL);
pub(super) const PWM_LIMIT: Register = Register::new(36, 2, Eeprom, 0, BY_MODEL);
pub(super) const CURRENT_LIMIT: Register = Register::new(38, 2, Eeprom, 0, BY_MODEL);
pub(super) const ACCELERATION_LIMIT: Register = Register::new(40, 4, Eeprom, 0, BY_MODEL);
pub(super) const VELOCITY_LIMIT: Register = Register::new(44, 4, Eeprom, 0, BY_MODEL);
pub(super) const MAX_POSITION: Register = Register::new(48, 4, Eeprom, 0, SIGNED_32);
pub(super) const MIN_POSITION: Register = Register::new(52, 4, Eeprom, 0, SIGNED_32);
pub(super) const STARTUP: Register = Register::new(60, 1, Eeprom, 0, (0, 3));
pub(super) const SHUTDOWN: Register = Register::new(63, 1, Eeprom, 0, (0, 63));

pub(super) const TORQUE_ENABLE: Register = Register::new(64, 1, Ram, 0, (0, 1));
pub(super) const STATUS_RETURN_LEVEL: Register = Register::new(68, 1, Ram, 2, (0, 2));
pub(super) const REGISTERED_INSTRUCTION: Register = Register::new(69, 1, Read, 0, (0, 1));
pub(super) const HARDWARE_ERROR: Register = Register::new(70, 1, Read, 0, (0, 255));
pub(super) const POSITION_I_GAIN: Register = Register::new(82, 2, Ram, 0, BY_MODEL);
pub(super) const POSITION_P_GAIN: Register = Register::new(84, 2, Ram, 0, BY_MODEL);
/// Velocity I and P, position D, I and P gain. Of the gains position P and I have an effect.
const GAINS: [Register; 5] = [
    Register::new(76, 2, Ram, 0, BY_MODEL),
    Register::new(78, 2, Ram, 0, BY_MODEL),
    Register::new(80, 2, Ram, 0, BY_MODEL),
    POSITION_I_GAIN,
    POSITION_P_GAIN,
];
/// Feedforward 2nd and 1st gain.
const FEEDFORWARD: [Register; 2] = [
    Register::new(88, 2, Ram, 0, BY_MODEL),
    Register::new(90, 2, Ram, 0, BY_MODEL),
];
pub(super) const BUS_WATCHDOG: Register = Register::new(98, 1, Ram, 0, (0, 127));
pub(super) const GOAL_PWM: Register = Register::new(100, 2, Ram, 0, SIGNED_16);
pub(super) const GOAL_CURRENT: Register = Register::new(102, 2, Ram, 0, SIGNED_16);
pub(super) const GOAL_VELOCITY: Register = Register::new(104, 4, Ram, 0, SIGNED_32);
pub(super) const PROFILE_ACCELERATION: Register = Register::new(108, 4, Ram, 0, BY_MODEL);
pub(super) const PROFILE_VELOCITY: Register = Register::new(112, 4, Ram, 0, BY_MODEL);
pub(super) const GOAL_POSITION: Register = Register::new(116, 4, Ram, 0, SIGNED_32);

pub(super) const REALTIME_TICK: Register = Register::live(120, 2);
pub(super) const MOVING: Register = Register::live(122, 1);
pub(super) const MOVING_STATUS: Register = Register::live(123, 1);
pub(super) const PRESENT_PWM: Register = Register::live(124, 2);
pub(super) const PRESENT_CURRENT: Register = Register::live(126, 2);
pub(super) const PRESENT_VELOCITY: Register = Register::live(128, 4);
pub(super) const PRESENT_POSITION: Register = Register::live(132, 4);
pub(super) const VELOCITY_TRAJECTORY: Register = Register::live(136, 4);
pub(super) const POSITION_TRAJECTORY: Register = Register::live(140, 4);
pub(super) const PRESENT_VOLTAGE: Register = Register::live(144, 2);
pub(super) const PRESENT_TEMPERATURE: Register = Register::live(146, 1);

/// The goals: what a tripped bus watchdog makes read-only (e-manual, "Bus Watchdog").
pub(super) const GOALS: [Register; 4] = [GOAL_PWM, GOAL_CURRENT, GOAL_VELOCITY, GOAL_POSITION];

/// What every model has.
const COMMON: [Register; 38] = [
    MODEL_NUMBER,
    MODEL_INFORMATION,
    FIRMWARE,
    ID,
    BAUD,
    RETURN_DELAY,
    DRIVE_MODE,
    OPERATING_MODE,
    SECONDARY_ID,
    PROTOCOL,
    HOMING_OFFSET,
    MOVING_THRESHOLD,
    TEMPERATURE_LIMIT,
    MAX_VOLTAGE,
    MIN_VOLTAGE,
    PWM_LIMIT,
    VELOCITY_LIMIT,
    MAX_POSITION,
    MIN_POSITION,
    SHUTDOWN,
    TORQUE_ENABLE,
    STATUS_RETURN_LEVEL,
    REGISTERED_INSTRUCTION,
    HARDWARE_ERROR,
    BUS_WATCHDOG,
    GOAL_PWM,
    GOAL_VELOCITY,
    PROFILE_ACCELERATION,
    PROFILE_VELOCITY,
    GOAL_POSITION,
    REALTIME_TICK,
    MOVING,
    MOVING_STATUS,
    PRESENT_PWM,
    PRESENT_CURRENT,
    PRESENT_VELOCITY,
    PRESENT_POSITION,
    VELOCITY_TRAJECTORY,
];

/// First LED; the others follow.
const LED: u16 = 65;
/// First External Port Mode, and first External Port Data; the others follow.
const PORT_MODE: u16 = 56;
const PORT_DATA: u16 = 152;
/// Homing offsets beyond are refused by the X series (e-manual, "Homing Offset(20)").
const HOMING_MAX: i64 = 1_044_479;

/// The registers of a model with their initial values.
pub(super) fn registers(model: &Model) -> Vec<Register> {
    let series = model.series;
    let mut registers: Vec<Register> = COMMON
        .into_iter()
        .chain([POSITION_TRAJECTORY, PRESENT_VOLTAGE, PRESENT_TEMPERATURE])
        .map(|register| of_model(register, model))
        .collect();
    let gains = GAINS.into_iter().zip(model.gains);
    let feedforward = FEEDFORWARD.into_iter().map(|register| (register, 0));
    registers.extend(gains.chain(feedforward).map(|(register, initial)| Register {
        initial: initial.into(),
        range: (0, series.gain_max.into()),
        ..register
    }));
    if let Some(limit) = model.current_limit.map(i64::from) {
        registers.push(Register {
            initial: limit,
            range: (0, limit),
            ..CURRENT_LIMIT
        });
        // Beyond its limit a goal is refused as such, and not as one that no servo takes.
        registers.push(Register {
            initial: limit,
            ..GOAL_CURRENT
        });
    }
    if let Some(limit) = model.acceleration_limit {
        registers.push(Register {
            initial: limit.into(),
            range: (0, model.acceleration_max.into()),
            ..ACCELERATION_LIMIT
        });
    }
    if series.startup {
        registers.push(STARTUP);
    }
    registers.extend(series.backup_ready.map(backup_ready));
    // RGB LEDs have a brightness, a single one is on or off.
    let bright = if model.leds == 1 { 1 } else { 255 };
    registers.extend((0..model.leds).map(|i| Register::new(LED + i, 1, Ram, 0, (0, bright))));
    for i in 0..model.external_ports {
        registers.push(Register::new(PORT_MODE + i, 1, Eeprom, 3, (0, 3)));
        registers.push(Register::new(PORT_DATA + 2 * i, 2, Ram, 0, (0, 4095)));
    }
    for area in series.indirect {
        for i in 0..area.cells {
            registers.push(Register {
                initial: i64::from(area.data + i),
                ..indirect_address(series, area, i)
            });
            registers.push(Register::new(area.data + i, 1, Ram, 0, (0, 255)));
        }
    }
    registers
}

/// A register with what its model says of it.
fn of_model(register: Register, model: &Model) -> Register {
    let series = model.series;
    let (first, last) = model.positions().into_inner();
    let [min_voltage, max_voltage] = model.voltage_limits.map(i64::from);
    let [min_position, max_position] = model.position_limits.map(i64::from);
    let voltages = (model.voltage_least.into(), max_voltage);
    let positions = (first.into(), last.into());
    let velocity = i64::from(model.velocity_limit);
    let pwm = i64::from(series.pwm_limit);
    let with = |initial: i64, range: (i64, i64)| Register {
        initial,
        range,
        ..register
    };
    match register {
        MODEL_NUMBER => with(model.number.into(), register.range),
        FIRMWARE => with(series.firmware.into(), register.range),
        BAUD => with(1, (0, series.baud_code_max.into())),
        HOMING_OFFSET if !series.centred => with(0, (-HOMING_MAX, HOMING_MAX)),
        MOVING_THRESHOLD => {
            let [initial, most] = series.moving_threshold;
            with(initial.into(), (0, most.min(model.velocity_max).into()))
        }
        TEMPERATURE_LIMIT => with(model.temperature_limit_c.into(), register.range),
        MAX_VOLTAGE => with(max_voltage, voltages),
        MIN_VOLTAGE => with(min_voltage, voltages),
        PWM_LIMIT => with(pwm, (0, pwm)),
        GOAL_PWM => with(pwm, (-pwm, pwm)),
        VELOCITY_LIMIT => with(velocity, (0, model.velocity_max.into())),
        GOAL_VELOCITY => with(
            velocity,
            (-i64::from(model.velocity_max), model.velocity_max.into()),
        ),
        MAX_POSITION => with(max_position, positions),
        MIN_POSITION => with(min_position, positions),
        SHUTDOWN => with(model.shutdown.into(), register.range),
        PROFILE_ACCELERATION => with(0, (0, model.acceleration_max.into())),
        PROFILE_VELOCITY => with(0, (0, series.profile_velocity_max.into())),
        GOAL_POSITION => with(0, (-i64::from(series.multi_turn), series.multi_turn.into())),
        _ => register,
    }
}

/// Backup Ready at its address.
pub(super) fn backup_ready(address: u16) -> Register {
    Register::new(address, 1, Read, 0, (0, 1))
}

/// An indirect address with its initial value left out.
fn indirect_address(series: &Series, area: &Indirect, cell: u16) -> Register {
    let access = if series.indirect_in_eeprom { Eeprom } else { Ram };
    let [first, last] = series.indirect_targets.map(i64::from);
    Register::new(area.addresses + 2 * cell, 2, access, 0, (first, last))
}

/// The address register that says where a data cell leads; `None` for any other address.
pub(super) fn indirect(series: &Series, address: u16) -> Option<Register> {
    series
        .indirect
        .iter()
        .find(|area| (area.data..area.data + area.cells).contains(&address))
        .map(|area| indirect_address(series, area, address - area.data))
}
