use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::watch;

use crate::{Event, What};

/// Events that are kept for whoever comes back.
const KEPT: usize = 4096;

/// Events worth telling later that are kept for whoever opens the page.
pub(crate) const TOLD: usize = 100;

/// The events that are kept, shared by all who watch.
#[derive(Debug)]
pub(crate) struct Log {
    kept: Mutex<VecDeque<Event>>,
    /// The latest of those that are worth telling later: the many of a run's steps do not push them out.
    told: Mutex<VecDeque<Event>>,
    last: watch::Sender<Last>,
}

/// How far the log is.
#[derive(Clone, Copy, Debug)]
struct Last {
    id: u64,
    /// Nothing comes any more.
    closed: bool,
}

impl Log {
    /// A log whose ids come after `before`.
    pub(crate) fn new(before: u64) -> Self {
        Self {
            kept: Mutex::new(VecDeque::new()),
            told: Mutex::new(VecDeque::new()),
            last: watch::Sender::new(Last {
                id: before,
                closed: false,
            }),
        }
    }

    /// Tells everyone.
    pub(crate) fn publish(&self, at: String, what: What) {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let id = self.last.borrow().id + 1;
        if kept.len() == KEPT {
            kept.pop_front();
        }
        let event = Event { id, at, what };
        if worth_telling(&event.what) {
            let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
            if told.len() == TOLD {
                told.pop_front();
            }
            told.push_back(event.clone());
        }
        kept.push_back(event);
        // Before another one is let in: two events must not have one id, or whoever reads misses the second.
        self.last.send_modify(|last| last.id = id);
    }

    /// The latest so many events that are worth telling later, oldest first.
    pub(crate) fn latest(&self, most: usize) -> Vec<Event> {
        let told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        told.iter()
            .skip(told.len().saturating_sub(most))
            .cloned()
            .collect()
    }

    /// Lets everyone know that nothing comes any more.
    pub(crate) fn close(&self) {
        self.last.send_modify(|last| last.closed = true);
    }

    /// The first event after an id; where some in between are no longer kept, a gap that stands for them.
    fn after(&self, id: u64) -> Option<Event> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let next = kept.partition_point(|event| event.id <= id);
        let event = kept.get(next)?;
        if event.id == id + 1 {
            return Some(event.clone());
        }
        Some(Event {
            id: event.id - 1,
            at: event.at.clone(),
            what: What::Gap,
        })
    }
}

/// Whether somebody who comes later wants to know of it, rather than only how far the rig is now.
fn worth_telling(what: &What) -> bool {
    match what {
        What::Job { .. }
        | What::Repeat { .. }
        | What::Warning { .. }
        | What::Fault { .. }
        | What::Acknowledged { .. } => true,
        What::Activity { .. }
        | What::Step { .. }
        | What::Reading { .. }
        | What::Progress { .. }
        | What::Gap => false,
    }
}

/// Events as they happen. Whoever reads too slowly is told of a gap, and slows nothing down.
#[derive(Debug)]
pub struct Events {
    log: Arc<Log>,
    last: watch::Receiver<Last>,
    /// Id of the event that was read last.
    seen: u64,
}

impl Events {
    /// Events after an id, or from now on.
    pub(crate) fn new(log: Arc<Log>, after: Option<u64>) -> Self {
        let last = log.last.subscribe();
        let now = last.borrow().id;
        // An id from the future was never given out by this store.
        let seen = after.map_or(now, |after| after.min(now));
        Self { log, last, seen }
    }

    /// The next event; `None` once the daemon has ended and all were read.
    pub async fn next(&mut self) -> Option<Event> {
        loop {
            let closed = self.last.borrow_and_update().closed;
            if let Some(event) = self.log.after(self.seen) {
                self.seen = event.id;
                return Some(event);
            }
            if closed {
                return None;
            }
            self.last.changed().await.ok()?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn warning(n: usize) -> What {
        What::Warning { text: n.to_string() }
    }

    #[test]
    fn events_of_many_threads_have_ids_of_their_own() {
        const EACH: u64 = 2000;
        let log = Log::new(0);
        std::thread::scope(|threads| {
            for _ in 0..4 {
                threads.spawn(|| (0..EACH / 4).for_each(|n| log.publish(String::new(), warning(n as usize))));
            }
        });
        let ids: Vec<u64> = log.kept.lock().unwrap().iter().map(|event| event.id).collect();
        assert_eq!(ids, (1..=EACH).collect::<Vec<_>>());
    }

    #[test]
    fn what_happened_is_told_to_whoever_comes_later_however_many_steps_followed() {
        let log = Log::new(0);
        for n in 0..TOLD + 3 {
            log.publish(String::new(), warning(n));
        }
        for _ in 0..2 * KEPT {
            let activity = crate::Activity::Running;
            log.publish(String::new(), What::Activity { activity });
        }
        let latest = log.latest(2);
        assert_eq!(
            latest.iter().map(|event| &event.what).collect::<Vec<_>>(),
            [&warning(TOLD + 1), &warning(TOLD + 2)]
        );
        assert_eq!(log.latest(usize::MAX).len(), TOLD);
    }

    #[tokio::test]
    async fn whoever_comes_back_gets_what_was_missed_or_is_told_of_a_gap() {
        let log = Arc::new(Log::new(100));
        let mut early = Events::new(log.clone(), None);
        for n in 0..3 {
            log.publish(String::new(), warning(n));
        }
        assert_eq!(early.next().await.map(|event| event.id), Some(101));
        let mut back = Events::new(log.clone(), Some(102));
        let event = back.next().await.unwrap();
        assert_eq!((event.id, event.what), (103, warning(2)));
        let mut old = Events::new(log.clone(), Some(7));
        let event = old.next().await.unwrap();
        assert_eq!((event.id, event.what), (100, What::Gap), "a life before");
        assert_eq!(old.next().await.map(|event| event.id), Some(101));
        for n in 0..KEPT {
            log.publish(String::new(), warning(n));
        }
        let event = early.next().await.unwrap();
        assert_eq!(event.what, What::Gap, "too slow");
        assert_eq!(early.next().await.map(|next| next.id), Some(event.id + 1));
    }
}
