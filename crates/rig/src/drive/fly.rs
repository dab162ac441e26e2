use arms::{Arm, Pose, Profile};

use super::{Drive, DriveError};
use crate::{Actuator, Observation, Rig};

impl<R: Rig> Drive<R> {
    /// Where the arms are, what the photometer's clock says and what it read last, all at one moment.
    ///
    /// # Errors
    /// As [`Drive::snapshot`].
    pub async fn observe(&mut self) -> Result<Observation, DriveError<R::Error>> {
        let observation = self
            .retry("observe the rig", |rig| Box::pin(rig.observe()))
            .await?;
        self.note(observation.snapshot)?;
        Ok(observation)
    }

    /// Sets both arms off towards a pose and returns while they move, on the profiles that they were last given. All
    /// that the motion can sweep is checked first, from where the arms measurably are.
    ///
    /// # Errors
    /// A motion that leaves the envelope (nothing moved), an arm that does not take its goal, a silent device.
    pub async fn set_off(&mut self, to: Pose) -> Result<(), DriveError<R::Error>> {
        let from = self.snapshot().await?;
        self.check(&from, to)?;
        self.start(self.file.nearest(to)).await
    }

    /// Brakes both arms on their profiles and leaves all else as it is. [`Drive::rest`] waits until they stand.
    ///
    /// # Errors
    /// A silent or failing servo.
    pub async fn brake(&mut self) -> Result<(), DriveError<R::Error>> {
        for arm in Arm::BOTH {
            self.retry("brake an arm", |rig| Box::pin(rig.axis(arm).stop()))
                .await?;
        }
        Ok(())
    }

    /// Sends an arm on to the goal that the last snapshot saw, on another profile, which stays until the next one or
    /// until the arms are engaged. It goes nowhere that it was not going, so there is nothing to check.
    ///
    /// # Errors
    /// A silent or failing servo.
    pub async fn steer(&mut self, arm: Arm, profile: Profile) -> Result<(), DriveError<R::Error>> {
        let seen = *self.seen.borrow();
        let goal = match seen {
            Some(snapshot) => snapshot.arms[arm as usize].goal,
            None => self.snapshot().await?.arms[arm as usize].goal,
        };
        self.retry("steer an arm", |rig| Box::pin(rig.axis(arm).steer(goal, profile)))
            .await
    }
}
