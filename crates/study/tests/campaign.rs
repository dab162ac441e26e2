//! Captures with random faults end true, or with a clear fault, safe and resumable.

use std::time::{SystemTime, UNIX_EPOCH};

use study::{Campaign, Wrong};

/// A fresh seed each time: what it finds is printed as a script for `gonioctl campaign --replay`.
fn campaign(captures: u64, over_wire: bool) {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .expect("a clock after 1970");
    let seed = since.as_micros() as u64 % 1_000_000_000;
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
    campaign(500, false);
}

#[test]
fn random_faults_of_wires_end_in_true_readings_or_a_clear_fault() {
    campaign(20, true);
}
