use std::future::Future;
use std::pin::Pin;
use std::time::Duration;

use tokio::time::Instant;

use super::{Drive, DriveError};
use crate::{Fault, FaultKind, Rig};

/// Pause before a request is repeated: lets time pass where a failure takes none, and a burst of noise end.
const PAUSE: Duration = Duration::from_millis(1);

/// How long a host that nothing keeps waits for one reply that does not come, and a little more.
const ASKED_ONCE: Duration = Duration::from_millis(50);

/// Repetitions before a device counts as silent for so long, however long they took: as many as a host makes that nothing
/// keeps. One that stood still for a while, or shares its processors with too many others, has asked too seldom to tell.
pub(super) fn least(silence: Duration) -> u32 {
    silence.div_duration_f64(ASKED_ONCE).max(4.0) as u32
}

/// A request to a rig that may be repeated.
pub(super) type Attempt<'a, T, E> = Pin<Box<dyn Future<Output = Result<T, E>> + Send + 'a>>;

impl<R: Rig> Drive<R> {
    /// Repeats a request until it succeeds, fails in a way that repeating cannot mend, or its device has been silent
    /// for the rig file's `silence_ms` and a few repetitions. Each repetition is counted.
    pub(super) async fn retry<T>(
        &mut self,
        what: &'static str,
        mut attempt: impl for<'a> FnMut(&'a mut R) -> Attempt<'a, T, R::Error> + Send,
    ) -> Result<T, DriveError<R::Error>> {
        let mut patience = Patience::new(self.file.bus.silence);
        loop {
            let attempted = attempt(&mut self.rig).await;
            self.beat();
            match attempted {
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
        let silent = tried >= self.silence && self.retries >= least(self.silence);
        if error.kind() != FaultKind::NoReply || silent {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Device, RigError};

    #[tokio::test(start_paused = true)]
    async fn a_host_that_stood_still_asks_again() {
        let mut patience = Patience::new(Duration::from_millis(500));
        let silent = || RigError::NoReply {
            device: Device::Sensor,
            id: 2,
        };
        for _ in 0..10 {
            tokio::time::sleep(Duration::from_millis(600)).await;
            patience
                .spend("look", silent())
                .await
                .expect("it was hardly asked");
        }
        let error = patience
            .spend("look", silent())
            .await
            .expect_err("it was asked often enough");
        assert!(error.to_string().contains("tried 11 times"), "{error}");
    }

    #[tokio::test(start_paused = true)]
    async fn a_device_that_is_asked_often_has_its_time() {
        let mut patience = Patience::new(Duration::from_millis(500));
        let begun = Instant::now();
        let silent = || RigError::NoReply {
            device: Device::Light,
            id: 1,
        };
        while patience.spend("look", silent()).await.is_ok() {}
        let took = begun.elapsed();
        assert!((500..510).contains(&took.as_millis()), "{took:?}");
    }
}
