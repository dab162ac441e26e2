use std::time::Duration;

use crate::Refusal;
use crate::fault::Schedule;
use crate::table::{Access, Register, Table};

/// Registers that every device has at the same addresses (X-series e-manual; docs/photometer.md). What they are set to
/// initially, and what is allowed, stands in each device's own table.
const ID: Register = Register::new(7, 1, Access::Eeprom, 0, (0, 252));
const BAUD: Register = Register::new(8, 1, Access::Eeprom, 0, (0, 7));
const RETURN_DELAY: Register = Register::new(9, 1, Access::Eeprom, 0, (0, 254));
const STATUS_RETURN_LEVEL: Register = Register::new(68, 1, Access::Ram, 0, (0, 2));
const HARDWARE_ERROR: Register = Register::new(70, 1, Access::Read, 0, (0, 255));
const BUS_WATCHDOG: Register = Register::new(98, 1, Access::Ram, 0, (0, 127));

/// Unit of Return Delay Time.
const RETURN_DELAY_UNIT: Duration = Duration::from_micros(2);
/// Unit of Bus Watchdog.
const WATCHDOG_UNIT: Duration = Duration::from_millis(20);
/// Value of Bus Watchdog once it has tripped.
const TRIPPED: i64 = 0xFF;

/// What all devices on the bus have in common: a control table, whether they hear, and what befalls them when.
#[derive(Debug)]
pub(crate) struct Node {
    pub(crate) table: Table,
    pub(crate) now: Duration,
    pub(crate) faults: Schedule,
    /// When the bus watchdog was fed last.
    heard: Duration,
    deaf_until: Duration,
    silent_until: Duration,
}

impl Node {
    /// With its table as it leaves the workshop, at time 0.
    pub(crate) fn new(mut table: Table, id: u8, baud_code: u8) -> Self {
        table.set(ID, id.into());
        table.set(BAUD, baud_code.into());
        Self {
            table,
            now: Duration::ZERO,
            faults: Schedule::default(),
            heard: Duration::ZERO,
            deaf_until: Duration::ZERO,
            silent_until: Duration::ZERO,
        }
    }

    pub(crate) fn id(&self) -> u8 {
        self.table.get(ID) as u8
    }

    /// It answers under this id from now on.
    pub(crate) fn rename(&mut self, id: u8) {
        self.table.set(ID, id.into());
    }

    /// Bits per second.
    pub(crate) fn baud(&self) -> u32 {
        crate::baud::rate(self.table.get(BAUD) as u8)
    }

    pub(crate) fn return_delay(&self) -> Duration {
        RETURN_DELAY_UNIT * self.table.get(RETURN_DELAY) as u32
    }

    pub(crate) fn status_return_level(&self) -> u8 {
        self.table.get(STATUS_RETURN_LEVEL) as u8
    }

    /// Whether it has a hardware error.
    pub(crate) fn alert(&self) -> bool {
        self.table.get(HARDWARE_ERROR) != 0
    }

    /// Adds bits to its hardware errors.
    pub(crate) fn fail(&mut self, bits: u8) {
        let bits = self.table.get(HARDWARE_ERROR) | i64::from(bits);
        self.table.set(HARDWARE_ERROR, bits);
    }

    pub(crate) fn listens(&self) -> bool {
        self.now >= self.deaf_until && self.now >= self.silent_until
    }

    /// Feeds the bus watchdog.
    pub(crate) fn hear(&mut self) {
        self.heard = self.now;
    }

    /// It says nothing for so long.
    pub(crate) fn silence(&mut self, duration: Duration) {
        self.silent_until = self.now + duration;
    }

    /// It hears nothing while it boots.
    pub(crate) fn boot(&mut self, duration: Duration) {
        self.deaf_until = self.now + duration;
    }

    /// When it hears again.
    pub(crate) fn wakes(&self) -> [Duration; 2] {
        [self.deaf_until, self.silent_until]
    }

    /// When the bus watchdog will trip, where the device is on and it is set.
    pub(crate) fn watchdog(&self, on: bool) -> Option<Duration> {
        let units = self.table.get(BUS_WATCHDOG);
        let armed = on && units != 0 && !self.tripped();
        armed.then(|| self.heard + WATCHDOG_UNIT * u32::try_from(units).expect("at most 127"))
    }

    pub(crate) fn trip(&mut self) {
        self.table.set(BUS_WATCHDOG, TRIPPED);
    }

    pub(crate) fn tripped(&self) -> bool {
        self.table.get(BUS_WATCHDOG) == TRIPPED
    }

    /// Puts the table back to its initial values, but for what the option keeps (e-manual, "Factory Reset").
    pub(crate) fn factory_reset(&mut self, option: u8) -> Result<(), Refusal> {
        let kept: &[Register] = match option {
            0xFF => &[],
            1 => &[ID],
            2 => &[ID, BAUD],
            _ => return Err(Refusal::DataRange),
        };
        self.table
            .reset(|register| !kept.iter().any(|kept| kept.address == register.address));
        Ok(())
    }

    /// What a reboot keeps of the table is its EEPROM.
    pub(crate) fn forget_ram(&mut self) {
        self.table.reset(|register| register.access != Access::Eeprom);
    }
}
