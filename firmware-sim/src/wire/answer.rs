use std::time::Duration;

use super::packet::{Packet, STATUS_LENGTH};
use crate::{Device, Refusal};

/// Status return level from which a device answers (e-manual, register 68).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    /// Always.
    Ping = 0,
    /// Reads.
    Read = 1,
    /// Everything else.
    All = 2,
}

/// One device's turn to speak.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Slot {
    /// It answers.
    Status {
        /// Its return delay.
        delay: Duration,
        /// What stands on the wire.
        bytes: Vec<u8>,
    },
    /// The host waits for so many bytes in vain; those behind it wait as long.
    Silence {
        /// Bytes of the answer that does not come.
        bytes: usize,
    },
}

/// Has the devices of an id do something, and makes the status packet of it: that of a device whose status return
/// level is at least `level`. `length` is how many bytes of data the host waits for.
///
/// Two devices with one id speak at once, and what arrives is neither.
pub(crate) fn ask(
    devices: &mut [&mut dyn Device],
    id: u8,
    level: Level,
    length: usize,
    mut act: impl FnMut(&mut dyn Device) -> Result<Vec<u8>, Refusal>,
) -> Slot {
    let mut answer: Option<(Duration, Vec<u8>)> = None;
    for device in devices.iter_mut().filter(|device| device.id() == id) {
        // As they were when the packet came: a new id, baud rate or level counts from the next packet on.
        let (delay, answers) = (device.return_delay(), device.status_return_level() >= level as u8);
        let result = act(&mut **device);
        if !answers {
            continue;
        }
        let (number, data) = match result {
            Ok(data) => (0, data),
            Err(refusal) => (refusal as u8, Vec::new()),
        };
        let bytes = Packet::status(id, error_byte(&**device, number), &data).encode();
        answer = Some(match answer {
            None => (delay, bytes),
            Some((first_delay, first)) => (first_delay.min(delay), collide(&first, &bytes)),
        });
    }
    match answer {
        Some((delay, bytes)) => Slot::Status { delay, bytes },
        None => Slot::Silence {
            bytes: STATUS_LENGTH + length,
        },
    }
}

/// Error byte of a status packet: the number, and the Alert bit where a hardware error is latched.
pub(crate) fn error_byte(device: &dyn Device, number: u8) -> u8 {
    number | (u8::from(device.alert()) << 7)
}

/// Two drivers on one line: a zero of either wins.
fn collide(a: &[u8], b: &[u8]) -> Vec<u8> {
    let (long, short) = if a.len() >= b.len() { (a, b) } else { (b, a) };
    let mut bytes = long.to_vec();
    for (byte, other) in bytes.iter_mut().zip(short) {
        *byte &= other;
    }
    bytes
}
