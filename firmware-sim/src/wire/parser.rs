use super::packet::{HEADER, PREAMBLE, Packet};

/// Longest length field that is believed: an instruction for every id of a full bus fits, a damaged length mostly
/// does not.
const MAX_LENGTH: usize = 4096;
/// Shortest: instruction and CRC.
const MIN_LENGTH: usize = 3;

/// Finds packets in a stream of bytes, whatever else is in it.
///
/// A frame is what its length field says, and counts when its CRC matches. A frame that fails is not skipped as a
/// whole: the search goes on one byte behind its header, and a good packet inside one that never gets complete is
/// found too. So noise, a wrong CRC, a damaged length or a packet that was cut off cost no good packet after them.
#[derive(Debug, Default)]
pub(crate) struct Parser {
    buffer: Vec<u8>,
    damaged: u64,
}

/// A good packet, and how many received bytes came after it.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Received {
    pub(crate) packet: Packet,
    pub(crate) bytes_after: usize,
}

enum Frame {
    Good(Packet),
    Incomplete,
    Bad,
}

impl Parser {
    /// Appends what was received.
    pub(crate) fn push(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }

    /// Complete frames that were refused for their CRC so far.
    pub(crate) fn damaged(&self) -> u64 {
        self.damaged
    }

    /// The next good packet, if it is there in whole.
    pub(crate) fn take(&mut self) -> Option<Received> {
        let mut start = 0;
        let mut first_incomplete = None;
        while let Some(header) = self.header(start) {
            match self.frame(header) {
                Frame::Good(packet) => {
                    let end = header + frame_length(&self.buffer[header..]);
                    self.buffer.drain(..end);
                    return Some(Received {
                        packet,
                        bytes_after: self.buffer.len(),
                    });
                }
                Frame::Incomplete => {
                    first_incomplete.get_or_insert(header);
                }
                // Counted once: from here on the search begins behind it, unless a frame before it may still get
                // complete.
                Frame::Bad if first_incomplete.is_none() => self.damaged += 1,
                Frame::Bad => {}
            }
            start = header + 1;
        }
        // Without a frame that may get complete, a header may still begin in the last three bytes.
        let keep = first_incomplete.unwrap_or(self.buffer.len().saturating_sub(HEADER.len() - 1).max(start));
        self.buffer.drain(..keep);
        None
    }

    /// Where the next header begins.
    fn header(&self, from: usize) -> Option<usize> {
        self.buffer[from..]
            .windows(HEADER.len())
            .position(|window| window == HEADER)
            .map(|offset| from + offset)
    }

    fn frame(&self, header: usize) -> Frame {
        let bytes = &self.buffer[header..];
        if bytes.len() < PREAMBLE {
            return Frame::Incomplete;
        }
        let length = frame_length(bytes);
        if !(PREAMBLE + MIN_LENGTH..=PREAMBLE + MAX_LENGTH).contains(&length) {
            return Frame::Bad;
        }
        match bytes.get(..length) {
            None => Frame::Incomplete,
            Some(frame) => Packet::decode(frame).map_or(Frame::Bad, Frame::Good),
        }
    }
}

/// Bytes of the whole frame that begins here, by its length field.
fn frame_length(bytes: &[u8]) -> usize {
    PREAMBLE + usize::from(u16::from_le_bytes([bytes[5], bytes[6]]))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn read_request() -> Packet {
        Packet {
            id: 1,
            instruction: 0x02,
            params: vec![0x84, 0x00, 0x04, 0x00],
        }
    }

    fn parse(bytes: &[u8]) -> Vec<Packet> {
        let mut parser = Parser::default();
        parser.push(bytes);
        std::iter::from_fn(|| parser.take())
            .map(|received| received.packet)
            .collect()
    }

    #[test]
    fn a_packet_is_found_however_it_is_cut_up() {
        let wire = read_request().encode();
        for cut in 0..=wire.len() {
            let mut parser = Parser::default();
            parser.push(&wire[..cut]);
            if cut < wire.len() {
                assert_eq!(parser.take(), None, "cut at {cut}");
            }
            parser.push(&wire[cut..]);
            let received = parser.take().unwrap_or_else(|| panic!("cut at {cut}"));
            assert_eq!(
                received,
                Received {
                    packet: read_request(),
                    bytes_after: 0
                },
                "cut at {cut}"
            );
        }
    }

    #[test]
    fn damage_costs_no_packet_after_it() {
        let good = read_request().encode();
        let mut wrong_crc = good.clone();
        wrong_crc[12] ^= 0x55;
        let with_length = |length: u16| {
            let mut bytes = good.clone();
            bytes[5..7].copy_from_slice(&length.to_le_bytes());
            bytes
        };
        let cases: [(&str, Vec<u8>); 9] = [
            ("line noise", vec![0x00, 0x13, 0xA5]),
            ("an extra FF", vec![0xFF]),
            ("half a header", vec![0xFF, 0xFF, 0xFD]),
            ("a wrong CRC", wrong_crc),
            ("a packet cut off", good[..9].to_vec()),
            ("length 0", with_length(0)),
            ("length 1", with_length(1)),
            ("a length that swallows what follows", with_length(300)),
            ("a huge length", with_length(0xFFFF)),
        ];
        for (name, noise) in cases {
            let bytes = [noise, good.clone()].concat();
            assert_eq!(parse(&bytes), [read_request()], "after {name}");
        }
    }

    #[test]
    fn a_wrong_crc_is_counted_once() {
        let mut bad = read_request().encode();
        bad[12] ^= 0x55;
        let mut parser = Parser::default();
        parser.push(&bad);
        assert_eq!(parser.take(), None);
        parser.push(&read_request().encode());
        assert!(parser.take().is_some());
        assert_eq!(parser.damaged(), 1);
    }

    /// A body of `FF FF FD` that the sender did not stuff, as the Python SDK sends it.
    #[test]
    fn an_unstuffed_body_is_heard() {
        let params = vec![0x74, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFF];
        let packet = Packet {
            id: 1,
            instruction: 0x03,
            params,
        };
        let mut wire = super::super::packet::preamble(1, u16::try_from(packet.params.len() + 3).unwrap());
        wire.push(packet.instruction);
        wire.extend_from_slice(&packet.params);
        wire.extend_from_slice(&super::super::crc::crc16(&wire).to_le_bytes());
        assert_ne!(wire, packet.encode(), "the case needs stuffing");
        assert_eq!(parse(&packet.encode()), std::slice::from_ref(&packet));
        assert_eq!(parse(&wire), [packet]);
    }

    /// Noise that likes to look like a packet.
    fn noise() -> impl Strategy<Value = Vec<u8>> {
        let piece = prop_oneof![
            prop::collection::vec(any::<u8>(), 0..12),
            Just(HEADER.to_vec()),
            Just(vec![0xFF, 0xFF]),
            (any::<u8>(), any::<u16>()).prop_map(|(id, length)| super::super::packet::preamble(id, length)),
            (any::<u8>(), 0u16..60).prop_map(|(id, length)| super::super::packet::preamble(id, length)),
        ];
        prop::collection::vec(piece, 0..5).prop_map(|pieces| pieces.concat())
    }

    proptest! {
        #[test]
        fn prop_noise_costs_no_good_packet(
            before in noise(),
            between in noise(),
            params in prop::collection::vec(prop_oneof![Just(0xFFu8), Just(0xFDu8), any::<u8>()], 0..40),
            chunk in 1usize..40,
        ) {
            let first = Packet { id: 7, instruction: 0x03, params };
            let second = read_request();
            let wire = [before, first.encode(), between, second.encode()].concat();
            let mut parser = Parser::default();
            let mut heard = Vec::new();
            for bytes in wire.chunks(chunk) {
                parser.push(bytes);
                while let Some(received) = parser.take() {
                    heard.push(received.packet);
                }
            }
            prop_assert!(heard.contains(&first), "{wire:02X?} gave {heard:?}");
            prop_assert_eq!(heard.last(), Some(&second));
        }

        #[test]
        fn prop_random_bytes_never_panic_and_never_pile_up(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
            let mut parser = Parser::default();
            for _ in 0..20 {
                parser.push(&bytes);
                while parser.take().is_some() {}
            }
            prop_assert!(parser.buffer.len() <= PREAMBLE + MAX_LENGTH);
        }
    }
}
