//! Control table of the photometer node (docs/photometer.md).

use crate::table::Access::{Eeprom, Ram, Read, Write};
use crate::table::Register;

/// Counts, times and sequence numbers have 24 bits.
pub(super) const MODULUS: u64 = 1 << 24;
const COUNTS: (i64, i64) = (0, MODULUS as i64 - 1);

pub(super) const MODEL_NUMBER: Register = Register::new(0, 2, Read, 0x4750, (0, 65_535));
pub(super) const FIRMWARE: Register = Register::new(6, 1, Read, 1, (0, 255));
pub(super) const ID: Register = Register::new(7, 1, Eeprom, 3, (0, 252));
pub(super) const BAUD: Register = Register::new(8, 1, Eeprom, 3, (0, 7));
pub(super) const RETURN_DELAY: Register = Register::new(9, 1, Eeprom, 0, (0, 254));
pub(super) const LAMP_ENABLE: Register = Register::new(64, 1, Ram, 0, (0, 1));
pub(super) const STATUS_RETURN_LEVEL: Register = Register::new(68, 1, Ram, 2, (0, 2));
pub(super) const HARDWARE_ERROR: Register = Register::new(70, 1, Read, 0, (0, 255));
pub(super) const BUS_WATCHDOG: Register = Register::new(98, 1, Ram, 0, (0, 127));
pub(super) const INTEGRATION_TIME: Register = Register::new(104, 4, Ram, 1000, (10, 10_000_000));
pub(super) const GAIN_STEP: Register = Register::new(108, 1, Ram, 0, (0, 2));
pub(super) const TRIGGER: Register = Register::new(109, 1, Write, 0, (0, 1));
pub(super) const STATUS: Register = Register::new(120, 1, Read, 0, (0, 3));
pub(super) const READING_GAIN: Register = Register::new(121, 1, Read, 0, (0, 2));
pub(super) const SEQUENCE: Register = Register::new(124, 4, Read, 0, COUNTS);
pub(super) const READING_INTEGRATION: Register = Register::new(128, 4, Read, 0, (0, 10_000_000));
pub(super) const RED: Register = Register::new(132, 4, Read, 0, COUNTS);
pub(super) const GREEN: Register = Register::new(136, 4, Read, 0, COUNTS);
pub(super) const BLUE: Register = Register::new(140, 4, Read, 0, COUNTS);
pub(super) const MONITOR: Register = Register::new(144, 4, Read, 0, COUNTS);
pub(super) const DEVICE_TIME: Register = Register::new(148, 4, Read, 0, COUNTS);
pub(super) const TEMPERATURE: Register = Register::new(152, 1, Read, 25, (0, 255));
pub(super) const DOOR: Register = Register::new(153, 1, Read, 0, (0, 1));
pub(super) const PRESENT_TIME: Register = Register::new(156, 4, Read, 0, COUNTS);
pub(super) const CLOCK: Register = Register::new(200, 1, Read, 0, (0, 1));
pub(super) const DELAY: Register = Register::new(204, 4, Write, 0, (0, 10_000_000));

/// All of them.
pub(super) const REGISTERS: [Register; 26] = [
    MODEL_NUMBER,
    FIRMWARE,
    ID,
    BAUD,
    RETURN_DELAY,
    LAMP_ENABLE,
    STATUS_RETURN_LEVEL,
    HARDWARE_ERROR,
    BUS_WATCHDOG,
    INTEGRATION_TIME,
    GAIN_STEP,
    TRIGGER,
    STATUS,
    READING_GAIN,
    SEQUENCE,
    READING_INTEGRATION,
    RED,
    GREEN,
    BLUE,
    MONITOR,
    DEVICE_TIME,
    TEMPERATURE,
    DOOR,
    PRESENT_TIME,
    CLOCK,
    DELAY,
];
