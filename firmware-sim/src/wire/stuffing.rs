//! Byte stuffing (e-manual, Protocol 2.0, "Byte Stuffing"): after every `FF FF FD` between instruction and CRC an
//! `FD` goes onto the wire, so that no body looks like a header.
//!
//! The pattern may overlap a longer run of `FF`: `FF FF FF FD` contains it.

/// How much of `FF FF FD` the last bytes are, 0 … 3.
#[derive(Clone, Copy, Default)]
struct Prefix(u8);

impl Prefix {
    fn after(self, byte: u8) -> Self {
        Self(match (self.0, byte) {
            (2, 0xFD) => 3,
            (2, 0xFF) => 2,
            (0 | 3, 0xFF) => 1,
            (1, 0xFF) => 2,
            _ => 0,
        })
    }

    fn complete(self) -> bool {
        self.0 == 3
    }
}

/// The body as it goes onto the wire.
pub(crate) fn stuff(body: &[u8]) -> Vec<u8> {
    let mut wire = Vec::with_capacity(body.len() + body.len() / 3);
    let mut prefix = Prefix::default();
    for &byte in body {
        wire.push(byte);
        prefix = prefix.after(byte);
        if prefix.complete() {
            wire.push(0xFD);
            prefix = Prefix::default();
        }
    }
    wire
}

/// The body that was meant.
///
/// Lenient: an `FF FF FD` that is not followed by `FD` is taken as it stands, because the ROBOTIS Python SDK (4.1.0)
/// sends such parameters unstuffed. Only an unstuffed `FF FF FD FD` is ambiguous; it is read as stuffed, which is
/// what the protocol says.
pub(crate) fn unstuff(wire: &[u8]) -> Vec<u8> {
    let mut body = Vec::with_capacity(wire.len());
    let mut prefix = Prefix::default();
    for &byte in wire {
        if prefix.complete() && byte == 0xFD {
            prefix = Prefix::default();
            continue;
        }
        body.push(byte);
        prefix = prefix.after(byte);
    }
    body
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn overlapping_patterns_are_each_stuffed_once() {
        let cases: [(&[u8], &[u8]); 5] = [
            (&[0xFF, 0xFF, 0xFD], &[0xFF, 0xFF, 0xFD, 0xFD]),
            (&[0xFF, 0xFF, 0xFF, 0xFD], &[0xFF, 0xFF, 0xFF, 0xFD, 0xFD]),
            // Velocity -1 beside position -3, the commonest case on a real arm.
            (
                &[0xFF, 0xFF, 0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFF],
                &[0xFF, 0xFF, 0xFF, 0xFF, 0xFD, 0xFD, 0xFF, 0xFF, 0xFF],
            ),
            (&[0xFF, 0xFF, 0xFD, 0xFD], &[0xFF, 0xFF, 0xFD, 0xFD, 0xFD]),
            (
                &[0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD],
                &[0xFF, 0xFF, 0xFD, 0xFD, 0xFF, 0xFF, 0xFD, 0xFD],
            ),
        ];
        for (body, wire) in cases {
            assert_eq!(stuff(body), wire, "stuffing {body:02X?}");
            assert_eq!(unstuff(wire), body, "unstuffing {wire:02X?}");
        }
    }

    #[test]
    fn an_unstuffed_pattern_is_taken_as_it_stands() {
        let body = [0xFF, 0xFF, 0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFF];
        assert_eq!(unstuff(&body), body);
        assert_eq!(unstuff(&[0xFF, 0xFF, 0xFD]), [0xFF, 0xFF, 0xFD]);
    }

    /// Bytes that are nearly all of the pattern, so that overlaps are the rule.
    fn pattern_rich() -> impl Strategy<Value = Vec<u8>> {
        prop::collection::vec(
            prop_oneof![8 => Just(0xFFu8), 4 => Just(0xFDu8), 1 => Just(0u8), 1 => any::<u8>()],
            0..64,
        )
    }

    proptest! {
        #[test]
        fn prop_stuffing_round_trips(body in pattern_rich()) {
            prop_assert_eq!(unstuff(&stuff(&body)), body);
        }

        #[test]
        fn prop_a_stuffed_body_holds_no_header(body in pattern_rich()) {
            let wire = stuff(&body);
            prop_assert!(!wire.windows(4).any(|w| w[..3] == [0xFF, 0xFF, 0xFD] && w[3] != 0xFD));
        }
    }
}
