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
    /// Per reply: its first bytes are lost, as behind an adapter that is slow to turn round.
    pub behead_reply: f64,
    /// Per reply: the rest of it comes later by [`late_by`](Self::late_by).
    pub split_reply: f64,
    /// Per reply: up to eight stray bytes come before it.
    pub noise: f64,
    /// Per reply: its length field is 0, 1 or 65,535, CRC and all.
    pub wrong_length: f64,
    /// Per reply: it names another id, CRC and all.
    pub wrong_id: f64,
    /// Per reply: it comes later by [`late_by`](Self::late_by).
    pub late_reply: f64,
    /// How late a late reply, the rest of a split one, and what follows a busy port are.
    pub late_by: Duration,
    /// Per byte of a request: it arrives with other bits.
    pub corrupt_request: f64,
    /// Per request: it does not arrive.
    pub drop_request: f64,
    /// Per request: the port is busy and takes it, and all after it, only after [`late_by`](Self::late_by).
    pub busy: f64,
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
}

impl WireFaults {
    /// Whether a device is cut off at a time.
    pub(crate) fn silences(&self, id: u8, now: Duration) -> bool {
        self.silent.get(&id).is_some_and(|&from| now >= from)
    }

    /// Sends a request through the faults; `None` is one that does not arrive.
    pub(crate) fn take(&self, request: &[u8], rng: &mut ChaCha8Rng) -> Option<Vec<u8>> {
        if rng.random_bool(self.drop_request) {
            return None;
        }
        let mut bytes = request.to_vec();
        corrupt(&mut bytes, self.corrupt_request, rng);
        Some(bytes)
    }

    /// Sends a reply through the faults; none at all is one that does not arrive, two are one in two parts.
    pub(crate) fn deliver(&self, reply: &[u8], rng: &mut ChaCha8Rng) -> Vec<Delivery> {
        if rng.random_bool(self.drop_reply) {
            return Vec::new();
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
        corrupt(&mut bytes, self.corrupt_byte, rng);
        if rng.random_bool(self.truncate_reply) {
            bytes.truncate(rng.random_range(1..bytes.len()));
        }
        if rng.random_bool(self.behead_reply) {
            bytes.drain(..rng.random_range(1..=bytes.len()));
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
        let mut parts = vec![Delivery { bytes, late }];
        if parts[0].bytes.len() > 1 && rng.random_bool(self.split_reply) {
            let at = rng.random_range(1..parts[0].bytes.len());
            let rest = parts[0].bytes.split_off(at);
            parts.push(Delivery {
                bytes: rest,
                late: late + self.late_by,
            });
        }
        parts
    }
}

fn corrupt(bytes: &mut [u8], rate: f64, rng: &mut ChaCha8Rng) {
    for byte in bytes {
        if rng.random_bool(rate) {
            *byte ^= rng.random_range(1..=0xFF);
        }
    }
}

/// Changes a reply and makes its CRC right again.
fn rewrite(bytes: &mut [u8], change: impl FnOnce(&mut [u8])) {
    change(bytes);
    let end = bytes.len() - 2;
    let crc = super::crc::crc16(&bytes[..end]);
    bytes[end..].copy_from_slice(&crc.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::SeedableRng;

    use super::*;
    use crate::wire::packet::Packet;

    const REPLIES: usize = 20_000;

    fn reply() -> Vec<u8> {
        Packet::status(1, 0, &[0, 8, 0, 0]).encode()
    }

    fn deliveries(faults: &WireFaults, seed: u64) -> Vec<Vec<Delivery>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..REPLIES).map(|_| faults.deliver(&reply(), &mut rng)).collect()
    }

    /// Checks that a count is within five standard deviations of what a rate gives.
    fn assert_rate(name: &str, found: usize, trials: usize, rate: f64) {
        let mean = trials as f64 * rate;
        let deviation = (mean * (1.0 - rate)).sqrt();
        assert!(
            (found as f64 - mean).abs() < 5.0 * deviation,
            "{name}: {found} of {trials}, wanted {rate}"
        );
    }

    #[test]
    fn a_perfect_wire_changes_nothing() {
        let clean = vec![Delivery {
            bytes: reply(),
            late: Duration::ZERO,
        }];
        assert!(
            deliveries(&WireFaults::default(), 1)
                .into_iter()
                .all(|delivery| delivery == clean)
        );
    }

    #[test]
    fn the_broken_bus_of_the_acceptance_test_has_its_rates() {
        let faults = WireFaults {
            corrupt_byte: 0.002,
            drop_reply: 0.005,
            ..WireFaults::default()
        };
        let deliveries = deliveries(&faults, 2);
        let arrived: Vec<_> = deliveries.iter().flatten().collect();
        assert_rate("dropped", REPLIES - arrived.len(), REPLIES, 0.005);
        let wrong_bytes = |delivery: &&Delivery| {
            delivery
                .bytes
                .iter()
                .zip(reply())
                .filter(|(a, b)| **a != *b)
                .count()
        };
        let wrong = arrived.iter().map(wrong_bytes).sum();
        assert_rate("wrong bytes", wrong, arrived.len() * reply().len(), 0.002);
    }

    #[test]
    fn each_fault_does_what_it_says() {
        let with = |change: fn(&mut WireFaults)| {
            let mut faults = WireFaults::default();
            change(&mut faults);
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let [delivery] = &faults.deliver(&reply(), &mut rng)[..] else {
                panic!("it arrives in one part");
            };
            delivery.clone()
        };
        let clean = reply();
        let wrong_id = Packet::decode(&with(|faults| faults.wrong_id = 1.0).bytes).unwrap();
        assert_eq!((wrong_id.id, wrong_id.params), (2, vec![0, 0, 8, 0, 0]));
        let wrong_length = with(|faults| faults.wrong_length = 1.0).bytes;
        assert!([[0, 0], [1, 0], [0xFF, 0xFF]].contains(&[wrong_length[5], wrong_length[6]]));
        assert!(Packet::decode(&wrong_length).is_some(), "its CRC matches");
        let cut = with(|faults| faults.truncate_reply = 1.0).bytes;
        assert!(cut.len() < clean.len() && clean.starts_with(&cut));
        assert_eq!(
            with(|faults| faults.duplicate_reply = 1.0).bytes,
            [clean.clone(), clean.clone()].concat()
        );
        let beheaded = with(|faults| faults.behead_reply = 1.0).bytes;
        assert!(beheaded.len() < clean.len() && clean.ends_with(&beheaded));
        let noisy = with(|faults| faults.noise = 1.0).bytes;
        assert!(noisy.len() > clean.len() && noisy.ends_with(&clean));
        let late = with(|faults| {
            faults.late_reply = 1.0;
            faults.late_by = Duration::from_millis(40);
        });
        assert_eq!(
            late,
            Delivery {
                bytes: clean,
                late: Duration::from_millis(40)
            }
        );
    }

    #[test]
    fn a_split_reply_comes_whole_in_the_end() {
        let faults = WireFaults {
            split_reply: 1.0,
            late_by: Duration::from_millis(7),
            ..WireFaults::default()
        };
        for parts in deliveries(&faults, 4) {
            let [first, rest] = &parts[..] else {
                panic!("{parts:?}");
            };
            assert_eq!([&first.bytes[..], &rest.bytes].concat(), reply());
            assert_eq!((first.late, rest.late), (Duration::ZERO, faults.late_by));
        }
    }

    #[test]
    fn requests_are_lost_and_damaged_at_their_rates() {
        let faults = WireFaults {
            drop_request: 0.05,
            corrupt_request: 0.02,
            ..WireFaults::default()
        };
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let request = Packet::status(1, 0, &[0; 9]).encode();
        let taken: Vec<_> = (0..REPLIES)
            .filter_map(|_| faults.take(&request, &mut rng))
            .collect();
        assert_rate("dropped", REPLIES - taken.len(), REPLIES, 0.05);
        let wrong = |bytes: &Vec<u8>| bytes.iter().zip(&request).filter(|(a, b)| a != b).count();
        let bytes = taken.len() * request.len();
        assert_rate("wrong bytes", taken.iter().map(wrong).sum(), bytes, 0.02);
    }

    #[test]
    fn one_id_falls_silent_from_its_time_on() {
        let faults = WireFaults {
            silent: [(2, Duration::from_secs(3))].into(),
            ..WireFaults::default()
        };
        assert!(!faults.silences(2, Duration::from_millis(2999)));
        assert!(faults.silences(2, Duration::from_secs(3)));
        assert!(!faults.silences(1, Duration::from_secs(9)));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn prop_a_seed_gives_the_same_faults_again(seed in any::<u64>()) {
            let faults = WireFaults {
                corrupt_byte: 0.01,
                drop_reply: 0.1,
                duplicate_reply: 0.1,
                truncate_reply: 0.1,
                noise: 0.1,
                wrong_length: 0.1,
                wrong_id: 0.1,
                late_reply: 0.1,
                late_by: Duration::from_millis(40),
                ..WireFaults::default()
            };
            prop_assert!(deliveries(&faults, seed) == deliveries(&faults, seed));
        }
    }
}
