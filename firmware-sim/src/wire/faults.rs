use std::collections::BTreeMap;
use std::time::Duration;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// What goes wrong on the wire. All rates are probabilities, 0 … 1; the default is a perfect wire.
///
/// Each is tied to something that users of such buses reported; see config/rig.toml for the keys.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WireFaults {
    /// Per byte of a reply: it arrives with other bits.
    pub corrupt_byte: f64,
    /// Per reply: it does not arrive.
    pub drop_reply: f64,
    /// Per reply: it arrives twice.
    pub duplicate_reply: f64,
    /// Per reply: it ends early.
    pub truncate_reply: f64,
    /// Per reply: up to eight stray bytes come before it.
    pub noise: f64,
    /// Per reply: its length field is 0, 1 or 65,535, CRC and all.
    pub wrong_length: f64,
    /// Per reply: it names another id, CRC and all.
    pub wrong_id: f64,
    /// Per reply: it comes later by [`late_by`](Self::late_by).
    pub late_reply: f64,
    /// How late a late reply is.
    pub late_by: Duration,
    /// The adapter returns what the host sends.
    pub echo: bool,
    /// Ids cut off the bus, each from a time of the bench on: they hear nothing and say nothing.
    pub silent: BTreeMap<u8, Duration>,
}

/// What became of a reply.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Delivery {
    pub(crate) bytes: Vec<u8>,
    /// Extra wait before it.
    pub(crate) late: Duration,
    /// Whether anything was done to it.
    pub(crate) hurt: bool,
}

impl WireFaults {
    /// Whether a device is cut off at a time.
    pub(crate) fn silences(&self, id: u8, now: Duration) -> bool {
        self.silent.get(&id).is_some_and(|&from| now >= from)
    }

    /// Sends a reply through the faults; `None` is one that does not arrive.
    pub(crate) fn deliver(&self, reply: &[u8], rng: &mut ChaCha8Rng) -> Option<Delivery> {
        if rng.random_bool(self.drop_reply) {
            return None;
        }
        let mut bytes = reply.to_vec();
        if rng.random_bool(self.wrong_id) {
            rewrite(&mut bytes, |bytes| bytes[4] = bytes[4].wrapping_add(1) % 0xFD);
        }
        if rng.random_bool(self.wrong_length) {
            let length = [0u16, 1, 0xFFFF][rng.random_range(0..3)];
            rewrite(&mut bytes, |bytes| {
                bytes[5..7].copy_from_slice(&length.to_le_bytes());
            });
        }
        for byte in &mut bytes {
            if rng.random_bool(self.corrupt_byte) {
                *byte ^= rng.random_range(1..=0xFF);
            }
        }
        if rng.random_bool(self.truncate_reply) {
            bytes.truncate(rng.random_range(1..bytes.len()));
        }
        if rng.random_bool(self.duplicate_reply) {
            bytes.extend_from_within(..);
        }
        if rng.random_bool(self.noise) {
            let stray: Vec<u8> = (0..rng.random_range(1..=8)).map(|_| rng.random()).collect();
            bytes.splice(0..0, stray);
        }
        let late = if rng.random_bool(self.late_reply) {
            self.late_by
        } else {
            Duration::ZERO
        };
        let hurt = bytes != reply || !late.is_zero();
        Some(Delivery { bytes, late, hurt })
    }
}

/// Changes a reply and makes its CRC right again.
fn rewrite(bytes: &mut [u8], change: impl FnOnce(&mut [u8])) {
    change(bytes);
    let end = bytes.len() - 2;
    let crc = super::crc::crc16(&bytes[..end]);
    bytes[end..].copy_from_slice(&crc.to_le_bytes());
}
