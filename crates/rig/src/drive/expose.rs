use std::time::Duration;

use super::rest::Looks;
use super::retry::Patience;
use super::{Drive, DriveError, Rest};
use crate::{Counts, Detector, Exposure, Fault, FaultKind, Rig};

/// Sequence numbers have 24 bits (docs/photometer.md).
const SEQUENCE_MODULUS: u32 = 1 << 24;
/// So has its clock.
const TICKS_MODULUS: u32 = 1 << 24;

/// Time between two looks at an integration that should have ended.
const POLL: Duration = Duration::from_millis(1);

/// Time between two looks at the arms while it runs: several in a tremble of 20 Hz.
const SIGHT: Duration = Duration::from_millis(10);

impl<R: Rig> Drive<R> {
    /// Takes one reading: triggers once, waits for the integration, reads the counts.
    ///
    /// A trigger whose acknowledgement was lost is looked for in the sequence number before another one is sent, so
    /// that nothing is exposed twice.
    ///
    /// # Errors
    /// A silent or failing photometer; a reading that is not the one triggered.
    pub async fn expose(&mut self, exposure: Exposure) -> Result<Counts, DriveError<R::Error>> {
        self.expose_at_rest(exposure).await.map(|(counts, _)| counts)
    }

    /// As [`Drive::expose`], and where the arms were: looked at before, during and after the integration.
    ///
    /// # Errors
    /// As [`Drive::expose`] and [`Drive::snapshot`].
    pub async fn expose_at_rest(
        &mut self,
        exposure: Exposure,
    ) -> Result<(Counts, Rest), DriveError<R::Error>> {
        let mut looks = Looks::default();
        let seen = self.observe().await?;
        looks.push(Duration::ZERO, seen.snapshot.pose());
        let begun = seen.ticks;
        let expected = self.trigger(seen.snapshot.detector.sequence, exposure).await?;
        let wrong = |found: String| DriveError::Reading {
            expected,
            exposure,
            found,
        };
        let waited = self.waited;
        let mut left = exposure.duration();
        loop {
            self.wait(left.clamp(POLL.min(exposure.duration()), SIGHT))
                .await?;
            let seen = self.observe().await?;
            let ticks = seen.ticks.wrapping_sub(begun) % TICKS_MODULUS;
            let passed = Duration::from_micros(10 * u64::from(ticks));
            looks.push(passed, seen.snapshot.pose());
            match seen.counts {
                Some(counts) if counts.sequence != expected => {
                    return Err(wrong(format!("reading {} came", counts.sequence)));
                }
                Some(counts) if counts.exposure != exposure => {
                    return Err(wrong(format!("it was taken with {:?}", counts.exposure)));
                }
                Some(counts) => return Ok((counts, looks.all())),
                None if self.waited - waited > exposure.duration() + self.patience(exposure) => {
                    return Err(wrong("still integrating".to_owned()));
                }
                None => left = exposure.duration().saturating_sub(passed),
            }
        }
    }

    /// Starts one integration, `before` being the sequence number of the photometer's latest reading, and returns that
    /// of the reading to come.
    ///
    /// # Errors
    /// A silent or failing photometer; one that another program triggers too.
    pub async fn trigger(&mut self, before: u32, exposure: Exposure) -> Result<u32, DriveError<R::Error>> {
        let expected = (before + 1) % SEQUENCE_MODULUS;
        let mut patience = Patience::new(self.file.bus.silence);
        while let Err(error) = self.rig.photometer().trigger(exposure).await {
            let lost = error.kind() == FaultKind::NoReply;
            patience.spend("trigger the photometer", error).await?;
            self.retries += 1;
            let now = self.sequence().await?;
            if lost && now == expected {
                break;
            }
            if now != before {
                return Err(DriveError::Reading {
                    expected,
                    exposure,
                    found: format!("sequence number went from {before} to {now}"),
                });
            }
        }
        Ok(expected)
    }

    /// For how long a reading may be late: an instrument elsewhere ends its own by its own time limits.
    fn patience(&self, exposure: Exposure) -> Duration {
        let detector = &self.file.detector;
        match detector.on_bus() {
            true => self.file.motion.timeout,
            false => self.file.motion.timeout + detector.longest(exposure.duration()),
        }
    }

    async fn sequence(&mut self) -> Result<u32, DriveError<R::Error>> {
        let status = self
            .retry("read the photometer's status", |rig| {
                Box::pin(rig.photometer().status())
            })
            .await?;
        Ok(status.sequence)
    }
}
