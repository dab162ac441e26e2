use arms::Pose;
use rig::{Lamp, Rig};
use sweep::{Step, Sweep};

use super::{Execution, Interrupt};
use crate::{Extension, Record};

/// What the journal says of readings that were added because the run was held.
const WHY: &str = "the run was held meanwhile, and dark level and lamp may have drifted";

impl<R: Rig> Execution<'_, R> {
    /// Does what the operator asked for and waits while `[suspend]` holds the run; after that it takes fresh dark and
    /// reference readings, so that nothing measured from here on rests on those from before. `to` is where the run
    /// goes on.
    pub(super) async fn make_ready(&mut self, to: Pose) -> Result<(), Interrupt<R::Error>> {
        loop {
            self.obey().await?;
            self.suspend().await?;
            if !self.stale {
                return Ok(());
            }
            self.stale = false;
            self.refresh_dark(to).await?;
            self.refresh_reference().await?;
        }
    }

    /// Takes the first dark readings of the plan again, lamp off, at the pose where the run goes on. Does nothing
    /// while no lit reading was taken, since nothing rests on dark readings from before a pause then.
    pub(super) async fn refresh_dark(&mut self, to: Pose) -> Result<(), Interrupt<R::Error>> {
        if !self.lit_before() {
            return Ok(());
        }
        let dark = |step: &&Step| step.sweep == Sweep::Dark;
        let first = self.plan.steps.iter().skip_while(|step| !dark(step));
        let again = first.take_while(dark).map(|step| (step.clone(), to)).collect();
        self.measure_again(again).await
    }

    /// Visits the reference pose again, where visits follow the lamp.
    pub(super) async fn refresh_reference(&mut self) -> Result<(), Interrupt<R::Error>> {
        if self.file.visits.lamp != Lamp::Visits || !self.lit_before() {
            return Ok(());
        }
        let reference = self.file.nearest(self.file.visits.reference);
        let visit = |step: &&Step| step.sweep == Sweep::Reference && step.pose() == reference;
        let again = self.plan.steps.iter().find(visit).cloned();
        self.measure_again(again.into_iter().map(|step| (step, reference)).collect())
            .await
    }

    /// Adds steps to the plan, in the journal too, and takes them at once, each at its pose.
    async fn measure_again(&mut self, again: Vec<(Step, Pose)>) -> Result<(), Interrupt<R::Error>> {
        if again.is_empty() {
            return Ok(());
        }
        let begin = self.plan.steps.len();
        let steps = again.into_iter().zip(begin..).map(|((step, pose), index)| Step {
            index,
            path: vec![pose],
            pass: None,
            ..step
        });
        let extension = Extension {
            steps: steps.collect(),
            why: WHY.to_owned(),
            expected_male: None,
        };
        self.append(&Record::Extension(extension.clone())).await?;
        self.add(extension.steps);
        let added = self.plan.steps[begin..].to_vec();
        for set in added.chunk_by(|a, b| a.sweep == Sweep::Dark && b.sweep == Sweep::Dark) {
            let step = &set[0];
            // Their own paths lead on from nowhere.
            self.standing = self.standing.filter(|&pose| pose == step.pose());
            if step.sweep == Sweep::Dark {
                self.dark_set(set).await?;
                continue;
            }
            self.obey().await?;
            self.step(step).await?;
        }
        // The path of the step with which the run goes on leads from the step before it.
        self.standing = None;
        Ok(())
    }

    /// Whether a reading was taken with the lamp on.
    fn lit_before(&self) -> bool {
        let attempts = self.plan.steps.iter().zip(&self.attempts);
        attempts
            .into_iter()
            .any(|(step, &attempts)| step.lamp && attempts > 0)
    }
}
