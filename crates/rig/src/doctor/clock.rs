use std::time::SystemTime;

use super::Finding;
use crate::WallClock;

/// Whether this computer's clock can be right: calibrations have an age by it.
pub fn clock() -> Finding {
    judged(&WallClock::at(SystemTime::now()))
}

fn judged(clock: &WallClock) -> Finding {
    const CHECK: &str = "clock";
    match clock.fault() {
        None => Finding::ok(CHECK, format!("{}", humantime::format_rfc3339_seconds(clock.now))),
        Some(why) => Finding::warn(
            CHECK,
            why,
            "set the clock, for example with `timedatectl set-ntp true`, before anything is calibrated",
        ),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn a_clock_that_starts_in_1970_is_told() {
        let installed = Some(SystemTime::now());
        let verdict = |now| judged(&WallClock { now, installed }).verdict;
        assert_eq!(verdict(SystemTime::now() + Duration::from_secs(60)), Verdict::Ok);
        assert_eq!(verdict(SystemTime::UNIX_EPOCH), Verdict::Warn);
    }
}
