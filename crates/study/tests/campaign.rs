//! Captures with random faults end true, or with a clear fault, safe and resumable.

use study::{Campaign, Wrong};

/// The captures of a seed, which is 1 unless `CAMPAIGN_SEED` says another: a sample of `just trials campaign` and `wire`, which
/// look further. What goes wrong is printed as a script for `gonioctl campaign --replay`.
fn campaign(captures: u64, over_wire: bool) {
    let seed = std::env::var("CAMPAIGN_SEED").map_or(1, |seed| seed.parse().expect("a number"));
    println!("seed {seed}");
    let campaigned = Campaign {
        captures,
        seed,
        over_wire,
    }
    .run(&|_, _| ());
    assert_eq!(campaigned.captures, captures);
    assert!(
        campaigned.faults >= captures && campaigned.executions > captures,
        "{campaigned:?}"
    );
    let wrong = campaigned.wrong.iter();
    let wrong: Vec<_> = wrong
        .map(|Wrong { script, why }| format!("# {why}\n{script}"))
        .collect();
    assert!(wrong.is_empty(), "seed {seed}\n{}", wrong.join("\n"));
}

#[test]
fn random_faults_of_devices_end_in_true_readings_or_a_clear_fault() {
    campaign(150, false);
}

#[test]
fn random_faults_of_wires_end_in_true_readings_or_a_clear_fault() {
    campaign(20, true);
}
