//! Control table of the X series, XM430/XM540/XH540 (ROBOTIS e-manual, "Control Table of EEPROM/RAM Area").

use super::Model;
use crate::table::Access::{Eeprom, Ram, Read};
use crate::table::Register;

/// Goal positions beyond one turn (modes 4 and 5).
pub(super) const MULTI_TURN: i64 = 1_048_575;
/// Bytes that indirect addressing offers in each of its two areas.
const INDIRECT: u16 = 28;

const ANY_U16: (i64, i64) = (0, u16::MAX as i64);
const GAIN: (i64, i64) = (0, 16_383);

pub(super) const MODEL_NUMBER: Register = Register::new(0, 2, Read, 0, ANY_U16);
pub(super) const MODEL_INFORMATION: Register = Register::new(2, 4, Read, 0, (0, u32::MAX as i64));
pub(super) const FIRMWARE: Register = Register::new(6, 1, Read, 0, (0, 255));
pub(super) const ID: Register = Register::new(7, 1, Eeprom, 1, (0, 252));
pub(super) const BAUD: Register = Register::new(8, 1, Eeprom, 1, (0, 7));
pub(super) const RETURN_DELAY: Register = Register::new(9, 1, Eeprom, 250, (0, 254));
pub(super) const DRIVE_MODE: Register = Register::new(10, 1, Eeprom, 0, (0, 15));
pub(super) const OPERATING_MODE: Register = Register::new(11, 1, Eeprom, 3, (0, 16));
pub(super) const SECONDARY_ID: Register = Register::new(12, 1, Eeprom, 255, (0, 255));
pub(super) const PROTOCOL: Register = Register::new(13, 1, Eeprom, 2, (2, 2));
pub(super) const HOMING_OFFSET: Register = Register::new(20, 4, Eeprom, 0, (-1_044_479, 1_044_479));
pub(super) const MOVING_THRESHOLD: Register = Register::new(24, 4, Eeprom, 10, (0, 1023));
pub(super) const TEMPERATURE_LIMIT: Register = Register::new(31, 1, Eeprom, 80, (0, 100));
pub(super) const MAX_VOLTAGE: Register = Register::new(32, 2, Eeprom, 160, (95, 160));
pub(super) const MIN_VOLTAGE: Register = Register::new(34, 2, Eeprom, 95, (95, 160));
pub(super) const PWM_LIMIT: Register = Register::new(36, 2, Eeprom, 885, (0, 885));
pub(super) const CURRENT_LIMIT: Register = Register::new(38, 2, Eeprom, 0, (0, 2047));
pub(super) const VELOCITY_LIMIT: Register = Register::new(44, 4, Eeprom, 0, (0, 1023));
pub(super) const MAX_POSITION: Register = Register::new(48, 4, Eeprom, 4095, (0, 4095));
pub(super) const MIN_POSITION: Register = Register::new(52, 4, Eeprom, 0, (0, 4095));
pub(super) const STARTUP: Register = Register::new(60, 1, Eeprom, 0, (0, 3));
pub(super) const SHUTDOWN: Register = Register::new(63, 1, Eeprom, 52, (0, 63));

pub(super) const TORQUE_ENABLE: Register = Register::new(64, 1, Ram, 0, (0, 1));
pub(super) const LED: Register = Register::new(65, 1, Ram, 0, (0, 1));
pub(super) const STATUS_RETURN_LEVEL: Register = Register::new(68, 1, Ram, 2, (0, 2));
pub(super) const REGISTERED_INSTRUCTION: Register = Register::new(69, 1, Read, 0, (0, 1));
pub(super) const HARDWARE_ERROR: Register = Register::new(70, 1, Read, 0, (0, 255));
pub(super) const POSITION_I_GAIN: Register = Register::new(82, 2, Ram, 0, GAIN);
pub(super) const POSITION_P_GAIN: Register = Register::new(84, 2, Ram, 800, GAIN);
pub(super) const BUS_WATCHDOG: Register = Register::new(98, 1, Ram, 0, (0, 127));
pub(super) const GOAL_PWM: Register = Register::new(100, 2, Ram, 885, (-885, 885));
pub(super) const GOAL_CURRENT: Register = Register::new(102, 2, Ram, 0, (-2047, 2047));
pub(super) const GOAL_VELOCITY: Register = Register::new(104, 4, Ram, 0, (-1023, 1023));
pub(super) const PROFILE_ACCELERATION: Register = Register::new(108, 4, Ram, 0, (0, 32_767));
pub(super) const PROFILE_VELOCITY: Register = Register::new(112, 4, Ram, 0, (0, 32_767));
pub(super) const GOAL_POSITION: Register = Register::new(116, 4, Ram, 0, (-MULTI_TURN, MULTI_TURN));

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
pub(super) const BACKUP_READY: Register = Register::live(147, 1);

/// The goals: what a tripped bus watchdog makes read-only (e-manual, "Bus Watchdog").
pub(super) const GOALS: [Register; 4] = [GOAL_PWM, GOAL_CURRENT, GOAL_VELOCITY, GOAL_POSITION];

const COMMON: [Register; 53] = [
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
    CURRENT_LIMIT,
    VELOCITY_LIMIT,
    MAX_POSITION,
    MIN_POSITION,
    STARTUP,
    SHUTDOWN,
    TORQUE_ENABLE,
    LED,
    STATUS_RETURN_LEVEL,
    REGISTERED_INSTRUCTION,
    HARDWARE_ERROR,
    Register::new(76, 2, Ram, 1920, GAIN),
    Register::new(78, 2, Ram, 100, GAIN),
    Register::new(80, 2, Ram, 0, GAIN),
    POSITION_I_GAIN,
    POSITION_P_GAIN,
    Register::new(88, 2, Ram, 0, GAIN),
    Register::new(90, 2, Ram, 0, GAIN),
    BUS_WATCHDOG,
    GOAL_PWM,
    GOAL_CURRENT,
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
    POSITION_TRAJECTORY,
    PRESENT_VOLTAGE,
    PRESENT_TEMPERATURE,
    BACKUP_READY,
];

/// The two indirect areas: first address register, first data cell (e-manual, "Indirect Address", "Indirect Data").
const INDIRECT_AREAS: [(u16, u16); 2] = [(168, 224), (578, 634)];

/// The registers of a model with their initial values.
pub(super) fn registers(model: &Model) -> Vec<Register> {
    let mut registers: Vec<Register> = COMMON
        .into_iter()
        .map(|register| match register {
            MODEL_NUMBER => Register {
                initial: i64::from(model.number),
                ..register
            },
            FIRMWARE => Register {
                initial: i64::from(super::FIRMWARE_VERSION),
                ..register
            },
            CURRENT_LIMIT => Register {
                initial: model.current_limit,
                range: (0, model.current_limit),
                ..register
            },
            GOAL_CURRENT => Register {
                initial: model.current_limit,
                ..register
            },
            VELOCITY_LIMIT => Register {
                initial: model.velocity_limit,
                ..register
            },
            GOAL_VELOCITY => Register {
                initial: model.velocity_limit,
                ..register
            },
            _ => register,
        })
        .collect();
    if model.external_ports {
        registers.extend((56..=58).map(|address| Register::new(address, 1, Eeprom, 3, (0, 3))));
        registers.extend(
            (152..=156)
                .step_by(2)
                .map(|address| Register::new(address, 2, Ram, 0, (0, 4095))),
        );
    }
    for (addresses, data) in INDIRECT_AREAS {
        for i in 0..INDIRECT {
            let target = i64::from(data + i);
            registers.push(Register::new(addresses + 2 * i, 2, Ram, target, (64, 661)));
            registers.push(Register::new(data + i, 1, Ram, 0, (0, 255)));
        }
    }
    registers
}

/// The address register that says where a data cell leads; `None` for any other address.
pub(super) fn indirect(address: u16) -> Option<Register> {
    INDIRECT_AREAS
        .into_iter()
        .find(|&(_, data)| (data..data + INDIRECT).contains(&address))
        .map(|(addresses, data)| Register::new(addresses + 2 * (address - data), 2, Ram, 0, (64, 661)))
}
