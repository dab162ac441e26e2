use std::time::Duration;

use arms::{Arm, ArmAngle, Envelope, Pose};
use tokio::time::Instant;

use super::retry::LEAST;
use super::{Drive, DriveError};
use crate::{Approach, Rig, Snapshot};

/// Time between two looks at arms that should have arrived.
const POLL: Duration = Duration::from_millis(2);

impl<R: Rig> Drive<R> {
    /// Takes the arms along a path and returns once both have settled at its end: measured within the tolerance,
    /// and still so after the settling time. Poses on the way are reached but not settled at.
    ///
    /// Before each leg, limits and separation are checked over all that it sweeps, from where the arms measurably
    /// are. Where the rig file asks for an approach from one side and the last leg comes from the other, the arm goes
    /// beyond by the overshoot first, unless the envelope forbids that.
    ///
    /// # Errors
    /// A leg that leaves the envelope (nothing moved), an arm that does not take its goal, does not arrive in time,
    /// loses its torque or reports a hardware error; a device that is silent for too long. The arms are not stopped:
    /// see [`Drive::stop_all`].
    pub async fn travel(&mut self, path: &[Pose]) -> Result<Snapshot, DriveError<R::Error>> {
        let Some((&last, on_the_way)) = path.split_last() else {
            return self.snapshot().await;
        };
        for &pose in on_the_way {
            self.leg(pose, Duration::ZERO).await?;
        }
        let from = self.snapshot().await?;
        let beyond = self.beyond(from.pose(), last);
        if beyond != last && self.check(&from, beyond).is_ok() {
            self.leg(beyond, Duration::ZERO).await?;
        }
        self.leg(last, self.file.motion.settle).await
    }

    /// Where the arms go first so that they come to `to` from the side that the rig file asks for.
    fn beyond(&self, from: Pose, to: Pose) -> Pose {
        let motion = &self.file.motion;
        let side = match motion.approach {
            Approach::None => return to,
            Approach::Up => -1.0,
            Approach::Down => 1.0,
        };
        Arm::BOTH.into_iter().fold(to, |pose, arm| {
            let way = to.angle(arm) - from.angle(arm);
            // An arm that only corrects its own error has no wrong side to come from.
            if way * side <= motion.tolerance_rad {
                return pose;
            }
            let limits = self.file.envelope.limits(arm);
            let rad =
                (to.angle(arm).rad() + side * motion.overshoot_rad).clamp(limits.min.rad(), limits.max.rad());
            pose.with(arm, ArmAngle::from_rad(rad))
        })
    }

    /// Checks a motion from where the arms are: the way against the tolerant envelope, its end against the strict one.
    pub(super) fn check(&self, from: &Snapshot, to: Pose) -> Result<(), DriveError<R::Error>> {
        let strict = &self.file.envelope;
        strict.check_pose(to).map_err(DriveError::Envelope)?;
        self.tolerant()
            .check_path(from.pose(), to)
            .map_err(DriveError::Envelope)
    }

    /// The envelope widened by the tolerance, since arms may stand off their goals by as much.
    pub(crate) fn tolerant(&self) -> Envelope {
        let strict = &self.file.envelope;
        let slack = self.file.motion.tolerance_rad;
        let widen = |mut limits: arms::Limits| {
            limits.min = ArmAngle::from_rad(limits.min.rad() - slack);
            limits.max = ArmAngle::from_rad(limits.max.rad() + slack);
            limits
        };
        Envelope {
            light: widen(strict.light),
            sensor: widen(strict.sensor),
            separation_rad: (strict.separation_rad - 2.0 * slack).max(0.0),
            can_pass: strict.can_pass,
        }
    }

    async fn leg(&mut self, to: Pose, settle: Duration) -> Result<Snapshot, DriveError<R::Error>> {
        let from = self.snapshot().await?;
        self.check(&from, to)?;
        let goal = self.file.nearest(to);
        let duration = self.duration(from.pose(), goal);
        let watch = Watch::start(self.waited);
        self.start(goal).await?;
        self.wait(duration).await?;
        loop {
            let snapshot = self.snapshot().await?;
            match self.away(&snapshot, goal) {
                None if settle.is_zero() => return Ok(snapshot),
                None => {
                    self.wait(settle).await?;
                    let settled = self.snapshot().await?;
                    if self.away(&settled, goal).is_none() {
                        return Ok(settled);
                    }
                }
                Some(arm) if watch.elapsed(self.waited) > duration + settle + self.file.motion.timeout => {
                    return Err(DriveError::NotArrived {
                        arm,
                        goal: goal.angle(arm),
                        measured: snapshot.pose().angle(arm),
                        tolerance_rad: self.file.motion.tolerance_rad,
                        after: watch.elapsed(self.waited),
                    });
                }
                Some(_) => {}
            }
            self.wait(POLL).await?;
        }
    }

    /// How long both arms take by their profiles.
    fn duration(&self, from: Pose, to: Pose) -> Duration {
        let seconds = Arm::BOTH.map(|arm| {
            let way = to.angle(arm) - from.angle(arm);
            self.file.arm(arm).profile.duration_s(way)
        });
        Duration::from_secs_f64(seconds[0].max(seconds[1]))
    }

    /// The first arm that has not arrived.
    fn away(&self, snapshot: &Snapshot, goal: Pose) -> Option<Arm> {
        Arm::BOTH.into_iter().find(|&arm| {
            let location = snapshot.arms[arm as usize];
            let error = (location.measured - goal.angle(arm)).abs();
            location.moving || error > self.file.motion.tolerance_rad
        })
    }

    /// Sets both arms off. The sync write is not acknowledged, so it is repeated until the goals read back.
    pub(super) async fn start(&mut self, goal: Pose) -> Result<(), DriveError<R::Error>> {
        let since = Instant::now();
        let mut repeated = 0;
        loop {
            self.retry("set the arms off", |rig| Box::pin(rig.start(goal)))
                .await?;
            let snapshot = self.snapshot().await?;
            let not_taken = Arm::BOTH.into_iter().find(|&arm| {
                let half_a_count = self.file.arm(arm).axis.resolution_rad() / 2.0;
                (snapshot.arms[arm as usize].goal - goal.angle(arm)).abs() > half_a_count
            });
            let Some(arm) = not_taken else { return Ok(()) };
            if since.elapsed() >= self.file.bus.silence && repeated >= LEAST {
                return Err(DriveError::GoalNotTaken {
                    arm,
                    goal: goal.angle(arm),
                    has: snapshot.arms[arm as usize].goal,
                    tried: since.elapsed(),
                });
            }
            self.retries += 1;
            repeated += 1;
            self.wait(POLL).await?;
        }
    }
}

/// Time since a start in the rig's terms: the host's clock, or what the rig was told to wait where its time is
/// simulated and the host's hardly passes.
struct Watch {
    started: Instant,
    waited: Duration,
}

impl Watch {
    fn start(waited: Duration) -> Self {
        Self {
            started: Instant::now(),
            waited,
        }
    }

    fn elapsed(&self, waited: Duration) -> Duration {
        self.started.elapsed().max(waited - self.waited)
    }
}
