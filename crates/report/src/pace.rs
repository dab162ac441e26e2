use capture::Record;
use rig::RigFile;
use serde::Serialize;

use crate::Run;

/// How long a run took beside what its motion, settling and light demand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pace {
    /// Rig time of the run, s: of all executions, with holds and exposures that do not count.
    pub taken_s: f64,
    /// What its readings would have taken at the least with a rest for each ([`sweep::floor_s`]), s; from the first one's
    /// pose on.
    pub floor_s: f64,
    /// `taken_s` over `floor_s`. Below 1 only where arms were read in flight.
    pub ratio: f64,
    /// Readings that were taken in flight.
    pub in_flight: usize,
}

impl Pace {
    /// Of a run with these records; `None` where no reading counts.
    pub(crate) fn new(run: &Run, records: &[Record], rig: &RigFile) -> Option<Self> {
        let accepted = records.iter().filter_map(|record| match record {
            Record::Reading(reading) if reading.accepted => Some(reading),
            _ => None,
        });
        let accepted: Vec<_> = accepted.collect();
        if accepted.is_empty() {
            return None;
        }
        let readings = accepted
            .iter()
            .map(|reading| (reading.goal, reading.counts.exposure.duration().as_secs_f64()));
        let floor_s = sweep::floor_s(&capture::mechanics(rig, None), None, readings);
        Some(Self {
            taken_s: run.seconds.total,
            floor_s,
            ratio: run.seconds.total / floor_s,
            in_flight: accepted
                .iter()
                .filter(|reading| reading.swept_rad.is_some())
                .count(),
        })
    }

    /// In a few words.
    pub(crate) fn text(&self) -> String {
        let Self {
            taken_s,
            floor_s,
            ratio,
            in_flight,
        } = self;
        let least =
            format!("{taken_s:.1} s, {ratio:.2} × the {floor_s:.1} s that motion, settling and light take");
        match in_flight {
            0 => least,
            n => format!("{least} if the arms rest for each reading; {n} were taken in flight"),
        }
    }
}
