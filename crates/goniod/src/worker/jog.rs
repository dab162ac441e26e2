use arms::{Arm, ArmAngle, Pose};
use capture::{Command, mechanics};

use super::{RigWorker, gone, not_ready, stopped};
use crate::daemon::Reply;
use crate::operator::Permit;
use crate::queue::WorkerEvent;
use crate::refusal::chain;
use crate::{Activity, DaemonError, FaultCode, Refusal, RigSource, view};

impl<S: RigSource> RigWorker<S> {
    /// Moves one arm, or both to rest; answers once the motion was checked. A fault that ends it is latched before the
    /// permit ends.
    pub(super) async fn travel(&mut self, to: Option<(Arm, ArmAngle)>, permit: Permit, reply: Reply<()>) {
        let what = match to {
            Some((arm, angle)) => format!("jog {arm} to {:.3}°", angle.deg()),
            None => "park".to_owned(),
        };
        match self.path(to, &permit).await {
            Ok(path) => {
                self.shared.activity(Activity::Moving);
                reply.send(&self.shared, &what, Ok(()));
                if let Some((code, text)) = self.follow_path(&path, &permit).await {
                    self.latch(code, text);
                }
                drop(permit);
                self.shared.activity(Activity::Idle);
                self.report(WorkerEvent::Moved).await;
            }
            Err(refusal) => {
                // Whoever is refused may ask for something else at once.
                drop(permit);
                self.report(WorkerEvent::Moved).await;
                reply.send(&self.shared, &what, Err(refusal));
            }
        }
    }

    /// The poses on the way to where an arm, or both, are to go.
    async fn path(&mut self, to: Option<(Arm, ArmAngle)>, permit: &Permit) -> Result<Vec<Pose>, Refusal> {
        let mut command = permit.command();
        let pose = tokio::select! {
            biased;
            _ = stopped(&mut command) => return Err(Refusal::conflict("the rig was stopped before the motion began")),
            pose = self.pose() => pose,
        };
        let from = pose.map_err(|error| {
            if gone(&error) {
                self.rig = None;
            }
            Refusal::unavailable(chain(&error))
        })?;
        let rig = &self.shared.rig;
        let from = rig.admitted(from);
        let Some((arm, angle)) = to else {
            let path = sweep::way(&mechanics(rig, Some(from)), from, rig.motion.park);
            return path.map_err(|error| Refusal::invalid(&error));
        };
        let goal = rig.nearest(from.with(arm, angle));
        rig.envelope
            .check_path(from, goal)
            .map_err(|violation| Refusal::invalid(&violation))?;
        Ok(vec![goal])
    }

    /// Where the arms stand, once every device has said that it is as the rig file says.
    async fn pose(&mut self) -> Result<Pose, DaemonError> {
        let open = self.open()?;
        open.start().await?;
        open.drive.rest().await.map_err(not_ready)?;
        Ok(open.drive.snapshot().await.map_err(not_ready)?.pose())
    }

    /// Drives, and stops when the operator says so. Returns the fault that it ended in.
    async fn follow_path(&mut self, path: &[Pose], permit: &Permit) -> Option<(FaultCode, String)> {
        let open = self.rig.as_mut()?;
        let drive = &mut open.drive;
        let mut command = permit.command();
        let driven = async {
            drive.engage_all().await?;
            drive.travel(path).await
        };
        let asked = tokio::select! {
            biased;
            asked = stopped(&mut command) => Some(asked),
            result = driven => match result {
                Ok(_) => None,
                Err(error) => {
                    open.drive.make_safe(false).await;
                    let fault = (view::fault_code(error.kind()), chain(&error));
                    if gone(&not_ready(error)) {
                        self.rig = None;
                    }
                    return Some(fault);
                }
            },
        };
        let drive = &mut open.drive;
        let left = match asked {
            // An emergency stop that comes while the arms brake is carried out right after.
            Some(asked) => drive.make_safe(asked == Command::Estop).await,
            None => drive.disengage_all().await,
        };
        let error = left.into_iter().next()?;
        Some((view::fault_code(error.kind()), chain(&error)))
    }
}
