use std::time::Duration;

use super::instruction::Write;

/// What the host wrote to a device, as it came over the wire; whether the device heard or refused it is not told.
///
/// Sync and bulk writes are one of these for each device that they name; a Reg Write is told when it is registered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// Bench time at which its packet had arrived.
    pub at: Duration,
    /// Host time at which it was received, since the line was opened ([`Server::opened`](crate::Server::opened)).
    pub received: Duration,
    /// Id that it was sent to; 254 is all.
    pub id: u8,
    /// Address of the first byte in the control table.
    pub address: u16,
    /// The bytes.
    pub bytes: Vec<u8>,
}

impl Written {
    pub(super) fn new(write: &Write<'_>, at: Duration, received: Duration) -> Self {
        Self {
            at,
            received,
            id: write.id,
            address: write.address,
            bytes: write.bytes.to_vec(),
        }
    }
}
