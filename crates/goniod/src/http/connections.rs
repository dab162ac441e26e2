use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;
use tokio::sync::futures::Notified;
use tokio::time::Instant;

/// Of so many slots one is kept for connections that have only just come: whoever stops the rig may come as a new one.
const SLOTS_PER_NEWCOMER: usize = 8;

/// The open connections of one listener, and which of them is closed where there is no room for another.
///
/// All clients behind a proxy have one address, so addresses say nothing. What counts is for whom the daemon waits:
/// a client that sends nothing, or takes nothing of its answer, goes before one for which the daemon works or which
/// keeps up with a stream of events, and a stream goes last; among equals, the one whose last byte passed the longest
/// ago. The newest few stay,
/// or one that stops the rig could be closed before its request was read, and whoever stops the rig stays.
pub(crate) struct Connections {
    slots: usize,
    open: Mutex<BTreeMap<u64, Arc<Connection>>>,
    next: AtomicU64,
    closed: Notify,
}

/// One connection, and what is known of its client.
pub(crate) struct Connection {
    state: Mutex<State>,
    close: Notify,
}

/// What passes over a connection.
#[derive(Clone, Copy, Debug, PartialEq)]
struct State {
    /// When a byte passed last.
    progress: Instant,
    /// Requests that are being answered, their answers' bodies included.
    answering: u32,
    /// Whether one of them is a stream of events.
    streaming: bool,
    /// Those among them that stop the rig.
    stopping: u32,
    /// Whether a request waits for more of its body.
    wants_body: bool,
    /// Whether the client takes nothing of what is to be sent.
    blocked: bool,
}

/// What a connection is worth: the least is closed first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Worth {
    stops: bool,
    /// A stream of events is quiet as long as nothing happens, and there are few of them.
    follows_events: bool,
    served: bool,
    progress: Instant,
}

impl State {
    fn worth(&self) -> Worth {
        let served = self.answering > 0 && !self.wants_body && !self.blocked;
        Worth {
            stops: self.stopping > 0,
            follows_events: served && self.streaming,
            served,
            progress: self.progress,
        }
    }
}

impl Connection {
    fn new() -> Self {
        let state = State {
            progress: Instant::now(),
            answering: 0,
            streaming: false,
            stopping: 0,
            wants_body: false,
            blocked: false,
        };
        Self {
            state: Mutex::new(state),
            close: Notify::new(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn worth(&self) -> Worth {
        self.state().worth()
    }

    /// A byte passed, in either direction.
    pub(crate) fn progress(&self) {
        self.state().progress = Instant::now();
    }

    /// Whether the client takes nothing of what is to be sent.
    pub(crate) fn blocked(&self, blocked: bool) {
        self.state().blocked = blocked;
    }

    /// Whether a request waits for more of its body.
    pub(crate) fn wants_body(&self, wants: bool) {
        self.state().wants_body = wants;
    }

    /// A request is being answered until what is returned is dropped.
    pub(crate) fn answer(self: &Arc<Self>) -> Answering {
        let mut state = self.state();
        state.answering += 1;
        state.progress = Instant::now();
        Answering(Arc::clone(self))
    }

    /// What is asked for now is a stream of events, or something else.
    pub(crate) fn streams(&self, streams: bool) {
        self.state().streaming = streams;
    }

    /// The rig is being stopped until what is returned is dropped.
    pub(crate) fn stop(self: &Arc<Self>) -> Stopping {
        self.state().stopping += 1;
        Stopping(Arc::clone(self))
    }

    /// Returns when its slot was given to another, or the listener ended.
    pub(crate) async fn closed(&self) {
        self.close.notified().await;
    }
}

/// Counts a request as being answered.
pub(crate) struct Answering(Arc<Connection>);

impl Drop for Answering {
    fn drop(&mut self) {
        let mut state = self.0.state();
        state.answering -= 1;
        state.progress = Instant::now();
    }
}

/// Counts a request as stopping the rig.
pub(crate) struct Stopping(Arc<Connection>);

impl Drop for Stopping {
    fn drop(&mut self) {
        self.0.state().stopping -= 1;
    }
}

/// A slot that a connection has taken, until this is dropped.
pub(crate) struct Slot {
    id: u64,
    connections: Arc<Connections>,
    pub(crate) connection: Arc<Connection>,
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.connections.open().remove(&self.id);
        self.connections.closed.notify_waiters();
    }
}

impl Connections {
    /// So many may be open at a time.
    pub(crate) fn new(slots: usize) -> Arc<Self> {
        Arc::new(Self {
            slots: slots.max(1),
            open: Mutex::default(),
            next: AtomicU64::new(0),
            closed: Notify::new(),
        })
    }

    fn open(&self) -> MutexGuard<'_, BTreeMap<u64, Arc<Connection>>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A slot for a new connection, and whether another was closed to make room.
    pub(crate) fn take(self: &Arc<Self>) -> (Slot, bool) {
        let full = self.open().len() >= self.slots;
        let made_room = full && self.close_one();
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        let connection = Arc::new(Connection::new());
        self.open().insert(id, Arc::clone(&connection));
        let slot = Slot {
            id,
            connections: Arc::clone(self),
            connection,
        };
        (slot, made_room)
    }

    /// Closes the connection that is worth least; false where none is open.
    pub(crate) fn close_one(&self) -> bool {
        let mut open = self.open();
        let newest = self.slots.div_ceil(SLOTS_PER_NEWCOMER);
        let old = open.len().saturating_sub(newest);
        // Where only newcomers are left, one of them goes.
        let candidates = if old == 0 { open.len() } else { old };
        let least = open
            .iter()
            .take(candidates)
            .min_by_key(|(_, connection)| connection.worth())
            .map(|(&id, _)| id);
        let Some(connection) = least.and_then(|id| open.remove(&id)) else {
            return false;
        };
        connection.close.notify_one();
        true
    }

    /// Closes all.
    pub(crate) fn close_all(&self) {
        while self.close_one() {}
    }

    /// Returns when a connection has been closed since this was called.
    pub(crate) fn one_closed(&self) -> Notified<'_> {
        self.closed.notified()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    /// Ids of those that are open.
    fn left(connections: &Connections) -> Vec<u64> {
        connections.open().keys().copied().collect()
    }

    /// So many slots, taken one second after the other.
    async fn full(slots: usize) -> (Arc<Connections>, Vec<Slot>) {
        let connections = Connections::new(slots);
        let mut taken = Vec::new();
        for _ in 0..slots {
            taken.push(connections.take().0);
            tokio::time::advance(Duration::from_secs(1)).await;
        }
        (connections, taken)
    }

    #[tokio::test(start_paused = true)]
    async fn a_new_connection_always_has_a_slot_and_never_more_are_open_than_there_are() {
        for slots in 1..20 {
            let (connections, mut taken) = full(slots).await;
            for _ in 0..100 {
                let (slot, made_room) = connections.take();
                assert!(made_room);
                let open = left(&connections);
                assert_eq!(open.len(), slots);
                assert_eq!(open.last(), Some(&slot.id), "the new one is in");
                taken.push(slot);
            }
        }
    }

    #[tokio::test(start_paused = true)]
    async fn the_client_that_was_waited_for_longest_goes_first() {
        let (connections, taken) = full(16).await;
        taken[0].connection.progress();
        let _new = connections.take();
        assert!(!left(&connections).contains(&1));
        assert!(left(&connections).contains(&0));
    }

    #[tokio::test(start_paused = true)]
    async fn what_is_served_outlives_what_sends_nothing_or_takes_nothing() {
        let (connections, taken) = full(16).await;
        let answering: Vec<_> = taken
            .iter()
            .take(3)
            .map(|slot| slot.connection.answer())
            .collect();
        taken[1].connection.blocked(true);
        taken[2].connection.wants_body(true);
        tokio::time::advance(Duration::from_secs(60)).await;
        // All that wait are busier than the one that is served.
        for slot in &taken[1..] {
            slot.connection.progress();
        }
        let newcomers: Vec<_> = (0..50).map(|_| connections.take().0).collect();
        assert!(left(&connections).contains(&0), "it is served");
        assert!(!left(&connections).contains(&1), "it takes nothing");
        assert!(!left(&connections).contains(&2), "it sends nothing");
        drop((answering, newcomers));
    }

    #[tokio::test(start_paused = true)]
    async fn whoever_stops_the_rig_stays_while_others_can_go() {
        let (connections, taken) = full(16).await;
        let _stopping = taken[0].connection.stop();
        let _answering: Vec<_> = taken[1..].iter().map(|slot| slot.connection.answer()).collect();
        tokio::time::advance(Duration::from_secs(60)).await;
        let _newcomers: Vec<_> = (0..200).map(|_| connections.take().0).collect();
        assert!(left(&connections).contains(&0));
    }

    #[tokio::test(start_paused = true)]
    async fn a_newcomer_is_not_closed_by_the_next_though_all_others_are_served() {
        let (connections, taken) = full(16).await;
        let _answering: Vec<_> = taken.iter().map(|slot| slot.connection.answer()).collect();
        let (first, _) = connections.take();
        let (_second, _) = connections.take();
        assert!(left(&connections).contains(&first.id));
    }

    #[tokio::test(start_paused = true)]
    async fn a_slot_is_free_again_once_its_connection_has_ended() {
        let (connections, mut taken) = full(4).await;
        taken.pop();
        assert!(!connections.take().1, "there was room");
    }
}
