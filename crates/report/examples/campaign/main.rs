//! Thousands of captures on the in-process rig, each with one to five random faults of its devices.
//!
//! `cargo run --release -p report --example campaign -- [CAPTURES] [SEED]`: 10000 captures from a fresh seed unless said.
//! What went wrong is printed as a script, cut down to the faults that it takes; the exit code is then 1.

mod campaign;

use std::process::ExitCode;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use campaign::Campaign;

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u64>());
    let (Ok(captures), Ok(seed)) = (
        numbers.next().transpose().map(|n| n.unwrap_or(10_000)),
        numbers.next().transpose(),
    ) else {
        eprintln!("usage: campaign [CAPTURES] [SEED]");
        return ExitCode::from(2);
    };
    let fresh = || {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        since.as_millis() as u64 % 1_000_000_000
    };
    let seed = seed.unwrap_or_else(fresh);
    println!("{captures} captures, seed {seed}");
    let begun = Instant::now();
    let told = captures.div_ceil(10).max(1);
    let campaigned = Campaign { captures, seed }.run(|done| {
        if done % told == 0 {
            println!("{done} of {captures}");
        }
    });
    println!(
        "{} captures with {} faults in {:.1} s: {} executions, {} readings true within their uncertainty",
        campaigned.captures,
        campaigned.faults,
        begun.elapsed().as_secs_f64(),
        campaigned.executions,
        campaigned.readings
    );
    for (script, why) in &campaigned.wrong {
        println!("{script}: {why}");
    }
    match campaigned.wrong.is_empty() {
        true => ExitCode::SUCCESS,
        false => ExitCode::from(1),
    }
}
