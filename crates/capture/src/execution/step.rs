use arms::Pose;
use rig::{Counts, Exposure, Gain, Lamp, Rest, Rig};
use sweep::Step;

use super::{Execution, Interrupt};
use crate::{Event, Flag, Reading, mechanics};

/// Most exposures of one reading in one execution until it counts: from one end of the range to the other takes six, by
/// a factor of about 16 each. One more may follow for its faintest channel.
pub(crate) const MAX_EXPOSURES: u32 = 8;
/// Share of its nominal output below which a lamp is out.
const OUT: f64 = 0.01;

impl<R: Rig> Execution<'_, R> {
    /// One step: lamp, motion, exposures until one is accepted, and one more where a channel is too faint in that.
    pub(super) async fn step(&mut self, step: &Step) -> Result<(), Interrupt<R::Error>> {
        self.emit(Event::Step {
            step: step.index,
            of: self.plan.steps.len(),
            sweep: step.sweep,
            goal: step.pose(),
        });
        if step.lamp != self.lamp {
            self.switch_lamp(step.lamp).await?;
        }
        let mut retries = self.drive.retries();
        self.travel(step).await?;
        let fixed = fixed(step);
        let mut exposure = fixed.unwrap_or_else(|| self.ranging.first(step.sweep, step.pose()));
        let mut beside = None;
        for left in (0..MAX_EXPOSURES).rev() {
            let (counts, rest) = self.expose(step, exposure).await?;
            let moved = rest.moved(self.drive.still_rad()).is_some();
            let better = match fixed {
                None if left > 0 => self.ranging.better(&counts),
                _ => None,
            };
            let accepted = better.is_none() && !(moved && left > 0);
            retries = self.rested(step, rest, counts, accepted, retries).await?;
            exposure = better.unwrap_or(exposure);
            if accepted {
                beside = self.ranging.beside(&counts).filter(|_| fixed.is_none());
                break;
            }
            if moved {
                // It may swing still, or somebody pushed it: it is waited for where it stands.
                self.drive.travel(&[step.pose()]).await?;
            }
        }
        if let Some(beside) = beside {
            let (counts, rest) = self.expose(step, beside).await?;
            self.rested(step, rest, counts, false, retries).await?;
        }
        Ok(())
    }

    /// Exposes, and looks at the lamp and at where the arms are meanwhile.
    async fn expose(
        &mut self,
        step: &Step,
        exposure: Exposure,
    ) -> Result<(Counts, Rest), Interrupt<R::Error>> {
        let (counts, rest) = self.drive.expose_at_rest(exposure).await?;
        if step.lamp {
            self.heed_lamp(&counts)?;
        }
        Ok((counts, rest))
    }

    /// A reading of a step as it is first known: it does not count yet, and nothing is said against it.
    pub(super) fn taken(&mut self, step: &Step, counts: Counts, measured: Pose) -> Reading {
        Reading {
            step: step.index,
            attempt: self.attempts[step.index],
            accepted: false,
            sweep: step.sweep,
            lamp: step.lamp,
            goal: step.pose(),
            measured,
            counts,
            device_ticks: self.clock.unwrap(counts.ticks),
            retries: 0,
            flags: Vec::new(),
            swept_rad: None,
            spread_rad: None,
        }
    }

    /// Records a reading of arms at rest, `retries` being the requests repeated before it; returns those after it.
    async fn rested(
        &mut self,
        step: &Step,
        rest: Rest,
        counts: Counts,
        accepted: bool,
        retries: u32,
    ) -> Result<u32, Interrupt<R::Error>> {
        let now = self.drive.retries();
        let mut reading = self.taken(step, counts, rest.pose);
        reading.spread_rad = Some(rest.spread_rad);
        reading.accepted = accepted;
        reading.retries = now - retries;
        reading.flags = self.flags(&reading);
        if rest.moved(self.drive.still_rad()).is_some() {
            reading.flags.push(Flag::Blurred);
        }
        self.record(reading, step).await?;
        Ok(now)
    }

    /// Drives to a step's pose; from wherever the arms are where its own path does not lead on.
    pub(super) async fn travel(&mut self, step: &Step) -> Result<Pose, Interrupt<R::Error>> {
        // What was added to a plan may be left over from an interruption, and its path lead from elsewhere.
        let leads = |from| {
            let mut poses = std::iter::once(from).chain(step.path.iter().copied());
            let mut last = poses.next();
            poses.all(|to| {
                last.replace(to)
                    .is_none_or(|from| self.file.envelope.check_path(from, to).is_ok())
            })
        };
        let measured = match self.standing.is_some_and(leads) {
            true => self.drive.travel(&step.path).await?.pose,
            false => self.travel_anew(step.pose()).await?,
        };
        self.standing = Some(step.pose());
        Ok(measured)
    }

    /// Drives to a pose from wherever the arms are.
    pub(super) async fn travel_anew(&mut self, to: Pose) -> Result<Pose, Interrupt<R::Error>> {
        let path = self.way(to).await?;
        Ok(self.drive.travel(&path).await?.pose)
    }

    /// The way to a pose from wherever the arms are.
    pub(super) async fn way(&mut self, to: Pose) -> Result<Vec<Pose>, Interrupt<R::Error>> {
        let mut from = self.file.admitted(self.drive.snapshot().await?.pose());
        if self.file.envelope.check_pose(from).is_err() {
            // They may swing still.
            from = self.file.admitted(self.drive.stand().await?.pose);
        }
        let mechanics = mechanics(self.file, Some(from));
        sweep::way(&mechanics, from, to).map_err(Interrupt::Way)
    }

    /// Whether the monitor saw no light: a photometer that restarted on its own has its lamp off, and says so nowhere.
    pub(super) fn lamp_is_out(&self, counts: &Counts) -> bool {
        let nominal = self.file.calibration.monitor * f64::from(counts.exposure.integration_us);
        self.file.visits.lamp == Lamp::Monitor && f64::from(counts.monitor) < OUT * nominal
    }

    pub(super) fn flags(&self, reading: &Reading) -> Vec<Flag> {
        let dim = reading.lamp && self.ranging.dim(&reading.counts);
        let shadowed = reading.lamp
            && self
                .file
                .shadowed(reading.measured, reading.swept_rad.unwrap_or_default());
        [
            (reading.counts.saturated, Flag::Saturated),
            (dim && !reading.counts.saturated, Flag::Dim),
            (reading.retries > 0, Flag::Retried),
            (shadowed, Flag::Shadowed),
        ]
        .into_iter()
        .filter_map(|(is, flag)| is.then_some(flag))
        .collect()
    }
}

/// The exposure that a step must have, where it is not ranged.
pub(super) fn fixed(step: &Step) -> Option<Exposure> {
    step.exposure.map(|(gain, integration_us)| Exposure {
        integration_us,
        gain: Gain::ALL[usize::from(gain).min(Gain::ALL.len() - 1)],
    })
}
