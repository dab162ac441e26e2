use std::time::Duration;

use arms::{Arm, ArmAngle, Pose};
use rig::{Counts, Exposure, Gain, Rig, check_dark_set};
use sweep::{Step, Sweep};

use super::step::fixed;
use super::{Execution, Interrupt, readings};
use crate::{Event, Reading, Record};

/// Sets of dark readings that are taken until one can be believed; then light from outside is a fault.
const MOST_SETS: u32 = 4;
/// Pauses before the readings of one exposure, one after the other, where it is shorter than the first limit: without them
/// readings that follow each other evenly would see a light that flickers with the mains at one phase, and agree. The mains'
/// light swells every 8.3 or 10 ms; an exposure of many periods averages over them anyhow.
const STAGGER: [Duration; 4] = [
    Duration::ZERO,
    Duration::from_micros(2300),
    Duration::from_micros(3700),
    Duration::from_micros(1100),
];
const STAGGERED: Duration = Duration::from_millis(10);
/// Pause before a set is taken again: whoever opened the door may close it.
const PAUSE: Duration = Duration::from_secs(2);

impl<R: Rig> Execution<'_, R> {
    /// The steps of a set of dark readings that begins with a step at rest and are not done; the place after them.
    pub(super) fn dark_set_from(&self, first: usize) -> (Vec<Step>, usize) {
        let dark = |step: &&Step| step.sweep == Sweep::Dark && step.pass == self.plan.steps[first].pass;
        let set: Vec<Step> = self.plan.steps[first..]
            .iter()
            .take_while(dark)
            .cloned()
            .collect();
        let next = first + set.len();
        let undone = set.into_iter().filter(|step| !self.done[step.index]);
        (undone.collect(), next)
    }

    /// Takes a set of dark readings where the arms stand, again where it cannot be believed: they agree with each other
    /// within their noise and leave room for light. They are recorded together, since none of them counts before that.
    pub(super) async fn dark_set(&mut self, steps: &[Step]) -> Result<(), Interrupt<R::Error>> {
        for left in (0..MOST_SETS).rev() {
            for step in steps {
                self.obey().await?;
                self.suspend().await?;
                self.dark_at_rest(step).await?;
            }
            match self.judge_dark(steps).await? {
                Ok(()) => return Ok(()),
                Err(fault) if left == 0 => return Err(Interrupt::Dark(fault)),
                Err(fault) => tracing::warn!("{fault}; they are taken again"),
            }
            self.let_pass(PAUSE).await?;
        }
        Ok(())
    }

    /// Takes dark readings while the arms go to where these steps end; returns false where the arms were held on the way.
    /// They may still move when the last one is taken.
    pub(super) async fn dark_on_the_way(&mut self, steps: &[Step]) -> Result<bool, Interrupt<R::Error>> {
        if self.lamp {
            self.switch_lamp(false).await?;
        }
        self.standing = None;
        let to = steps[0].pose();
        let path = self.way(to).await?;
        self.drive.travel(&path[..path.len() - 1]).await?;
        self.drive.set_off(to).await?;
        for step in steps {
            if self.held() {
                self.drive.brake().await?;
                self.drive.rest().await?;
                self.land_dark(false).await?;
                return Ok(false);
            }
            let retries = self.drive.retries();
            let before = self.drive.snapshot().await?.pose();
            let (counts, after) = self.dark(step).await?;
            let mut reading = self.taken(step, counts, middle(before, after));
            reading.swept_rad = Some(Arm::BOTH.map(|arm| after.angle(arm) - before.angle(arm)));
            self.hold_back(reading, retries);
        }
        if let Err(fault) = self.judge_dark(steps).await? {
            tracing::warn!("{fault}; they are taken again");
            self.drive.rest().await?;
            self.dark_set(steps).await?;
        }
        Ok(true)
    }

    async fn dark_at_rest(&mut self, step: &Step) -> Result<(), Interrupt<R::Error>> {
        if self.lamp {
            self.switch_lamp(false).await?;
        }
        let retries = self.drive.retries();
        let measured = self.travel(step).await?;
        let (counts, _) = self.dark(step).await?;
        let reading = self.taken(step, counts, measured);
        self.hold_back(reading, retries);
        Ok(())
    }

    /// One dark exposure, the arms moving or not, and where they are after it.
    async fn dark(&mut self, step: &Step) -> Result<(Counts, Pose), Interrupt<R::Error>> {
        let exposure = fixed(step).unwrap_or_else(|| self.ranging.first(step.sweep, step.pose()));
        self.emit(Event::Step {
            step: step.index,
            of: self.plan.steps.len(),
            sweep: step.sweep,
            goal: step.pose(),
        });
        if exposure.duration() < STAGGERED {
            self.drive.wait(STAGGER[step.index % STAGGER.len()]).await?;
        }
        let counts = self.drive.expose(exposure).await?;
        Ok((counts, self.drive.snapshot().await?.pose()))
    }

    /// Keeps a dark reading until its set is judged, `retries` being the requests repeated before it.
    fn hold_back(&mut self, mut reading: Reading, retries: u32) {
        reading.retries = self.drive.retries() - retries;
        reading.flags = self.flags(&reading);
        self.aloft.push(reading);
    }

    /// Records the readings of a set, which count where they can be believed; says why not.
    async fn judge_dark(
        &mut self,
        steps: &[Step],
    ) -> Result<Result<(), rig::DarkFault>, Interrupt<R::Error>> {
        debug_assert_eq!(self.aloft.len(), steps.len());
        let counts: Vec<Counts> = self.aloft.iter().map(|reading| reading.counts).collect();
        let judged = check_dark_set(&counts, self.file);
        self.land_dark(judged.is_ok()).await?;
        Ok(judged)
    }

    /// Records the readings that were held back.
    async fn land_dark(&mut self, accepted: bool) -> Result<(), Interrupt<R::Error>> {
        while !self.aloft.is_empty() {
            // Out of the list first: one whose record is being written is not kept a second time where that is interrupted.
            let mut reading = self.aloft.remove(0);
            reading.accepted = accepted;
            reading.attempt = self.attempts[reading.step];
            let step = self.plan.steps[reading.step].clone();
            self.record(reading, &step).await?;
        }
        Ok(())
    }

    /// The longest dark step of the strongest gain that was used with the lamp on, and is not at full scale: no
    /// other shows better what has changed.
    fn closing_step(&self) -> Option<Step> {
        let records = self.journal.records();
        let used = |gain: Gain| {
            readings(records)
                .any(|reading| reading.lamp && reading.accepted && reading.counts.exposure.gain == gain)
        };
        let known = |exposure: Exposure| {
            readings(records)
                .filter(|reading| !reading.lamp && reading.accepted && reading.counts.exposure == exposure)
                .all(|reading| !reading.counts.is_full(self.file.photometer.full_scale))
        };
        let steps = self.plan.steps.iter().filter(|step| step.sweep == Sweep::Dark);
        let usable =
            steps.filter(|step| fixed(step).is_some_and(|exposure| used(exposure.gain) && known(exposure)));
        let best =
            usable.max_by_key(|step| fixed(step).map(|exposure| (exposure.gain, exposure.integration_us)));
        best.cloned()
    }

    /// Looks once more at the dark once everything is read: what shines in from outside since the last set is in the
    /// readings after it, and shows in nothing else. Nothing is made of it but a verdict.
    pub(super) async fn closing_dark(&mut self) -> Result<(), Interrupt<R::Error>> {
        let Some(step) = self.closing_step() else {
            return Ok(());
        };
        let Some(exposure) = fixed(&step) else {
            return Ok(());
        };
        self.obey().await?;
        if self.lamp {
            self.switch_lamp(false).await?;
        }
        let retries = self.drive.retries();
        let counts = self.drive.expose(exposure).await?;
        let measured = self.drive.snapshot().await?.pose();
        let mut reading = self.taken(&step, counts, measured);
        reading.sweep = Sweep::Repeat;
        reading.goal = measured;
        reading.retries = self.drive.retries() - retries;
        reading.flags = self.flags(&reading);
        self.append(&Record::Repeat {
            reading,
            difference_rel: 0.0,
        })
        .await?;
        self.mark = self.clock.last();
        self.progress.closed();
        self.report_progress();
        Ok(())
    }
}

fn middle(a: Pose, b: Pose) -> Pose {
    Arm::BOTH.into_iter().fold(a, |pose, arm| {
        let rad = (a.angle(arm).rad() + b.angle(arm).rad()) / 2.0;
        pose.with(arm, ArmAngle::from_rad(rad))
    })
}
