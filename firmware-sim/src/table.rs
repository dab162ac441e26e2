use std::sync::Arc;

use rig::dynamixel::Series;

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
///
/// Registers are named by where the X series has them; where this table has them is its series' business. What comes
/// over the wire are addresses of this table.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    registers: Arc<[Register]>,
    series: Option<&'static Series>,
    bytes: Vec<u8>,
}

impl Table {
    /// A table with its initial values, whose registers are where they say.
    pub(crate) fn new(registers: Vec<Register>) -> Self {
        Self::of(None, registers)
    }

    /// The same, whose registers are where a series has them.
    pub(crate) fn of(series: Option<&'static Series>, mut registers: Vec<Register>) -> Self {
        let place = |address: u16| series.map_or(address, |series| series.place(address));
        registers.sort_by_key(|register| place(register.address));
        let end = registers
            .iter()
            .map(|register| place(register.address) + register.size)
            .max();
        let mut table = Self {
            registers: registers.into(),
            series,
            bytes: vec![0; usize::from(end.unwrap_or_default())],
        };
        table.reset(|_| true);
        table
    }

    /// Where this table has the register that the X series has at an address.
    pub(crate) fn place(&self, address: u16) -> u16 {
        self.series.map_or(address, |series| series.place(address))
    }

    /// The bytes of a register within the table; none of a register that it lacks.
    fn range(&self, register: Register) -> Option<std::ops::Range<usize>> {
        let start = usize::from(self.place(register.address));
        let range = start..start + usize::from(register.size);
        (range.end <= self.bytes.len()).then_some(range)
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

    /// The value of a register; 0 of one that the table lacks.
    pub(crate) fn get(&self, register: Register) -> i64 {
        self.range(register)
            .map_or(0, |range| register.decode(&self.bytes[range]))
    }

    /// Sets a register, whatever its access; excess bits are cut. One that the table lacks stays 0.
    pub(crate) fn set(&mut self, register: Register, value: i64) {
        if !self.has(register) {
            return;
        }
        if let Some(range) = self.range(register) {
            self.bytes[range].copy_from_slice(&value.to_le_bytes()[..usize::from(register.size)]);
        }
    }

    /// Whether the table has a register.
    pub(crate) fn has(&self, register: Register) -> bool {
        let place = self.place(register.address);
        let found = self
            .registers
            .binary_search_by_key(&place, |known| self.place(known.address));
        found.is_ok()
    }

    /// Puts the EEPROM back to what it was in another copy of this table.
    pub(crate) fn restore(&mut self, backup: &Self) {
        for register in Arc::clone(&self.registers).iter() {
            if register.access == Access::Eeprom {
                self.set(*register, backup.get(*register));
            }
        }
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
                .find(|register| {
                    let start = self.place(register.address);
                    start <= at && at < start + register.size
                })
                .ok_or(Refusal::Access)?;
            let size = usize::from(register.size);
            if self.place(register.address) != at || rest.len() < size {
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
