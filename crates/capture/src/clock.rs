/// Ticks of the photometer's clock until it wraps: 24 bits of 10 µs, 168 s.
const WRAP: u64 = 1 << 24;
/// A reading's time is that of mid-integration and may lie so far before what was read since: 10 s, the longest
/// integration.
const BACK: u64 = 1_000_000;

/// The photometer's clock, unwrapped. Must see a time at least every 158 s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct DeviceClock {
    /// The last time, ticks of 10 µs since the photometer was switched on.
    ticks: u64,
}

impl DeviceClock {
    /// Begins at a time that the photometer said, or goes on from what a journal ends with. How often the clock
    /// wrapped, or whether it restarted, between two executions is not known: the least is taken, so that time never
    /// runs backwards.
    pub(crate) fn new(recorded: Option<u64>, ticks: u32) -> Self {
        let recorded = recorded.unwrap_or(0);
        Self {
            ticks: recorded + ahead(recorded, ticks),
        }
    }

    /// Unwraps a time.
    pub(crate) fn unwrap(&mut self, ticks: u32) -> u64 {
        let ahead = ahead(self.ticks, ticks);
        if ahead >= WRAP - BACK {
            return self.ticks.saturating_sub(WRAP - ahead);
        }
        self.ticks += ahead;
        self.ticks
    }

    /// The last time seen.
    pub(crate) fn last(&self) -> u64 {
        self.ticks
    }
}

/// Ticks from `from` to the next moment at which the clock shows `ticks`.
fn ahead(from: u64, ticks: u32) -> u64 {
    (u64::from(ticks) + WRAP - from % WRAP) % WRAP
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wraps_are_counted_and_mid_integration_may_lie_back() {
        let mut clock = DeviceClock::new(None, 16_777_000);
        assert_eq!(clock.unwrap(16_777_200), 16_777_200);
        assert_eq!(clock.unwrap(84), WRAP + 84);
        assert_eq!(
            clock.unwrap(16_777_210),
            16_777_210,
            "mid-integration before the wrap"
        );
        assert_eq!(clock.unwrap(100), WRAP + 100);
    }

    #[test]
    fn a_resumed_run_never_goes_back_in_time() {
        let recorded = WRAP + 5_000_000;
        assert_eq!(DeviceClock::new(Some(recorded), 5_000_100).last(), recorded + 100);
        assert_eq!(
            DeviceClock::new(Some(recorded), 7).last(),
            2 * WRAP + 7,
            "restarted or wrapped"
        );
    }
}
