use std::time::{Duration, SystemTime};

use tokio::time::Instant;

/// When the devices heard from this program last, and how long they did not while their watchdogs were armed.
///
/// A computer that sleeps, or a program that is stopped (Ctrl-Z), says nothing to the devices, so their watchdogs stop
/// the arms and put the lamp out. What is seen of that afterwards looks like a fault of a device, and is none.
#[derive(Debug, Default)]
pub(super) struct Pulse {
    last: Option<(Instant, SystemTime)>,
    gap: Option<Duration>,
    /// Whether a reading was sound since the gap: it may have been under way when that began.
    doubted: bool,
}

impl Pulse {
    /// Notes that a request has ended. `limit` is the time of the watchdogs, where they were armed since the last one.
    pub(super) fn beat(&mut self, limit: Option<Duration>) {
        let now = (Instant::now(), SystemTime::now());
        if let (Some((instant, wall)), Some(limit)) = (self.last, limit) {
            // The monotonic clock stands still while a computer sleeps; the wall clock does not, but may be set.
            let asleep = now.1.duration_since(wall).unwrap_or_default();
            let gap = (now.0 - instant).max(asleep);
            if gap > limit {
                self.gap = self.gap.max(Some(gap));
                self.doubted = true;
            }
        }
        self.last = Some(now);
    }

    /// The longest time since [`Self::forget`] in which no device heard anything.
    pub(super) fn gap(&self) -> Option<Duration> {
        self.gap
    }

    /// Forgets it: nothing that comes now can come of it.
    pub(super) fn forget(&mut self) {
        self.gap = None;
    }

    /// Notes that a reading was sound. The second one since a gap shows that nothing came of it; the first may have been
    /// under way when the gap began, while lamp and arms were still what they should be.
    pub(super) fn sound(&mut self) {
        if !std::mem::take(&mut self.doubted) {
            self.forget();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: Duration = Duration::from_millis(300);

    #[tokio::test(start_paused = true)]
    async fn a_gap_counts_only_where_watchdogs_were_armed() {
        let mut pulse = Pulse::default();
        pulse.beat(Some(LIMIT));
        for (silent_ms, limit, gap_ms) in [
            (200, Some(LIMIT), None),
            (5000, None, None),
            (301, Some(LIMIT), Some(301)),
            (100, Some(LIMIT), Some(301)),
            (900, Some(LIMIT), Some(900)),
        ] {
            tokio::time::advance(Duration::from_millis(silent_ms)).await;
            pulse.beat(limit);
            assert_eq!(pulse.gap().map(|gap| gap.as_millis()), gap_ms, "{silent_ms} ms");
        }
        pulse.sound();
        assert_eq!(pulse.gap().map(|gap| gap.as_millis()), Some(900));
        pulse.sound();
        assert_eq!(pulse.gap(), None);
    }
}
