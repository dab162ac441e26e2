use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU64, Ordering};

use governor::{DefaultDirectRateLimiter, Quota, RateLimiter};

/// Refusals on their way to the log: so many a second one by one, the others by their number.
pub(crate) struct Refusals {
    limit: DefaultDirectRateLimiter,
    unlogged: AtomicU64,
}

impl Refusals {
    /// Logs at most `per_second` a second.
    pub(crate) fn new(per_second: NonZeroU32) -> Self {
        Self {
            limit: RateLimiter::direct(Quota::per_second(per_second)),
            unlogged: AtomicU64::new(0),
        }
    }

    /// Logs a refusal, given how many before it were not logged; or counts it.
    pub(crate) fn log(&self, log: impl FnOnce(u64)) {
        if self.limit.check().is_ok() {
            log(self.unlogged.swap(0, Ordering::Relaxed));
        } else {
            self.unlogged.fetch_add(1, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_logged_is_counted_in_what_is() {
        let refusals = Refusals::new(NonZeroU32::new(3).unwrap());
        let mut logged = 0;
        // More than a burst, however slowly this runs.
        while refusals.unlogged.load(Ordering::Relaxed) == 0 {
            refusals.log(|unlogged| {
                assert_eq!(unlogged, 0);
                logged += 1;
            });
        }
        assert!(logged >= 3);
        let mut told = 0;
        let mut tries = 0;
        while told == 0 {
            refusals.log(|unlogged| told = unlogged);
            tries += 1;
        }
        assert_eq!(
            told, tries,
            "each one before it, and the one that was counted above"
        );
    }
}
