use arms::{Arm, ArmAngle, Envelope, Pose, Profile};

use super::{Drive, DriveError};
use crate::{Actuator, Observation, Rig, Snapshot};

/// How much further apart than the separation the goals keep of arms that could meet if one of them stood still, rad: 2°, more
/// than an arm rings by when it stops.
const APART_RAD: f64 = 0.035;

impl<R: Rig> Drive<R> {
    /// How far both arms may be sent towards a pose at once: to the pose itself where all that the motion can sweep is free,
    /// from where the arms were last seen; else as far as keeps them 2° further apart than the separation wherever either of
    /// them stops. Asked again and again on the way, this leads both along beside each other, and if the host, the bus or
    /// one of them falls silent, each comes to rest by itself at a goal that is safe.
    ///
    /// # Errors
    /// As [`Drive::snapshot`], where nobody looked yet.
    pub async fn ahead(&mut self, to: Pose) -> Result<Pose, DriveError<R::Error>> {
        let seen = self.last_seen().await?;
        let to = self.file.nearest(to);
        if self.check(&seen, to).is_ok() {
            return Ok(to);
        }
        Ok(self.file.nearest(beside(&self.file.envelope, seen.pose(), to)))
    }

    /// Sends arms on to other goals, each on a profile, which stays until the next one or until the arms are engaged. All
    /// that the motion can sweep is checked first, from where the arms were last seen.
    ///
    /// # Errors
    /// A motion that leaves the envelope (nothing changed), a silent or failing servo.
    pub async fn send_on(
        &mut self,
        to: Pose,
        arms: impl IntoIterator<Item = (Arm, Profile)>,
    ) -> Result<(), DriveError<R::Error>> {
        let seen = self.last_seen().await?;
        self.check(&seen, to)?;
        for (arm, profile) in arms {
            let goal = to.angle(arm);
            self.retry("send an arm on", |rig| {
                Box::pin(rig.axis(arm).steer(goal, profile))
            })
            .await?;
        }
        Ok(())
    }

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
        let goal = self.last_seen().await?.arms[arm as usize].goal;
        self.retry("steer an arm", |rig| Box::pin(rig.axis(arm).steer(goal, profile)))
            .await
    }

    /// What was seen of the rig last; a look at it where nobody looked yet.
    async fn last_seen(&mut self) -> Result<Snapshot, DriveError<R::Error>> {
        let seen = *self.seen.borrow();
        match seen {
            Some(seen) => Ok(seen),
            None => self.snapshot().await,
        }
    }
}

/// As far towards a pose as keeps the arms apart wherever either of them stops, from where they are; neither goes back.
fn beside(envelope: &Envelope, at: Pose, to: Pose) -> Pose {
    let apart_rad = envelope.separation_rad + APART_RAD;
    // +1 where the light is below the sensor.
    let side = if at.light <= at.sensor { 1.0 } else { -1.0 };
    let nearest = |of: Arm, other: Arm, side: f64| {
        let [of_rad, other_rad, to_rad] =
            [at.angle(of), at.angle(other), to.angle(of)].map(|angle| side * angle.rad());
        let most_rad = f64::max(other_rad - apart_rad, of_rad);
        ArmAngle::from_rad(side * to_rad.min(most_rad))
    };
    Pose {
        light: nearest(Arm::Light, Arm::Sensor, side),
        sensor: nearest(Arm::Sensor, Arm::Light, -side),
    }
}
