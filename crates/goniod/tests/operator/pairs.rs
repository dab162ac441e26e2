use std::time::Duration;

use crate::law::breaches;
use crate::script::{Delay, Op, Script};
use crate::world::World;

/// What is under way when the pair comes.
const BEFORE: [&[(Op, Delay)]; 4] = [
    &[],
    &[(Op::Submit, Delay::Time(Duration::from_millis(2600)))],
    &[(Op::Jog, Delay::Time(Duration::from_millis(150)))],
    &[
        (Op::Submit, Delay::Time(Duration::from_millis(2600))),
        (Op::Estop, Delay::Time(Duration::from_millis(500))),
    ],
];

/// Between the two: at each turn that the program takes to do the first, and later.
fn delays() -> Vec<Delay> {
    let turns = [0, 1, 2, 3, 4, 6, 9].map(Delay::Turns);
    let times = [3, 200].map(|ms| Delay::Time(Duration::from_millis(ms)));
    turns.into_iter().chain(times).collect()
}

/// Every ordered pair in every state at every turn. A share of it at a time: the whole of it is what
/// `OPERATOR_SHARES=1` plays.
#[test]
fn nothing_moves_after_a_stop_whatever_comes_before_or_after_it() {
    let shares: usize = std::env::var("OPERATOR_SHARES").map_or(12, |n| n.parse().unwrap());
    let mut played = 0;
    let mut number = 0;
    for before in BEFORE {
        for first in Op::ALL {
            for second in Op::ALL {
                for delay in delays() {
                    number += 1;
                    // Stops with everything at every turn; of the rest each time another share.
                    let central =
                        first.stops() && second.asks_to_move() || first.asks_to_move() && second.stops();
                    if !central && number % shares != 0 {
                        continue;
                    }
                    let mut script: Script = before.to_vec();
                    script.extend([(first, delay), (second, Delay::Time(Duration::from_millis(50)))]);
                    let (bench, marks) = World::new().play(&script);
                    let broken = breaches(&bench, &marks);
                    assert!(broken.is_empty(), "{script:?}: {broken:#?}\n{marks:#?}");
                    played += 1;
                }
            }
        }
    }
    println!("{played} scripts");
}
