use std::time::Duration;

/// Why a device refuses an instruction: the error number of its status packet (e-manual, Protocol 2.0, "Error").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Refusal {
    /// Failed to process the packet.
    Result = 1,
    /// Undefined instruction, or Action without Reg Write.
    Instruction = 2,
    /// CRC does not match.
    Crc = 3,
    /// Value outside the range of the address.
    DataRange = 4,
    /// Length does not match the address.
    DataLength = 5,
    /// Value beyond a limit register.
    DataLimit = 6,
    /// Address is read-only or write-only, or the EEPROM is locked.
    Access = 7,
}

/// What the wire sees of a device: an id and a control table. Time is the bench's business.
pub trait Device {
    /// Its id on the bus, 0 … 252.
    fn id(&self) -> u8;

    /// Baud rate of its table, bits per second.
    fn baud(&self) -> u32;

    /// Where it has what the X series has at an address: its own address, of a device with a control table of its own.
    fn place(&self, address: u16) -> u16 {
        address
    }

    /// Wait before each status packet.
    fn return_delay(&self) -> Duration;

    /// 0: answers ping only, 1: ping and read, 2: everything.
    fn status_return_level(&self) -> u8;

    /// Whether the Alert bit is set in its status packets.
    fn alert(&self) -> bool;

    /// Whether it hears anything at all (not while it boots, not when a fault silences it).
    fn listens(&self) -> bool;

    /// Takes note that a good instruction packet arrived, for whatever device: feeds the bus watchdog.
    fn heard(&mut self);

    /// The id of the group that it belongs to: it also takes writes to that, and does not answer them.
    fn secondary_id(&self) -> Option<u8> {
        None
    }

    /// Bytes of the control table.
    ///
    /// # Errors
    /// Addresses that do not exist.
    fn read(&self, address: u16, length: u16) -> Result<Vec<u8>, Refusal>;

    /// Writes to the control table.
    ///
    /// # Errors
    /// Addresses that do not exist or may not be written, values out of range, locked EEPROM, tripped watchdog.
    fn write(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal>;

    /// Writes to the control table, asked for under the id of the group: only to what is not in the EEPROM.
    ///
    /// # Errors
    /// As [`Device::write`].
    fn write_to_group(&mut self, address: u16, bytes: &[u8]) -> Result<(), Refusal> {
        self.write(address, bytes)
    }

    /// Control Table Backup (0x20) with its parameters.
    ///
    /// # Errors
    /// Parameters that are not the documented ones, a device without backup, a restore while the EEPROM is locked or with
    /// nothing to restore.
    fn back_up(&mut self, _parameters: &[u8]) -> Result<(), Refusal> {
        Err(Refusal::Instruction)
    }

    /// Takes note whether a Reg Write waits for Action (X-series register 69); devices without that register need not
    /// care.
    fn registered(&mut self, _waits: bool) {}

    /// Restarts it: RAM is lost, hardware errors are cleared, it is deaf while it boots.
    fn reboot(&mut self);

    /// Clear instruction (0x10) with its parameters.
    ///
    /// # Errors
    /// Parameters that are not the documented ones, or a device that moves.
    fn clear(&mut self, parameters: &[u8]) -> Result<(), Refusal>;

    /// Factory reset (0x06) with its option byte.
    ///
    /// # Errors
    /// An option that is not documented.
    fn factory_reset(&mut self, option: u8) -> Result<(), Refusal>;
}
