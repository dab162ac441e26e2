use arms::{Arm, ArmAngle, Pose};
use capture::{Command, mechanics};
use rig::DriveError;
use tokio::sync::{oneshot, watch};

use super::{Hand, gone, not_ready};
use crate::refusal::chain;
use crate::{Activity, DaemonError, FaultCode, Refusal, view};

/// A motion by hand: its poses, checked.
struct Way(Vec<Pose>);

impl Hand {
    /// Moves one arm, or both to rest. `None` where the motion was refused; else the fault that it ended in, if any.
    pub(super) async fn travel(
        &mut self,
        to: Option<(Arm, ArmAngle)>,
        reply: oneshot::Sender<Result<(), Refusal>>,
    ) -> Option<Option<(FaultCode, String)>> {
        let way = match self.way(to).await {
            Ok(way) => way,
            Err(refusal) => {
                let _ = reply.send(Err(refusal));
                return None;
            }
        };
        self.shared.activity(Activity::Moving);
        let _ = reply.send(Ok(()));
        Some(self.follow_way(&way).await)
    }

    /// The way to where an arm, or both, are to go.
    async fn way(&mut self, to: Option<(Arm, ArmAngle)>) -> Result<Way, Refusal> {
        let from = self.pose().await.map_err(|error| {
            if gone(&error) {
                self.station = None;
            }
            Refusal::unavailable(chain(&error))
        })?;
        let rig = &self.shared.rig;
        let Some((arm, angle)) = to else {
            let way = sweep::way(&mechanics(rig, Some(from)), from, rig.motion.park);
            return way.map(Way).map_err(|error| Refusal::invalid(&error));
        };
        let goal = rig.nearest(from.with(arm, angle));
        rig.envelope
            .check_path(from, goal)
            .map_err(|violation| Refusal::invalid(&violation))?;
        Ok(Way(vec![goal]))
    }

    /// Where the arms stand, once every device has said that it is as the rig file says.
    async fn pose(&mut self) -> Result<Pose, DaemonError> {
        let station = self.open()?;
        station.start().await?;
        station.drive.rest().await.map_err(not_ready)?;
        Ok(station.drive.snapshot().await.map_err(not_ready)?.pose())
    }

    /// Drives, and obeys the operator meanwhile. Returns the fault that it ended in.
    async fn follow_way(&mut self, way: &Way) -> Option<(FaultCode, String)> {
        let station = self.station.as_mut()?;
        let drive = &mut station.drive;
        let mut control = self.shared.command.subscribe();
        let driven = async {
            drive.engage_all().await?;
            drive.travel(&way.0).await
        };
        let told = tokio::select! {
            biased;
            command = told(&mut control) => Some(command),
            result = driven => match result {
                Ok(_) => None,
                Err(error) => return self.failed(error).await,
            },
        };
        let drive = &mut station.drive;
        let mut left = match told {
            Some(Command::Estop) => drive.halt_all().await,
            Some(_) => drive.stop_all().await,
            None => Vec::new(),
        };
        left.extend(drive.disengage_all().await);
        let error = left.into_iter().next()?;
        Some((view::fault_code(error.kind()), chain(&error)))
    }

    async fn failed(&mut self, error: DriveError<rig::RigError>) -> Option<(FaultCode, String)> {
        if let Some(station) = &mut self.station {
            station.drive.stop_all().await;
            station.drive.disengage_all().await;
        }
        let fault = (view::fault_code(error.kind()), chain(&error));
        if gone(&not_ready(error)) {
            self.station = None;
        }
        Some(fault)
    }
}

/// Returns once anything but going on is asked for.
async fn told(control: &mut watch::Receiver<Command>) -> Command {
    match control.wait_for(|command| *command != Command::Run).await {
        Ok(command) => *command,
        // Nobody is left who could ask.
        Err(_) => std::future::pending().await,
    }
}
