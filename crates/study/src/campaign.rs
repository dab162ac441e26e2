use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::Serialize;

use crate::Progress;

mod carry;
mod in_process;
mod script;
mod truth;
mod wire;

pub use script::{Script, WireFault};

/// Captures over wires for each processor: they do little but wait for replies.
const WAITING: usize = 4;

/// Many captures on the simulated rig, each with a few random faults, from one seed.
///
/// Each must end complete and true, complete and not to be believed by its own report, or with a clear fault and in a safe state (lamp off, arms standing), from which
/// it is resumed once what was wrong is mended: no hang, no panic, no doubled or silently wrong reading.
#[derive(Clone, Copy, Debug)]
pub struct Campaign {
    /// How many.
    pub captures: u64,
    /// The first one's seed; the others follow.
    pub seed: u64,
    /// Whether they go over pseudo-terminals, where wires fail too, or stay in this process, where devices do.
    pub over_wire: bool,
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
    /// Captures of which the report says that they are not to be believed, as it should.
    pub bad: u64,
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
    /// Whether the report says that it is not to be believed: nothing was compared.
    pub bad: bool,
    /// Readings that were compared with the truth.
    pub readings: u64,
}

impl Campaign {
    /// Carries all captures out on all processors.
    ///
    /// # Panics
    /// Never for what a capture does; where a thread cannot be started.
    pub fn run(&self, progress: &Progress<'_>) -> Campaigned {
        let (next, finished) = (AtomicU64::new(0), AtomicU64::new(0));
        let all = Mutex::new(Campaigned::default());
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = processors * if self.over_wire { WAITING } else { 1 };
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    loop {
                        let i = next.fetch_add(1, Ordering::Relaxed);
                        if i >= self.captures {
                            break;
                        }
                        let seed = self.seed.wrapping_add(i);
                        let script = match self.over_wire {
                            true => Script::random_over_wire(seed),
                            false => Script::random(seed),
                        };
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
                self.bad += u64::from(carried.bad);
                self.readings += carried.readings;
            }
            Err(wrong) => self.wrong.push(wrong),
        }
    }
}
