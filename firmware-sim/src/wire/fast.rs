//! Fast Sync Read and Fast Bulk Read: one status packet to which each device adds its part.

use super::answer::{Level, Slot, error_byte};
use super::crc::crc16;
use super::instruction::Read;
use super::packet::{BROADCAST, PREAMBLE, STATUS, preamble};
use crate::Device;

/// Error byte, id and CRC around the data of one device.
const PART_OVERHEAD: usize = 4;

/// The joint answer: `FF FF FD 00 FE LEN 55`, then for each device `ERR ID DATA CRC`, the CRC over everything before
/// it. Nothing is stuffed; the ROBOTIS SDK and rustypot both read it so.
///
/// The first device sends the header with the length of all, and each waits for the one before it, so the packet
/// ends where a device stays silent.
pub(crate) fn answer(devices: &mut [&mut dyn Device], reads: &[Read]) -> Vec<Slot> {
    let length = 1 + reads
        .iter()
        .map(|read| usize::from(read.length) + PART_OVERHEAD)
        .sum::<usize>();
    let whole = PREAMBLE + length;
    let Ok(length) = u16::try_from(length) else {
        return vec![Slot::Silence { bytes: whole }];
    };
    let mut bytes = preamble(BROADCAST, length);
    bytes.push(STATUS);
    let mut delay = None;
    for &read in reads {
        let Some(device) = devices
            .iter_mut()
            .find(|device| device.id() == read.id && device.status_return_level() >= Level::Read as u8)
        else {
            break;
        };
        delay.get_or_insert(device.return_delay());
        push_part(&mut bytes, &mut **device, read);
    }
    let Some(delay) = delay else {
        return vec![Slot::Silence { bytes: whole }];
    };
    let missing = whole - bytes.len();
    let mut slots = vec![Slot::Status { delay, bytes }];
    if missing > 0 {
        slots.push(Slot::Silence { bytes: missing });
    }
    slots
}

/// Adds one device's part. A refusal still fills its place, with zeros, since the host walks with a fixed stride.
fn push_part(bytes: &mut Vec<u8>, device: &mut dyn Device, Read { id, address, length }: Read) {
    let (number, data) = match device.read(address, length) {
        Ok(data) => (0, data),
        Err(refusal) => (refusal as u8, vec![0; length.into()]),
    };
    bytes.push(error_byte(device, number));
    bytes.push(id);
    bytes.extend_from_slice(&data);
    bytes.extend_from_slice(&crc16(bytes).to_le_bytes());
}
