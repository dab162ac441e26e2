use std::ops::Deref;
use std::sync::Arc;

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use tokio::sync::{Semaphore, watch};

use super::access::Access;
use super::metrics::Metrics;
use super::problem::Problem;
use crate::Daemon;

/// Requests that plan, or read much of the store, at a time; further ones wait. More would take the processor from
/// those that stop the rig.
pub(super) const WORKING: usize = 2;

/// What every request handler may use.
#[derive(Clone)]
pub(crate) struct Shared(Arc<Parts>);

pub(crate) struct Parts {
    pub(crate) daemon: Daemon,
    pub(crate) access: Access,
    pub(crate) metrics: Metrics,
    /// One permit for each request that may plan, or read much of the store.
    pub(crate) working: Arc<Semaphore>,
    /// One permit for each stream of events that may be open.
    pub(crate) streams: Arc<Semaphore>,
    /// Turns true when the daemon ends: streams end then, since nothing else would end them.
    pub(crate) closing: watch::Receiver<bool>,
}

impl Shared {
    pub(crate) fn new(parts: Parts) -> Self {
        Self(Arc::new(parts))
    }

    /// Carries out what plans, or reads much of the store: a few at a time, and to its end though the client is gone,
    /// because what was begun on another thread cannot be taken back.
    pub(crate) async fn work<T: Send + 'static>(
        &self,
        work: impl Future<Output = Result<T, Problem>> + Send + 'static,
    ) -> Result<T, Problem> {
        let failed = || Problem::of(StatusCode::INTERNAL_SERVER_ERROR);
        let permit = Arc::clone(&self.working).acquire_owned().await;
        let permit = permit.map_err(|_| failed())?;
        let done = tokio::spawn(async move {
            let _permit = permit;
            work.await
        });
        done.await.map_err(|_| failed())?
    }
}

impl Deref for Shared {
    type Target = Parts;
    fn deref(&self) -> &Parts {
        &self.0
    }
}

/// A long answer in JSON, written on a thread where it keeps no connection waiting.
pub(crate) async fn long_json(value: impl Serialize + Send + 'static) -> Result<Response, Problem> {
    let text = tokio::task::spawn_blocking(move || serde_json::to_vec(&value)).await;
    match text {
        Ok(Ok(text)) => Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response()),
        Ok(Err(_)) | Err(_) => Err(Problem::of(StatusCode::INTERNAL_SERVER_ERROR)),
    }
}
