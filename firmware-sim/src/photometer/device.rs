//! What the wire sees of the photometer (docs/photometer.md).

use std::time::Duration;

use super::{Photometer, reg};
use crate::table::{Access, Register};
use crate::{Device, Refusal};

impl Device for Photometer {
    fn id(&self) -> u8 {
        self.node.id()
    }

    fn baud(&self) -> u32 {
        self.node.baud()
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

    fn read(&self, address: u16, length: u16) -> Result<Vec<u8>, Refusal> {
        self.node.table.check_stretch(address, usize::from(length))?;
        let mut live = self.node.table.clone();
        let temperature = self.temperature_c(self.node.now.as_secs_f64());
        live.set(reg::TEMPERATURE, temperature.round().clamp(0.0, 255.0) as i64);
        live.set(reg::DOOR, i64::from(self.node.now < self.door_until));
        live.set(reg::PRESENT_TIME, self.ticks(self.node.now));
        Ok((address..address + length)
            .map(|address| live.byte(address))
            .collect())
    }

    fn write(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal> {
        let values = self.node.table.parse(address, bytes)?;
        self.check(&values)?;
        for (register, value) in values {
            self.apply(register, value);
        }
        Ok(())
    }

    fn reboot(&mut self) {
        let wire = self.node.table.get(reg::CLOCK);
        self.switch_lamp(false);
        self.integration = None;
        self.node.forget_ram();
        self.node.table.set(reg::CLOCK, wire);
        self.booted = self.node.now;
        self.node.hear();
        self.node.boot(self.fitting.boot);
    }

    /// There are no turns to clear.
    fn clear(&mut self, _parameters: &[u8]) -> Result<(), Refusal> {
        Err(Refusal::Instruction)
    }

    fn factory_reset(&mut self, option: u8) -> Result<(), Refusal> {
        self.node.factory_reset(option)?;
        self.reboot();
        Ok(())
    }
}

impl Photometer {
    /// Checks values that are within their registers' ranges against the state of the node, before any is taken.
    fn check(&mut self, values: &[(Register, i64)]) -> Result<(), Refusal> {
        let tripped = self.node.tripped();
        for &(register, value) in values {
            if register.access == Access::Eeprom && self.lamp.on() {
                return Err(Refusal::Access);
            }
            if register == reg::DELAY && self.node.table.get(reg::CLOCK) == 0 {
                return Err(Refusal::Access);
            }
            let kept_dark =
                register == reg::LAMP_ENABLE && value == 1 || register == reg::BUS_WATCHDOG && value != 0;
            if tripped && kept_dark {
                return Err(Refusal::DataRange);
            }
            if register == reg::TRIGGER && value == 1 {
                if self.integration.is_some() {
                    return Err(Refusal::DataRange);
                }
                if std::mem::take(&mut self.refuses_trigger) {
                    return Err(Refusal::Result);
                }
            }
        }
        Ok(())
    }

    fn apply(&mut self, register: Register, value: i64) {
        match register {
            // After a hardware error the lamp stays off until a reboot.
            reg::LAMP_ENABLE if value == 0 || !self.alert() => {
                self.node.hear();
                self.switch_lamp(value == 1);
            }
            reg::LAMP_ENABLE => {}
            reg::TRIGGER if value == 1 => self.trigger(),
            reg::TRIGGER => {}
            reg::DELAY => self.delay = Some(Duration::from_micros(value as u64)),
            _ => self.node.table.set(register, value),
        }
    }
}
