//! A host that has other things to do takes longer over a run on a bus, and loses none.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use tests::{Simulator, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");
const JOB: &str = "[[plane]]\ntheta_r_deg = 60.0\nreadings = 12\n[arc]\nreadings = 6\n";
/// Threads that never rest, for each core.
const BUSY: usize = 6;

#[test]
fn a_run_over_the_wire_is_complete_while_every_core_is_busy() {
    let temporary = tempfile::tempdir().unwrap();
    let simulator = Simulator::new("[sim]\n");
    simulator.rig_file(temporary.path());
    fs::write(temporary.path().join("job.toml"), JOB).unwrap();
    let over = AtomicBool::new(false);
    let cores = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..BUSY * cores {
            scope.spawn(|| {
                while !over.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        // Also where this panics.
        let end = Over(&over);
        let _ = run(
            GONIOCTL,
            temporary.path(),
            &["run", "job.toml", "--rig", "rig.toml"],
        )
        .expect(0);
        drop(end);
    });
}

/// Ends the busy threads when it goes.
struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
