//! Kills the daemon at random moments and shows that nothing is lost: `kills [N [SEED]]`, 200 kills if not said.
//!
//! `cargo build -p tests && cargo run -p tests --bin kills -- 200`

use std::time::{SystemTime, UNIX_EPOCH};

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let kills = arguments.next().map_or(Ok(200), |text| text.parse())?;
    let seed = match arguments.next() {
        Some(text) => text.parse()?,
        None => SystemTime::now().duration_since(UNIX_EPOCH)?.as_secs(),
    };
    println!("seed {seed}");
    let here = std::env::current_exe()?;
    let program = here.with_file_name("e2e-daemon");
    let tally = tests::kills(&program.to_string_lossy(), seed, kills);
    for (phase, times) in &tally {
        println!("{times:4} while {phase}");
    }
    println!(
        "{} kills: every run was completed, no reading lost or doubled, the BRDF the same to the last bit",
        tally.values().sum::<usize>()
    );
    Ok(())
}
