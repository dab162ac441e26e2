use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// Bytes of a packet buffer: several times the longest packet that is sent or asked for.
pub(super) const BUFFER: usize = 256;

/// Place of the id in a packet.
const ID: usize = 4;

/// Place of the length, low byte first: the bytes that follow it.
const LENGTH: usize = 5;

/// Least length of a status packet: instruction, error byte and CRC.
const LENGTH_MIN: u16 = 4;

/// A length that no packet can have that fits in the buffer.
const IMPOSSIBLE: [u8; 2] = [0xff, 0xff];

/// A buffer for `dynamixel2` to receive in, which notes whose status packet was taken out of it.
///
/// Of a refusal 0.9.1 tells the error number alone. It asks for the bytes to look at, rather than to write to, only when
/// it makes a status packet of those at the front, right before it looks at the error number; or when the time is over,
/// and then there is no packet to ask the sender of.
///
/// A length below that of any status packet makes 0.9.1 panic. It looks at the length through `as_mut` each time that
/// bytes came, with the packet at the front, so such a length is replaced there by one that is too long, which is an error
/// like any other. Bytes that are still to come only overwrite half of it, and that is too long as well.
#[derive(Debug)]
pub(super) struct Received {
    bytes: [u8; BUFFER],
    sender: Arc<AtomicU8>,
}

impl Received {
    /// An empty buffer that notes the id of the latest sender there.
    pub(super) fn new(sender: Arc<AtomicU8>) -> Self {
        Self {
            bytes: [0; BUFFER],
            sender,
        }
    }
}

impl AsRef<[u8]> for Received {
    fn as_ref(&self) -> &[u8] {
        self.sender.store(self.bytes[ID], Ordering::Relaxed);
        &self.bytes
    }
}

impl AsMut<[u8]> for Received {
    fn as_mut(&mut self) -> &mut [u8] {
        let length = &mut self.bytes[LENGTH..LENGTH + 2];
        let short = u16::from_le_bytes([length[0], length[1]]) < LENGTH_MIN;
        if short {
            length.copy_from_slice(&IMPOSSIBLE);
        }
        &mut self.bytes
    }
}
