use crc::{CRC_16_UMTS, Crc, Table};

/// CRC-16 of Protocol 2.0: polynomial 0x8005, initial value 0, no reflection, no final xor (e-manual, "CRC
/// Calculation"); the catalogue knows it as CRC-16/UMTS.
const CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_UMTS);

/// CRC of a packet from its header to its last parameter, as it stands on the wire.
pub(crate) fn crc16(bytes: &[u8]) -> u16 {
    CRC.checksum(bytes)
}
