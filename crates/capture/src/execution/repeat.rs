use rig::{Counts, Rig};
use sweep::Sweep;

use super::{Execution, Interrupt, readings};
use crate::{Event, Flag, Reading, Record};

/// So many of the latest readings are measured again, and so many of the faintest since the room was last seen to be dark:
/// light from outside that flickers is missed by a short exposure now and then, and where a lobe is bright it does not show.
const LATEST: usize = 6;
const FAINTEST: usize = 4;

impl<R: Rig> Execution<'_, R> {
    /// Measures poses of the finished part again, the latest first, and records by how much they differ.
    pub(super) async fn repeat(&mut self) -> Result<(), Interrupt<R::Error>> {
        let references: Vec<Reading> = references(self.journal.records()).cloned().collect();
        if !references.is_empty() {
            self.switch_lamp(true).await?;
        }
        for before in references {
            self.repeat_one(&before).await?;
        }
        Ok(())
    }

    async fn repeat_one(&mut self, before: &Reading) -> Result<(), Interrupt<R::Error>> {
        let retries = self.drive.retries();
        // In flight a reading is not taken at its step's pose itself.
        let taken = self.file.nearest(before.measured);
        let there = before.swept_rad.is_some() && self.file.envelope.check_pose(taken).is_ok();
        self.travel_anew(if there { taken } else { before.goal }).await?;
        let (counts, rest) = self.drive.expose_at_rest(before.counts.exposure).await?;
        if self.lamp_is_out(&counts) {
            return Err(Interrupt::Lamp);
        }
        let mut reading = Reading {
            accepted: false,
            sweep: Sweep::Repeat,
            swept_rad: None,
            measured: rest.pose,
            spread_rad: Some(rest.spread_rad),
            counts,
            device_ticks: self.clock.unwrap(counts.ticks),
            retries: self.drive.retries() - retries,
            ..before.clone()
        };
        reading.flags = self.flags(&reading);
        let difference_rel = difference_rel(&before.counts, &counts);
        let repeat = Record::Repeat {
            reading: reading.clone(),
            difference_rel,
        };
        self.append(&repeat).await?;
        self.mark = self.clock.last();
        self.emit(Event::Repeat {
            reading: Box::new(reading),
            difference_rel,
        });
        Ok(())
    }
}

/// The readings that are measured again when a run goes on, of those that are bright enough and not too bright.
fn references(records: &[Record]) -> impl Iterator<Item = &Reading> {
    let sound = |reading: &&Reading| {
        let poor = [Flag::Saturated, Flag::Dim];
        reading.accepted && reading.lamp && !reading.flags.iter().any(|flag| poor.contains(flag))
    };
    let mut latest: Vec<&Reading> = readings(before(records)).filter(sound).collect();
    latest.reverse();
    let dark = readings(before(records)).filter(|reading| reading.accepted && !reading.lamp);
    let dark_ticks = dark.map(|reading| reading.device_ticks).max().unwrap_or_default();
    let mut others = latest.split_off(LATEST.min(latest.len()));
    others.retain(|reading| reading.device_ticks > dark_ticks);
    others.sort_by(|a, b| faintest(a).total_cmp(&faintest(b)));
    latest.into_iter().chain(others.into_iter().take(FAINTEST))
}

/// The records of before this execution, which has begun.
fn before(records: &[Record]) -> &[Record] {
    let begun = records
        .iter()
        .rposition(|record| matches!(record, Record::Begin { .. }));
    &records[..begun.unwrap_or(records.len())]
}

/// What the faintest channel sees: counts per µs at gain ×1.
fn faintest(reading: &Reading) -> f64 {
    let exposure = reading.counts.exposure;
    let least = reading.counts.rgb.into_iter().min().unwrap_or_default();
    f64::from(least) / (f64::from(exposure.integration_us) * exposure.gain.factor())
}

/// Relative difference of the channel that was brightest, each relative to the lamp monitor.
fn difference_rel(before: &Counts, after: &Counts) -> f64 {
    let brightest = (0..3).max_by_key(|&c| before.rgb[c]).unwrap_or(0);
    let level = |counts: &Counts| f64::from(counts.rgb[brightest]) / f64::from(counts.monitor.max(1));
    level(after) / level(before).max(f64::MIN_POSITIVE) - 1.0
}
