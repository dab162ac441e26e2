use std::time::{Duration, Instant};

use super::{Bin, Finding, Verdict};
use crate::{Detector, Drive, Rig};

/// Questions that are asked: enough for a 99th percentile, over in a second or two even at 16 ms each.
const QUESTIONS: usize = 200;

/// Upper ends of the histogram's bins, ms.
const BINS_MS: [f64; 8] = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0];

/// Share of lost replies with which a run makes no headway.
const LOST_MAX: f64 = 0.05;

/// Bits on the wire of one question about the photometer's status and its reply.
const WIRE_BITS: f64 = 330.0;

/// How long the photometer takes to answer a question about its status, over and over; nothing is repeated. `timer` is
/// what was found about the adapter's latency timer, where somebody looked.
pub async fn round_trip<R: Rig>(drive: &mut Drive<R>, timer: Option<Verdict>) -> Finding {
    let mut taken = Vec::with_capacity(QUESTIONS);
    for _ in 0..QUESTIONS {
        let asked = Instant::now();
        if drive.rig().photometer().status().await.is_ok() {
            taken.push(asked.elapsed());
        }
    }
    let bus = &drive.file().bus;
    let expected_ms = bus.latency.as_secs_f64() * 1e3 + WIRE_BITS / f64::from(bus.baud) * 1e3;
    judged(&mut taken, expected_ms, timer)
}

fn judged(taken: &mut [Duration], expected_ms: f64, timer: Option<Verdict>) -> Finding {
    const CHECK: &str = "round trip";
    let lost = QUESTIONS - taken.len();
    taken.sort_unstable();
    let at = |share: f64| {
        let index = (taken.len().saturating_sub(1) as f64 * share).round() as usize;
        taken.get(index).map_or(f64::NAN, |time| time.as_secs_f64() * 1e3)
    };
    let median_ms = at(0.5);
    let text = format!(
        "median {median_ms:.2} ms, 99 % {:.2} ms, longest {:.2} ms; {lost} of {QUESTIONS} replies lost",
        at(0.99),
        at(1.0)
    );
    let cabling =
        "check cables, ground and termination, the return delays, and that no other program is on the bus";
    let mut finding = if lost as f64 > LOST_MAX * QUESTIONS as f64 {
        Finding::fail(CHECK, text, cabling)
    } else if lost > 0 {
        Finding::warn(CHECK, text, cabling)
    } else if median_ms > expected_ms {
        let cause = match timer {
            // There it is already as it should be, or the adapter has none.
            Some(Verdict::Ok) => "look what else loads this computer or its USB hub",
            _ => "set the adapter's latency timer to 1 ms",
        };
        let remedy = format!(
            "expected below {expected_ms:.2} ms: {cause}, or set bus.latency_ms = {:.0}",
            median_ms.ceil()
        );
        Finding::warn(CHECK, text, remedy)
    } else {
        Finding::ok(CHECK, text)
    };
    finding.histogram = histogram(taken);
    finding
}

fn histogram(taken: &[Duration]) -> Vec<Bin> {
    let mut low = 0.0;
    let ends = BINS_MS.map(Some).into_iter().chain([None]);
    ends.map(|below_ms| {
        let high = below_ms.unwrap_or(f64::INFINITY);
        let within = |time: &&Duration| (low..high).contains(&(time.as_secs_f64() * 1e3));
        let count = taken.iter().filter(within).count();
        low = high;
        Bin { below_ms, count }
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judge(ms: f64, count: usize) -> Finding {
        judged(&mut vec![Duration::from_secs_f64(ms / 1e3); count], 2.3, None)
    }

    #[test]
    fn the_latency_timer_is_not_blamed_where_it_is_right() {
        let judge = |timer| judged(&mut vec![Duration::from_millis(16); QUESTIONS], 2.3, timer);
        let remedy = judge(Some(Verdict::Ok)).remedy.unwrap();
        assert!(
            !remedy.contains("latency timer") && remedy.contains("bus.latency_ms = 16"),
            "{remedy}"
        );
        let remedy = judge(Some(Verdict::Warn)).remedy.unwrap();
        assert!(remedy.contains("latency timer"), "{remedy}");
    }

    #[test]
    fn slow_and_lost_replies_are_told() {
        assert_eq!(judge(1.1, QUESTIONS).verdict, Verdict::Ok);
        let slow = judge(15.9, QUESTIONS);
        assert_eq!(slow.verdict, Verdict::Warn);
        assert!(slow.remedy.unwrap().contains("latency timer"));
        assert_eq!(judge(1.1, QUESTIONS - 1).verdict, Verdict::Warn);
        assert_eq!(judge(1.1, QUESTIONS / 2).verdict, Verdict::Fail);
        assert_eq!(judge(1.1, 0).verdict, Verdict::Fail);
    }

    #[test]
    fn every_round_trip_is_in_one_bin() {
        let times = [0.0, 0.25, 0.9, 31.9, 32.0, 500.0].map(|ms| Duration::from_secs_f64(ms / 1e3));
        let bins = histogram(&times);
        assert_eq!(
            bins.iter().map(|bin| bin.count).collect::<Vec<_>>(),
            [1, 1, 1, 0, 0, 0, 0, 1, 2]
        );
        assert_eq!(bins.last().unwrap().below_ms, None);
    }
}
