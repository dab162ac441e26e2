use std::time::Duration;

use rig::Device as Which;
use rig::dynamixel::register::{Register, servo};

use super::decode;
use crate::Device;

/// A write as it reached a device, whether it took it or not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// When, since power-on.
    pub at: Duration,
    /// Which device.
    pub device: Which,
    /// Address of the first byte, of the X series.
    pub address: u16,
    /// The bytes.
    pub bytes: Vec<u8>,
    /// Present Position of a servo before the write, counts; 0 of the photometer.
    pub position: i64,
    /// Present Velocity of a servo before the write, in its units; 0 of the photometer.
    pub velocity: i64,
}

impl Written {
    pub(super) fn new(
        at: Duration,
        which: Which,
        device: &mut dyn Device,
        address: u16,
        bytes: &[u8],
    ) -> Self {
        let present = |register: Register| match which {
            Which::Photometer => 0,
            // A servo has both registers whatever was written before.
            Which::Light | Which::Sensor => device
                .read(device.place(register.address), register.size)
                .map_or(0, |bytes| decode(&bytes)),
        };
        Self {
            at,
            device: which,
            address,
            bytes: bytes.to_vec(),
            position: present(servo::PRESENT_POSITION),
            velocity: present(servo::PRESENT_VELOCITY),
        }
    }

    /// What was written to a register, where this write is to it alone.
    pub fn value(&self, register: Register) -> Option<i64> {
        let whole = self.address == register.address && self.bytes.len() == usize::from(register.size);
        whole.then(|| decode(&self.bytes))
    }
}
