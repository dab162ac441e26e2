//! What the wire sees of a servo (e-manual, "Control Table", "Bus Watchdog"; Protocol 2.0, instructions).

use std::time::Duration;

use super::{Servo, reg};
use crate::table::{Access, Register};
use crate::{Device, Refusal};

/// Parameters of Clear that reset the turns of the present position.
const CLEAR_TURNS: [u8; 5] = [0x01, 0x44, 0x58, 0x4C, 0x22];

/// Parameters of Control Table Backup: what to do, and what keeps it from being done by mistake ("CTRL").
const BACKUP_STORE: u8 = 1;
const BACKUP_RESTORE: u8 = 2;
const BACKUP_KEY: [u8; 4] = *b"CTRL";

impl Device for Servo {
    fn id(&self) -> u8 {
        self.node.id()
    }

    fn baud(&self) -> u32 {
        self.node.baud()
    }

    fn place(&self, address: u16) -> u16 {
        self.node.table.place(address)
    }

    fn return_delay(&self) -> Duration {
        self.node.return_delay()
    }

    fn status_return_level(&self) -> u8 {
        self.node.status_return_level()
    }

    fn alert(&self) -> bool {
        self.node.alert()
    }

    fn listens(&self) -> bool {
        self.node.listens()
    }

    fn heard(&mut self) {
        self.node.hear();
    }

    fn secondary_id(&self) -> Option<u8> {
        let id = self.node.table.get(reg::SECONDARY_ID) as u8;
        (id <= reg::SECONDARY_ID_MAX).then_some(id)
    }

    fn write_to_group(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal> {
        let values = self.values(address, bytes)?;
        if values
            .iter()
            .any(|(register, _)| register.access == Access::Eeprom)
        {
            return Err(Refusal::Access);
        }
        self.take(values)
    }

    fn back_up(&mut self, parameters: &[u8]) -> Result<(), Refusal> {
        if self.fitting.model.series.backup_ready.is_none() {
            return Err(Refusal::Instruction);
        }
        match parameters.split_first_chunk::<1>() {
            Some(([BACKUP_STORE], key)) if key == BACKUP_KEY => {
                self.backup = Some(self.node.table.clone());
            }
            Some(([BACKUP_RESTORE], key)) if key == BACKUP_KEY && self.torque() => {
                return Err(Refusal::Access);
            }
            Some(([BACKUP_RESTORE], key)) if key == BACKUP_KEY => {
                let backup = self.backup.take().ok_or(Refusal::Result)?;
                self.node.table.restore(&backup);
                self.backup = Some(backup);
                self.remap();
            }
            _ => return Err(Refusal::DataRange),
        }
        Ok(())
    }

    fn read(&self, address: u16, length: u16) -> Result<Vec<u8>, Refusal> {
        self.node.table.check_stretch(address, usize::from(length))?;
        let mut live = self.live();
        if let Some(ready) = self.fitting.model.series.backup_ready.map(reg::backup_ready) {
            live.set(ready, i64::from(self.backup.is_some()));
        }
        Ok((address..address + length)
            .map(|address| live.byte(self.target(address)))
            .collect())
    }

    fn write(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal> {
        let values = self.values(address, bytes)?;
        self.take(values)
    }

    fn registered(&mut self, waits: bool) {
        self.node.table.set(reg::REGISTERED_INSTRUCTION, i64::from(waits));
    }

    fn reboot(&mut self) {
        self.node.forget_ram();
        self.node.boot(self.fitting.boot);
        self.start_up();
    }

    fn clear(&mut self, parameters: &[u8]) -> Result<(), Refusal> {
        if parameters != CLEAR_TURNS {
            return Err(Refusal::DataRange);
        }
        if self.moves() {
            return Err(Refusal::Result);
        }
        self.lose_turns();
        self.stand();
        Ok(())
    }

    fn factory_reset(&mut self, option: u8) -> Result<(), Refusal> {
        self.node.factory_reset(option)?;
        self.reboot();
        Ok(())
    }
}

impl Servo {
    /// What a write asks for, behind indirect data too.
    fn values(&self, address: u16, bytes: &[u8]) -> Result<Vec<(Register, i64)>, Refusal> {
        self.node.table.check_stretch(address, bytes.len())?;
        let mut values = Vec::new();
        for (address, bytes) in self.direct(address, bytes) {
            values.extend(self.node.table.parse(address, &bytes)?);
        }
        Ok(values)
    }

    /// Takes all values, or none.
    fn take(&mut self, values: Vec<(Register, i64)>) -> Result<(), Refusal> {
        self.check(&values)?;
        for (register, value) in values {
            self.apply(register, value);
        }
        Ok(())
    }

    /// Where an address leads: itself, or what its indirect address register says. One level deep; the cells of the
    /// indirect areas are what they are unless mapped.
    fn target(&self, address: u16) -> u16 {
        reg::indirect(self.fitting.model.series, address)
            .map_or(address, |register| self.node.table.get(register) as u16)
    }

    /// A write as writes to whole stretches of direct addresses.
    fn direct(&self, address: u16, bytes: &[u8]) -> Vec<(u16, Vec<u8>)> {
        let mut stretches: Vec<(u16, Vec<u8>)> = Vec::new();
        for (address, &byte) in (address..).zip(bytes) {
            let target = self.target(address);
            match stretches.last_mut() {
                Some((start, stretch)) if usize::from(*start) + stretch.len() == usize::from(target) => {
                    stretch.push(byte);
                }
                _ => stretches.push((target, vec![byte])),
            }
        }
        stretches
    }

    /// Checks values that are within their registers' ranges against the state of the servo, before any is taken.
    fn check(&self, values: &[(Register, i64)]) -> Result<(), Refusal> {
        let tripped = self.node.tripped();
        values.iter().try_for_each(|&(register, value)| {
            let is = |other: Register| register.address == other.address;
            let within = |limit: Register| value.abs() <= self.node.table.get(limit);
            if register.access == Access::Eeprom && self.torque() {
                return Err(Refusal::Access);
            }
            if tripped && (reg::GOALS.into_iter().any(is) || is(reg::BUS_WATCHDOG) && value != 0) {
                return Err(Refusal::DataRange);
            }
            if is(reg::OPERATING_MODE)
                && !self
                    .fitting
                    .model
                    .modes
                    .iter()
                    .any(|&mode| i64::from(mode) == value)
            {
                return Err(Refusal::DataRange);
            }
            let profile_limited = self.fitting.model.series.profile_within_limit;
            let kept = if is(reg::PROFILE_VELOCITY) && profile_limited {
                within(reg::VELOCITY_LIMIT)
            } else if is(reg::PROFILE_ACCELERATION) && self.node.table.has(reg::ACCELERATION_LIMIT) {
                within(reg::ACCELERATION_LIMIT)
            } else if is(reg::GOAL_PWM) {
                within(reg::PWM_LIMIT)
            } else if is(reg::GOAL_CURRENT) {
                within(reg::CURRENT_LIMIT)
            } else if is(reg::GOAL_VELOCITY) {
                within(reg::VELOCITY_LIMIT)
            } else if is(reg::GOAL_POSITION) {
                self.goal_limits()
                    .is_none_or(|(min, max)| (min..=max).contains(&value))
            } else {
                true
            };
            if kept { Ok(()) } else { Err(Refusal::DataLimit) }
        })
    }

    fn apply(&mut self, register: Register, value: i64) {
        if register.address == reg::TORQUE_ENABLE.address {
            self.switch_torque(value == 1);
        } else if register.address == reg::GOAL_POSITION.address {
            if self.shut_down() {
                return;
            }
            if self.node.table.get(reg::DRIVE_MODE) & 8 != 0 {
                self.switch_torque(true);
            }
            self.node.table.set(register, value);
            self.set_off();
        } else {
            self.node.table.set(register, value);
            if register.access == Access::Eeprom {
                self.remap();
            }
        }
    }

    /// Torque comes on with the goal at the present position; after a shutdown it does not come on until a reboot.
    fn switch_torque(&mut self, on: bool) {
        if on == self.torque() || on && self.shut_down() {
            return;
        }
        self.node.table.set(reg::TORQUE_ENABLE, i64::from(on));
        self.node.hear();
        self.stand();
    }

    /// Direction, mode or offset may have changed: a single turn counts from 0 again.
    fn remap(&mut self) {
        if self.goal_limits().is_some() {
            self.lose_turns();
        }
        self.stand();
    }
}
