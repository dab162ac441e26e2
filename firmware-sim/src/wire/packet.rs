use super::crc::crc16;
use super::stuffing::{stuff, unstuff};

/// Every packet begins with it; the fourth byte is reserved.
pub(crate) const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
/// Header, id and length: what comes before the bytes that the length counts.
pub(crate) const PREAMBLE: usize = 7;
/// Addressed to all.
pub(crate) const BROADCAST: u8 = 0xFE;
/// Instruction byte of a status packet.
pub(crate) const STATUS: u8 = 0x55;
/// Bytes of a status packet without parameters.
pub(crate) const STATUS_LENGTH: usize = 11;

/// A packet of either direction, body not stuffed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Packet {
    /// Device meant, or device that speaks.
    pub(crate) id: u8,
    /// Instruction byte.
    pub(crate) instruction: u8,
    /// Parameters; those of a status packet begin with the error byte.
    pub(crate) params: Vec<u8>,
}

impl Packet {
    /// A status packet.
    pub(crate) fn status(id: u8, error: u8, data: &[u8]) -> Self {
        let mut params = Vec::with_capacity(1 + data.len());
        params.push(error);
        params.extend_from_slice(data);
        Self {
            id,
            instruction: STATUS,
            params,
        }
    }

    /// Its bytes on the wire: stuffed, counted, closed by the CRC.
    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut body = Vec::with_capacity(1 + self.params.len());
        body.push(self.instruction);
        body.extend_from_slice(&self.params);
        let body = stuff(&body);
        let length = u16::try_from(body.len() + 2).expect("no control table fills a packet");
        let mut wire = preamble(self.id, length);
        wire.extend_from_slice(&body);
        wire.extend_from_slice(&crc16(&wire).to_le_bytes());
        wire
    }

    /// The packet in the bytes of a whole frame, or `None` where the CRC does not match.
    pub(crate) fn decode(frame: &[u8]) -> Option<Self> {
        let (content, crc) = frame.split_last_chunk::<2>()?;
        if content.len() <= PREAMBLE || crc16(content) != u16::from_le_bytes(*crc) {
            return None;
        }
        let mut body = unstuff(&content[PREAMBLE..]);
        let instruction = body.remove(0);
        Some(Self {
            id: content[4],
            instruction,
            params: body,
        })
    }
}

/// Header, id and length, with room for more.
pub(crate) fn preamble(id: u8, length: u16) -> Vec<u8> {
    let mut wire = Vec::with_capacity(PREAMBLE + usize::from(length));
    wire.extend_from_slice(&HEADER);
    wire.push(id);
    wire.extend_from_slice(&length.to_le_bytes());
    wire
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Packets of the e-manual, typed from it: bytes, id, instruction, parameters.
    const GOLDEN: [(&str, u8, u8, &[u8]); 10] = [
        // Ping of id 1.
        ("FFFFFD00 01 0300 01 194E", 1, 0x01, &[]),
        // Its status: model 1030, firmware 38.
        (
            "FFFFFD00 01 0700 55 00 0604 26 655D",
            1,
            0x55,
            &[0x00, 0x06, 0x04, 0x26],
        ),
        // Read Present Position.
        (
            "FFFFFD00 01 0700 02 8400 0400 1D15",
            1,
            0x02,
            &[0x84, 0x00, 0x04, 0x00],
        ),
        // Its status: 166.
        (
            "FFFFFD00 01 0800 55 00 A6000000 8CC0",
            1,
            0x55,
            &[0x00, 0xA6, 0x00, 0x00, 0x00],
        ),
        // Write Goal Position 512.
        (
            "FFFFFD00 01 0900 03 7400 00020000 CA89",
            1,
            0x03,
            &[0x74, 0x00, 0x00, 0x02, 0x00, 0x00],
        ),
        // Reboot.
        ("FFFFFD00 01 0300 08 2F4E", 1, 0x08, &[]),
        // Clear multi-turn information.
        (
            "FFFFFD00 01 0800 10 01 44584C22 B1DC",
            1,
            0x10,
            &[0x01, 0x44, 0x58, 0x4C, 0x22],
        ),
        // Sync read of Present Position.
        (
            "FFFFFD00 FE 0900 82 8400 0400 01 02 CEFA",
            0xFE,
            0x82,
            &[0x84, 0x00, 0x04, 0x00, 0x01, 0x02],
        ),
        // Sync write of Goal Position 150 and 170.
        (
            "FFFFFD00 FE 1100 83 7400 0400 01 96000000 02 AA000000 8287",
            0xFE,
            0x83,
            &[0x74, 0, 4, 0, 1, 0x96, 0, 0, 0, 2, 0xAA, 0, 0, 0],
        ),
        // Bulk read of Present Voltage and Present Temperature.
        (
            "FFFFFD00 FE 0D00 92 01 9000 0200 02 9200 0100 1A05",
            0xFE,
            0x92,
            &[1, 0x90, 0, 2, 0, 2, 0x92, 0, 1, 0],
        ),
    ];

    fn bytes(hex: &str) -> Vec<u8> {
        let digits: String = hex.split_whitespace().collect();
        (0..digits.len())
            .step_by(2)
            .map(|i| u8::from_str_radix(&digits[i..i + 2], 16).unwrap())
            .collect()
    }

    #[test]
    fn golden_packets_both_ways() {
        for (hex, id, instruction, params) in GOLDEN {
            let packet = Packet {
                id,
                instruction,
                params: params.to_vec(),
            };
            assert_eq!(packet.encode(), bytes(hex), "encoding {hex}");
            assert_eq!(Packet::decode(&bytes(hex)), Some(packet), "decoding {hex}");
        }
    }

    #[test]
    fn one_wrong_bit_is_refused() {
        let good = bytes("FFFFFD00 01 0700 02 8400 0400 1D15");
        for bit in 0..good.len() * 8 {
            let mut bad = good.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Packet::decode(&bad), None, "bit {bit} of {good:02X?}");
        }
    }

    proptest! {
        #[test]
        fn prop_any_packet_round_trips(
            id in 0u8..=254,
            instruction in any::<u8>(),
            params in prop::collection::vec(prop_oneof![Just(0xFFu8), Just(0xFDu8), any::<u8>()], 0..80),
        ) {
            let packet = Packet { id, instruction, params };
            prop_assert_eq!(Packet::decode(&packet.encode()), Some(packet));
        }
    }
}
