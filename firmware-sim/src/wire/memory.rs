use std::time::Duration;

use crate::{Device, Refusal};

/// A device that is nothing but a control table and what was done to it; for tests of the wire.
pub(crate) struct Memory {
    pub(crate) id: u8,
    pub(crate) table: [u8; 256],
    pub(crate) baud: u32,
    pub(crate) return_delay: Duration,
    pub(crate) status_return_level: u8,
    pub(crate) alert: bool,
    pub(crate) heard: u32,
    pub(crate) log: Vec<String>,
}

impl Memory {
    /// Answers everything at once at 1 Mbaud; its table holds its id at 7 and elsewhere the address.
    pub(crate) fn new(id: u8) -> Self {
        let mut table = std::array::from_fn(|address| u8::try_from(address).unwrap());
        table[7] = id;
        Self {
            id,
            table,
            baud: 1_000_000,
            return_delay: Duration::ZERO,
            status_return_level: 2,
            alert: false,
            heard: 0,
            log: Vec::new(),
        }
    }
}

impl Device for Memory {
    fn id(&self) -> u8 {
        self.id
    }

    fn baud(&self) -> u32 {
        self.baud
    }

    fn return_delay(&self) -> Duration {
        self.return_delay
    }

    fn status_return_level(&self) -> u8 {
        self.status_return_level
    }

    fn alert(&self) -> bool {
        self.alert
    }

    fn listens(&self) -> bool {
        true
    }

    fn heard(&mut self) {
        self.heard += 1;
    }

    fn read(&self, address: u16, length: u16) -> Result<Vec<u8>, Refusal> {
        let begin = usize::from(address);
        let bytes = self.table.get(begin..begin + usize::from(length));
        bytes.map(<[u8]>::to_vec).ok_or(Refusal::DataRange)
    }

    fn write(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal> {
        let begin = usize::from(address);
        let place = self
            .table
            .get_mut(begin..begin + bytes.len())
            .ok_or(Refusal::DataRange)?;
        place.copy_from_slice(bytes);
        self.id = self.table[7];
        Ok(())
    }

    fn registered(&mut self, waits: bool) {
        self.table[69] = u8::from(waits);
    }

    fn reboot(&mut self) {
        self.log.push("reboot".to_owned());
    }

    fn clear(&mut self, parameters: &[u8]) -> Result<(), Refusal> {
        self.log.push(format!("clear {parameters:02X?}"));
        Ok(())
    }

    fn factory_reset(&mut self, option: u8) -> Result<(), Refusal> {
        self.log.push(format!("factory reset {option:02X}"));
        Ok(())
    }
}
