use std::future::Future;
use std::pin::Pin;
use std::time::Duration;

use tokio::time::Instant;

use super::{Drive, DriveError};
use crate::{Fault, FaultKind, Rig};

/// Pause before a request is repeated: lets time pass where a failure takes none, and a burst of noise end.
const PAUSE: Duration = Duration::from_millis(1);

/// A request to a rig that may be repeated.
pub(super) type Attempt<'a, T, E> = Pin<Box<dyn Future<Output = Result<T, E>> + Send + 'a>>;

impl<R: Rig> Drive<R> {
    /// Repeats a request until it succeeds, fails in a way that repeating cannot mend, or its device has been silent
    /// for the rig file's `silence_ms`. Each repetition is counted.
    pub(super) async fn retry<T>(
        &mut self,
        what: &'static str,
        mut attempt: impl for<'a> FnMut(&'a mut R) -> Attempt<'a, T, R::Error> + Send,
    ) -> Result<T, DriveError<R::Error>> {
        let mut patience = Patience::new(self.file.bus.silence);
        loop {
            match attempt(&mut self.rig).await {
                Ok(value) => return Ok(value),
                Err(error) => {
                    patience.spend(what, error).await?;
                    self.retries += 1;
                }
            }
        }
    }
}

/// How much longer a silent device is asked.
pub(super) struct Patience {
    silence: Duration,
    since: Instant,
    retries: u32,
}

impl Patience {
    pub(super) fn new(silence: Duration) -> Self {
        Self {
            silence,
            since: Instant::now(),
            retries: 0,
        }
    }

    /// Returns where the request is worth repeating.
    ///
    /// # Errors
    /// It is not, or there was silence for too long.
    pub(super) async fn spend<E: Fault>(
        &mut self,
        what: &'static str,
        error: E,
    ) -> Result<(), DriveError<E>> {
        let tried = self.since.elapsed();
        if error.kind() != FaultKind::NoReply || tried >= self.silence {
            return Err(DriveError::Device {
                what,
                retries: self.retries,
                tried,
                source: error,
            });
        }
        tracing::debug!(%error, retries = self.retries, "repeating: {what}");
        self.retries += 1;
        tokio::time::sleep(PAUSE).await;
        Ok(())
    }
}
