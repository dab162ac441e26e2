use std::time::{Duration, SystemTime};

/// By how much two clocks may differ without either being wrong: adjusted by the network, or written by another host.
const SLACK: Duration = Duration::from_secs(600);
/// No program is used so long after it was installed: ten years.
const LONG: Duration = Duration::from_secs(10 * 365 * 24 * 3600);

/// What this computer's clock says, and since when it must be later: the date of the program's own file.
///
/// A clock without a battery starts in 1970, and one that was set by hand may be years ahead. What is dated by it is
/// dated wrongly, and whatever has an age is then too young or too old.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WallClock {
    /// What it says.
    pub now: SystemTime,
    /// When the program's file was written; `None` where the system does not say.
    pub installed: Option<SystemTime>,
}

impl WallClock {
    /// What the clock says, with the date of the running program's file.
    pub fn at(now: SystemTime) -> Self {
        let file = std::env::current_exe().and_then(|path| path.metadata()?.modified());
        Self {
            now,
            installed: file.ok(),
        }
    }

    /// Why it cannot be right, in a sentence with what to do; `None` where nothing speaks against it.
    pub fn fault(&self) -> Option<String> {
        let installed = self.installed?;
        let against = if self.is_before(installed) {
            "before"
        } else if self.now.duration_since(installed).is_ok_and(|since| since > LONG) {
            "more than ten years after"
        } else {
            return None;
        };
        Some(format!(
            "the clock of this computer says {}, {against} this program was installed ({}): set the clock; if it is right, \
             install the program anew",
            written(self.now),
            written(installed)
        ))
    }

    /// Whether it says a time before one that has already been.
    pub fn is_before(&self, past: SystemTime) -> bool {
        past.duration_since(self.now).is_ok_and(|ahead| ahead > SLACK)
    }
}

/// RFC 3339, UTC, whole seconds.
fn written(time: SystemTime) -> String {
    humantime::format_rfc3339_seconds(time).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(now: &str, installed: &str) -> WallClock {
        let time = |text| humantime::parse_rfc3339(text).unwrap();
        WallClock {
            now: time(now),
            installed: Some(time(installed)),
        }
    }

    #[test]
    fn a_clock_before_the_program_or_ten_years_after_it_cannot_be_right() {
        let installed = "2026-03-01T12:00:00Z";
        let fault = |now| clock(now, installed).fault();
        for now in [
            "2026-03-01T11:55:00Z",
            "2026-03-01T12:00:01Z",
            "2035-12-31T00:00:00Z",
        ] {
            assert_eq!(fault(now), None, "{now}");
        }
        for (now, why) in [
            ("1970-01-01T00:00:00Z", "before this program"),
            ("2026-03-01T11:00:00Z", "before this program"),
            ("2037-01-01T00:00:00Z", "more than ten years after"),
        ] {
            let text = fault(now).unwrap();
            assert!(
                text.contains(why) && text.contains(now) && text.contains(installed),
                "{text}"
            );
        }
    }

    #[test]
    fn the_clock_of_a_test_is_taken_for_right() {
        assert_eq!(WallClock::at(SystemTime::now()).fault(), None);
    }
}
