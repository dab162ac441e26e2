use arms::{Arm, ArmAngle, Pose};
use rig::Rig;
use sweep::Step;

use super::step::fixed;
use super::{Execution, Interrupt};
use crate::{Event, mechanics};

impl<R: Rig> Execution<'_, R> {
    /// Takes dark readings while the arms go to where these steps end; returns false where the arms were held on the way.
    /// They may still move when the last one is taken.
    pub(super) async fn dark_on_the_way(&mut self, steps: &[Step]) -> Result<bool, Interrupt<R::Error>> {
        if self.lamp {
            self.switch_lamp(false).await?;
        }
        self.standing = None;
        let (from, to) = (self.drive.snapshot().await?.pose(), steps[0].pose());
        let mechanics = mechanics(self.file, Some(from));
        let path = sweep::way(&mechanics, from, to).map_err(Interrupt::Way)?;
        self.drive.travel(&path[..path.len() - 1]).await?;
        self.drive.set_off(to).await?;
        for step in steps {
            if self.held() {
                self.drive.brake().await?;
                self.drive.rest().await?;
                return Ok(false);
            }
            self.dark(step).await?;
        }
        Ok(true)
    }

    /// One dark reading, the arms moving or not.
    async fn dark(&mut self, step: &Step) -> Result<(), Interrupt<R::Error>> {
        let Some(exposure) = fixed(step) else {
            return Ok(());
        };
        self.emit(Event::Step {
            step: step.index,
            of: self.plan.steps.len(),
            sweep: step.sweep,
            goal: step.pose(),
        });
        let retries = self.drive.retries();
        let before = self.drive.snapshot().await?.pose();
        let counts = self.drive.expose(exposure).await?;
        let after = self.drive.snapshot().await?.pose();
        let mut reading = self.taken(step, counts, middle(before, after));
        reading.accepted = true;
        reading.retries = self.drive.retries() - retries;
        reading.swept_rad = Some(Arm::BOTH.map(|arm| after.angle(arm) - before.angle(arm)));
        reading.flags = self.flags(&reading);
        self.record(reading, step).await
    }
}

fn middle(a: Pose, b: Pose) -> Pose {
    Arm::BOTH.into_iter().fold(a, |pose, arm| {
        let rad = (a.angle(arm).rad() + b.angle(arm).rad()) / 2.0;
        pose.with(arm, ArmAngle::from_rad(rad))
    })
}
