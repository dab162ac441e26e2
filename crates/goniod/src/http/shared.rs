use std::ops::Deref;
use std::sync::Arc;

use tokio::sync::{Semaphore, watch};

use super::access::Access;
use super::metrics::Metrics;
use crate::Daemon;

/// What every request handler may use.
#[derive(Clone)]
pub(crate) struct Shared(Arc<Parts>);

pub(crate) struct Parts {
    pub(crate) daemon: Daemon,
    pub(crate) access: Access,
    pub(crate) metrics: Metrics,
    /// One permit for each stream of events that may be open.
    pub(crate) streams: Arc<Semaphore>,
    /// Turns true when the daemon ends: streams end then, since nothing else would end them.
    pub(crate) closing: watch::Receiver<bool>,
}

impl Shared {
    pub(crate) fn new(parts: Parts) -> Self {
        Self(Arc::new(parts))
    }
}

impl Deref for Shared {
    type Target = Parts;
    fn deref(&self) -> &Parts {
        &self.0
    }
}
