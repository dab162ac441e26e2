use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::watch;

use crate::Store;
use crate::refusal::chain;

/// Entries that may wait for the store; beyond, the latest one counts what it stands for.
const WAITING: usize = 256;

/// Who asked what, and what came of it, on its way to the store.
///
/// Whoever notes something waits for nothing. The same thing asked again by the same one is counted, so that however
/// often somebody asks, what waits stays small.
pub(crate) struct Audit {
    waiting: Arc<Mutex<VecDeque<Entry>>>,
    /// Notes so far, and whether no more will come.
    noted: watch::Sender<(u64, bool)>,
    /// Notes that the store has, or has refused.
    written: watch::Receiver<u64>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Entry {
    at: String,
    who: String,
    what: String,
    outcome: String,
    times: u64,
}

impl Audit {
    /// An audit that a task of its own writes to the store.
    pub(crate) fn start(store: Arc<dyn Store>) -> Self {
        let waiting = Arc::new(Mutex::new(VecDeque::new()));
        let (noted, notes) = watch::channel((0, false));
        let (done, written) = watch::channel(0);
        tokio::spawn(write(store, waiting.clone(), notes, done));
        Self {
            waiting,
            noted,
            written,
        }
    }

    /// Notes something. Never waits.
    pub(crate) fn note(&self, at: String, who: &str, what: &str, outcome: &str) {
        let mut waiting = lock(&self.waiting);
        let full = waiting.len() >= WAITING;
        let same = |entry: &&mut Entry| entry.who == who && entry.what == what && entry.outcome == outcome;
        match waiting.iter_mut().rev().find(same) {
            Some(entry) => entry.times += 1,
            None if full => waiting.back_mut().expect("it is full").times += 1,
            None => {
                tracing::info!(who, what, outcome, "asked");
                waiting.push_back(Entry {
                    at,
                    who: who.to_owned(),
                    what: what.to_owned(),
                    outcome: outcome.to_owned(),
                    times: 1,
                });
            }
        }
        drop(waiting);
        self.noted.send_modify(|(notes, _)| *notes += 1);
    }

    /// Waits until everything that was noted is in the store, or was refused by it.
    pub(crate) async fn close(&self) {
        self.noted.send_modify(|(_, closed)| *closed = true);
        let notes = self.noted.borrow().0;
        // An error means that its task has ended.
        let _ = self.written.clone().wait_for(|&written| written >= notes).await;
    }
}

fn lock(waiting: &Mutex<VecDeque<Entry>>) -> MutexGuard<'_, VecDeque<Entry>> {
    waiting.lock().unwrap_or_else(PoisonError::into_inner)
}

async fn write(
    store: Arc<dyn Store>,
    waiting: Arc<Mutex<VecDeque<Entry>>>,
    mut notes: watch::Receiver<(u64, bool)>,
    done: watch::Sender<u64>,
) {
    loop {
        let Ok((noted, closed)) = notes
            .wait_for(|&(noted, closed)| noted > *done.borrow() || closed)
            .await
            .map(|n| *n)
        else {
            return;
        };
        loop {
            // Not held while the store is waited for.
            let next = lock(&waiting).pop_front();
            let Some(entry) = next else { break };
            let outcome = match entry.times {
                1 => entry.outcome,
                times => format!("{} ({times} times)", entry.outcome),
            };
            if let Err(error) = store.audit(&entry.at, &entry.who, &entry.what, &outcome).await {
                let (who, what) = (entry.who, entry.what);
                tracing::error!(who, what, outcome, "not in the audit: {}", chain(&error));
            }
        }
        done.send_replace(noted);
        if closed {
            return;
        }
    }
}
