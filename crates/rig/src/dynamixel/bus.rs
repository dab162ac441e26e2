use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;

use tokio::sync::{mpsc, oneshot};

use super::line::{Cause, Failure, Line, Reply, Request};
use crate::{BusSettings, RigError};

/// Transactions that may wait for the line; callers beyond it wait for a place.
const QUEUE: usize = 16;

type Outcome = Result<Vec<Reply>, Failure>;

/// Handle of the bus. One thread owns the line and makes one transaction after the other; a caller that goes away
/// does not cancel its transaction half-way. The port is released when the last handle is dropped.
#[derive(Clone, Debug)]
pub(super) struct Bus {
    worker: Arc<Worker>,
}

impl Bus {
    /// Opens and locks the port; sends nothing.
    pub(super) fn open(path: &Path, settings: &BusSettings) -> Result<Self, RigError> {
        let mut line = Line::open(path, settings)?;
        let (queue, mut requests) = mpsc::channel::<(Request, oneshot::Sender<Outcome>)>(QUEUE);
        let thread = std::thread::Builder::new()
            .name("rig-bus".to_owned())
            .spawn(move || {
                while let Some((request, caller)) = requests.blocking_recv() {
                    // A caller that went away does not want to know.
                    let _ = caller.send(line.transact(&request));
                }
            })
            .map_err(|source| RigError::Thread { source })?;
        Ok(Self {
            worker: Arc::new(Worker {
                queue: Some(queue),
                thread: Some(thread),
            }),
        })
    }

    /// One transaction.
    pub(super) async fn transact(&self, request: Request) -> Outcome {
        let id = request.id;
        let ended = || Failure {
            id,
            cause: Cause::Gone(std::io::Error::other("the bus thread has ended")),
        };
        let queue = self.worker.queue.as_ref().ok_or_else(ended)?;
        let (sender, outcome) = oneshot::channel();
        queue.send((request, sender)).await.map_err(|_| ended())?;
        outcome.await.map_err(|_| ended())?
    }
}

#[derive(Debug)]
struct Worker {
    queue: Option<mpsc::Sender<(Request, oneshot::Sender<Outcome>)>>,
    thread: Option<JoinHandle<()>>,
}

/// Waits for the transaction in progress, some milliseconds at most: whoever drops a rig may open its port again.
impl Drop for Worker {
    fn drop(&mut self) {
        self.queue = None;
        if let Some(thread) = self.thread.take() {
            // It has no panic to report: those of a transaction are caught.
            let _ = thread.join();
        }
    }
}
