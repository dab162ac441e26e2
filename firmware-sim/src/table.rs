use std::sync::Arc;

use crate::Refusal;

/// Who may write a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// Read-only.
    Read,
    /// Readable and writable, lost on reboot.
    Ram,
    /// Readable, writable while torque (lamp) is off, kept over a reboot.
    Eeprom,
    /// Writable, reads as zero.
    Write,
}

/// One register of a control table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Register {
    pub(crate) address: u16,
    /// Bytes: 1, 2 or 4.
    pub(crate) size: u16,
    pub(crate) access: Access,
    pub(crate) initial: i64,
    /// Allowed values; a negative minimum makes the register signed.
    pub(crate) range: (i64, i64),
}

impl Register {
    pub(crate) const fn new(
        address: u16,
        size: u16,
        access: Access,
        initial: i64,
        range: (i64, i64),
    ) -> Self {
        Self {
            address,
            size,
            access,
            initial,
            range,
        }
    }

    /// A read-only register of a value that changes by itself.
    pub(crate) const fn live(address: u16, size: u16) -> Self {
        Self::new(address, size, Access::Read, 0, (i32::MIN as i64, u32::MAX as i64))
    }

    const fn end(&self) -> u16 {
        self.address + self.size
    }

    fn decode(&self, bytes: &[u8]) -> i64 {
        let mut wide = [0; 8];
        wide[..bytes.len()].copy_from_slice(bytes);
        let unsigned = i64::from_le_bytes(wide);
        if self.range.0 < 0 {
            let unused = 64 - 8 * u32::from(self.size);
            unsigned << unused >> unused
        } else {
            unsigned
        }
    }
}

/// A control table: registers and the bytes behind them. What a value means is the device's business.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    registers: Arc<[Register]>,
    bytes: Vec<u8>,
}

impl Table {
    /// A table with its initial values.
    pub(crate) fn new(mut registers: Vec<Register>) -> Self {
        registers.sort_by_key(|register| register.address);
        let end = registers.last().map_or(0, Register::end);
        let mut table = Self {
            registers: registers.into(),
            bytes: vec![0; usize::from(end)],
        };
        table.reset(|_| true);
        table
    }

    /// Puts the registers that `which` picks back to their initial values.
    pub(crate) fn reset(&mut self, which: impl Fn(&Register) -> bool) {
        for register in Arc::clone(&self.registers)
            .iter()
            .filter(|register| which(register))
        {
            self.set(*register, register.initial);
        }
    }

    /// The value of a register.
    pub(crate) fn get(&self, register: Register) -> i64 {
        register.decode(&self.bytes[usize::from(register.address)..usize::from(register.end())])
    }

    /// Sets a register, whatever its access; excess bits are cut.
    pub(crate) fn set(&mut self, register: Register, value: i64) {
        self.bytes[usize::from(register.address)..usize::from(register.end())]
            .copy_from_slice(&value.to_le_bytes()[..usize::from(register.size)]);
    }

    /// The byte at an address of the table.
    pub(crate) fn byte(&self, address: u16) -> u8 {
        self.bytes[usize::from(address)]
    }

    /// Checks that a stretch lies within the table; holes between registers read as zero.
    ///
    /// # Errors
    /// A stretch that is empty (Data Length) or ends beyond the table (Access).
    pub(crate) fn check_stretch(&self, address: u16, length: usize) -> Result<(), Refusal> {
        if length == 0 {
            return Err(Refusal::DataLength);
        }
        match usize::from(address) + length <= self.bytes.len() {
            true => Ok(()),
            false => Err(Refusal::Access),
        }
    }

    /// What a write of whole, adjoining registers asks for, checked against access and range.
    ///
    /// # Errors
    /// A hole or a read-only register (Access), part of a register (Data Length), a value out of range (Data Range).
    pub(crate) fn parse(&self, address: u16, bytes: &[u8]) -> Result<Vec<(Register, i64)>, Refusal> {
        self.check_stretch(address, bytes.len())?;
        let mut values = Vec::new();
        let (mut at, mut rest) = (address, bytes);
        while !rest.is_empty() {
            let register = *self
                .registers
                .iter()
                .find(|register| register.address <= at && at < register.end())
                .ok_or(Refusal::Access)?;
            let size = usize::from(register.size);
            if register.address != at || rest.len() < size {
                return Err(Refusal::DataLength);
            }
            if register.access == Access::Read {
                return Err(Refusal::Access);
            }
            let value = register.decode(&rest[..size]);
            if value < register.range.0 || register.range.1 < value {
                return Err(Refusal::DataRange);
            }
            values.push((register, value));
            at += register.size;
            rest = &rest[size..];
        }
        Ok(values)
    }
}
