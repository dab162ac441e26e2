//! Addresses of the control tables, as typed constants.
//!
//! Servos: ROBOTIS e-manual, XM430-W350 and XM540-W270, "Control Table". Registers are named by where the X series has
//! them; [`Series::at`](super::Series::at) says where another series does.
//! Photometer: docs/photometer.md.

/// One entry of a control table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register {
    /// First address.
    pub address: u16,
    /// Length in bytes: 1, 2 or 4, little endian.
    pub size: u16,
    /// Name in the manual.
    pub name: &'static str,
}

const fn register(address: u16, size: u16, name: &'static str) -> Register {
    Register { address, size, name }
}

/// Model number of the photometer node (docs/photometer.md).
pub const PHOTOMETER_MODEL: u16 = 0x4750;

/// Values of the Baud Rate register and what they mean, bits per second, as far as a rig may use them (e-manual,
/// "Baud Rate(8)"; docs/photometer.md has the same).
pub const BAUD_RATES: [(u8, u32); 8] = [
    (0, 9_600),
    (1, 57_600),
    (2, 115_200),
    (3, 1_000_000),
    (4, 2_000_000),
    (5, 3_000_000),
    (6, 4_000_000),
    (7, 4_500_000),
];

/// Registers that servos and photometer have in common.
pub mod common {
    use super::{Register, register};

    /// Model Number.
    pub const MODEL_NUMBER: Register = register(0, 2, "Model Number");
    /// Firmware Version.
    pub const FIRMWARE_VERSION: Register = register(6, 1, "Firmware Version");
    /// ID; EEPROM.
    pub const ID: Register = register(7, 1, "ID");
    /// Baud Rate, see [`super::BAUD_RATES`]; EEPROM.
    pub const BAUD_RATE: Register = register(8, 1, "Baud Rate");
    /// Return Delay Time, 2 µs; EEPROM.
    pub const RETURN_DELAY_TIME: Register = register(9, 1, "Return Delay Time");
    /// Status Return Level: 0 ping, 1 ping and read, 2 all.
    pub const STATUS_RETURN_LEVEL: Register = register(68, 1, "Status Return Level");
    /// Hardware Error Status, a bit mask.
    pub const HARDWARE_ERROR_STATUS: Register = register(70, 1, "Hardware Error Status");
    /// Bus Watchdog, 20 ms; 0 off, 255 tripped.
    pub const BUS_WATCHDOG: Register = register(98, 1, "Bus Watchdog");
}

/// Control table of the servos, with the units of the X series.
pub mod servo {
    use super::{Register, register};

    /// Drive Mode: bit 0 reverse, bit 1 slave, bit 2 time-based profile, bit 3 torque on by goal; EEPROM.
    pub const DRIVE_MODE: Register = register(10, 1, "Drive Mode");
    /// Operating Mode, 3 is position; EEPROM.
    pub const OPERATING_MODE: Register = register(11, 1, "Operating Mode");
    /// Homing Offset, counts, signed; EEPROM.
    pub const HOMING_OFFSET: Register = register(20, 4, "Homing Offset");
    /// Acceleration Limit; EEPROM. Not every model has it.
    pub const ACCELERATION_LIMIT: Register = register(40, 4, "Acceleration Limit");
    /// Velocity Limit, 0.229 rpm; EEPROM.
    pub const VELOCITY_LIMIT: Register = register(44, 4, "Velocity Limit");
    /// Max Position Limit, counts; EEPROM.
    pub const MAX_POSITION_LIMIT: Register = register(48, 4, "Max Position Limit");
    /// Min Position Limit, counts; EEPROM.
    pub const MIN_POSITION_LIMIT: Register = register(52, 4, "Min Position Limit");
    /// Startup Configuration: bit 0 torque on at boot; EEPROM.
    pub const STARTUP_CONFIGURATION: Register = register(60, 1, "Startup Configuration");
    /// Shutdown mask, bits as Hardware Error Status; EEPROM.
    pub const SHUTDOWN: Register = register(63, 1, "Shutdown");
    /// Torque Enable; 1 locks the EEPROM.
    pub const TORQUE_ENABLE: Register = register(64, 1, "Torque Enable");
    /// Profile Acceleration, 214.577 rev/min²; 0 infinite.
    pub const PROFILE_ACCELERATION: Register = register(108, 4, "Profile Acceleration");
    /// Profile Velocity, 0.229 rpm; 0: no profile at all.
    pub const PROFILE_VELOCITY: Register = register(112, 4, "Profile Velocity");
    /// Goal Position, counts.
    pub const GOAL_POSITION: Register = register(116, 4, "Goal Position");
    /// Moving: 1 while a profile is in progress or the speed is above the threshold.
    pub const MOVING: Register = register(122, 1, "Moving");
    /// Moving Status: bit 0 in position, bit 1 profile ongoing, bit 3 following error.
    pub const MOVING_STATUS: Register = register(123, 1, "Moving Status");
    /// Present Velocity, 0.229 rpm, signed.
    pub const PRESENT_VELOCITY: Register = register(128, 4, "Present Velocity");
    /// Present Position, counts, signed.
    pub const PRESENT_POSITION: Register = register(132, 4, "Present Position");
    /// Velocity Trajectory: the speed that the profile has now, 0.229 rpm, signed.
    pub const VELOCITY_TRAJECTORY: Register = register(136, 4, "Velocity Trajectory");
    /// Position Trajectory: where the profile is now, counts, signed.
    pub const POSITION_TRAJECTORY: Register = register(140, 4, "Position Trajectory");
    /// Present Input Voltage, 0.1 V.
    pub const PRESENT_INPUT_VOLTAGE: Register = register(144, 2, "Present Input Voltage");
    /// Present Temperature, °C.
    pub const PRESENT_TEMPERATURE: Register = register(146, 1, "Present Temperature");
}

/// Control table of the photometer node (docs/photometer.md).
pub mod photometer {
    use super::{Register, register};

    /// Lamp Enable.
    pub const LAMP_ENABLE: Register = register(64, 1, "Lamp Enable");
    /// Integration Time, µs.
    pub const INTEGRATION_TIME: Register = register(104, 4, "Integration Time");
    /// Gain Step: 0 ×1, 1 ×16, 2 ×256.
    pub const GAIN_STEP: Register = register(108, 1, "Gain Step");
    /// Trigger.
    pub const TRIGGER: Register = register(109, 1, "Trigger");
    /// Status: 0 idle, 1 integrating, 2 ready, 3 ready and saturated.
    pub const STATUS: Register = register(120, 1, "Status");
    /// Gain Step of the reading.
    pub const READING_GAIN_STEP: Register = register(121, 1, "Reading: Gain Step");
    /// Sequence Number of the reading, 24 bits.
    pub const READING_SEQUENCE: Register = register(124, 4, "Reading: Sequence Number");
    /// Integration Time of the reading, µs.
    pub const READING_INTEGRATION_TIME: Register = register(128, 4, "Reading: Integration Time");
    /// Red counts, 24 bits; green, blue and monitor follow.
    pub const READING_RED: Register = register(132, 4, "Reading: Red");
    /// Green counts.
    pub const READING_GREEN: Register = register(136, 4, "Reading: Green");
    /// Blue counts.
    pub const READING_BLUE: Register = register(140, 4, "Reading: Blue");
    /// Lamp monitor counts.
    pub const READING_MONITOR: Register = register(144, 4, "Reading: Monitor");
    /// Device time at mid-integration, 10 µs, 24 bits.
    pub const READING_TIME: Register = register(148, 4, "Reading: Device Time");
    /// Temperature, °C.
    pub const TEMPERATURE: Register = register(152, 1, "Temperature");
    /// Door contact: 1 open.
    pub const DOOR: Register = register(153, 1, "Door");
    /// Device time now, 10 µs, 24 bits.
    pub const PRESENT_TIME: Register = register(156, 4, "Present Time");
    /// Clock: 0 real, 1 simulated wire time.
    pub const CLOCK: Register = register(200, 1, "Clock");
    /// Delay, µs; only where Clock reads 1.
    pub const DELAY: Register = register(204, 4, "Delay");
}
