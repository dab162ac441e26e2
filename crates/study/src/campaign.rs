use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::Serialize;

use crate::Progress;

mod carry;
mod in_process;
mod script;
mod truth;

pub use script::Script;

/// Many captures on the simulated rig, each with a few random faults, from one seed.
///
/// Each must end complete and true, or with a clear fault and in a safe state (lamp off, arms standing), from which
/// it is resumed once what was wrong is mended: no hang, no panic, no doubled or silently wrong reading.
#[derive(Clone, Copy, Debug)]
pub struct Campaign {
    /// How many.
    pub captures: u64,
    /// The first one's seed; the others follow.
    pub seed: u64,
}

/// What a campaign came to.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Campaigned {
    /// Captures that were carried through.
    pub captures: u64,
    /// Executions of those that went right: one each, and one for each resumption.
    pub executions: u64,
    /// Faults of all scripts.
    pub faults: u64,
    /// Readings that were compared with the truth.
    pub readings: u64,
    /// Captures that went wrong.
    pub wrong: Vec<Wrong>,
}

/// A capture that went wrong.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wrong {
    /// The faults that it takes: none can be left out.
    pub script: Script,
    /// What happened.
    pub why: String,
}

/// A capture that went right.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Carried {
    /// Executions: one, and one for each resumption.
    pub executions: u64,
    /// Readings that were compared with the truth.
    pub readings: u64,
}

impl Campaign {
    /// Carries all captures out on as many threads as there are processors.
    ///
    /// # Panics
    /// Never for what a capture does; where a thread cannot be started.
    pub fn run(&self, progress: &Progress<'_>) -> Campaigned {
        let (next, finished) = (AtomicU64::new(0), AtomicU64::new(0));
        let all = Mutex::new(Campaigned::default());
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    loop {
                        let i = next.fetch_add(1, Ordering::Relaxed);
                        if i >= self.captures {
                            break;
                        }
                        let script = Script::random(self.seed.wrapping_add(i));
                        let carried = script.carry().map_err(|why| script.shrink(why));
                        all.lock()
                            .expect("no thread panics while it holds this")
                            .add(&script, carried);
                        progress(finished.fetch_add(1, Ordering::Relaxed) + 1, self.captures);
                    }
                });
            }
        });
        let mut all = all.into_inner().expect("all threads have ended");
        all.wrong.sort_by_key(|wrong| wrong.script.seed);
        all
    }
}

impl Campaigned {
    fn add(&mut self, script: &Script, carried: Result<Carried, Wrong>) {
        self.captures += 1;
        self.faults += script.len() as u64;
        match carried {
            Ok(carried) => {
                self.executions += carried.executions;
                self.readings += carried.readings;
            }
            Err(wrong) => self.wrong.push(wrong),
        }
    }
}
