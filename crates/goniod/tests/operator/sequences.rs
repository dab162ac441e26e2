use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::law::breaches;
use crate::script::{Delay, Op, Script};
use crate::world::World;

/// A script of three to eight things, most of them close together.
fn script(seed: u64) -> Script {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let length = random.random_range(3..=8);
    (0..length)
        .map(|_| {
            let op = Op::ALL[random.random_range(0..Op::ALL.len())];
            let delay = match random.random_range(0..4) {
                0 | 1 => Delay::Turns(random.random_range(0..12)),
                2 => Delay::Time(Duration::from_micros(random.random_range(0..20_000))),
                _ => Delay::Time(Duration::from_millis(random.random_range(20..3000))),
            };
            (op, delay)
        })
        .collect()
}

/// Longer scripts by a seeded scheduler; `OPERATOR_SEQUENCES` says how many and `OPERATOR_SEED` with which seed the
/// first one is made.
#[test]
fn nothing_moves_after_a_stop_in_longer_sequences() {
    let of = |name: &str, usual: u64| std::env::var(name).map_or(usual, |n| n.parse().unwrap());
    let (count, first) = (of("OPERATOR_SEQUENCES", 300), of("OPERATOR_SEED", 0));
    for seed in first..first + count {
        let script = script(seed);
        let (bench, marks) = World::new().play(&script);
        let broken = breaches(&bench, &marks);
        assert!(
            broken.is_empty(),
            "OPERATOR_SEED={seed} {script:?}: {broken:#?}\n{marks:#?}"
        );
    }
}
