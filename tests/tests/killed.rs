//! The daemon is killed at random moments and loses nothing. `cargo run -p tests --bin kills` does it 200 times.

use std::time::{SystemTime, UNIX_EPOCH};

#[test]
fn twenty_kills_lose_and_double_nothing() {
    let seed = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs();
    println!("seed {seed}");
    let tally = tests::kills(env!("CARGO_BIN_EXE_e2e-daemon"), seed, 20);
    println!("{tally:?}");
}
