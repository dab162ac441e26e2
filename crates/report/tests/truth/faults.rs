use std::time::{SystemTime, UNIX_EPOCH};

use crate::campaign::Campaign;

/// A fresh seed each time: what it finds is done again with `cargo run --example campaign -- 1 SEED`.
#[test]
fn random_faults_of_devices_end_in_true_readings_or_a_clear_fault() {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    let seed = since.as_millis() as u64 % 1_000_000_000;
    println!("seed {seed}");
    let campaigned = Campaign { captures: 500, seed }.run(|_| ());
    assert_eq!(campaigned.captures, 500);
    assert!(
        campaigned.faults >= 500 && campaigned.executions > 500,
        "{campaigned:?}"
    );
    let wrong: Vec<String> = campaigned
        .wrong
        .iter()
        .map(|(script, why)| format!("{script}: {why}"))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
