use std::process::ExitCode;

use api::client::{Message, Stream};
use api::{Activity, ArmName, Client, Jog, What};
use arms::{Arm, ArmAngle};
use session::Status;

use crate::document;
use crate::error::CommandError;
use crate::exit;

/// What an operator has the rig do, whatever job is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum OperatorCommand {
    Pause,
    Stop,
    Estop,
    Jog(Arm, ArmAngle),
    Park,
}

impl OperatorCommand {
    /// Has the daemon do it, and says so; for machines, how the rig stands then. A motion is waited for; exit code 3
    /// where it ended in a fault.
    ///
    /// # Errors
    /// The daemon does not answer, or refuses.
    pub(crate) fn send(self, daemon: &Client, as_json: bool) -> anyhow::Result<ExitCode> {
        let said = match self {
            Self::Pause => {
                daemon.act("/pause")?;
                "finishing the reading, then holding; `gonioctl resume` goes on"
            }
            Self::Stop => {
                daemon.act("/stop")?;
                "stopping; nothing starts by itself until `gonioctl resume`, `ready` or `run`"
            }
            Self::Estop => {
                daemon.act("/estop")?;
                "EMERGENCY STOP; nothing moves until `gonioctl acknowledge`"
            }
            Self::Jog(..) | Self::Park => return self.drive(daemon, as_json),
        };
        terminal::say(said);
        if as_json {
            document::RIG_STATE.print(&daemon.rig()?)?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Has arms moved, waits until they stand, and says where.
    fn drive(self, daemon: &Client, as_json: bool) -> anyhow::Result<ExitCode> {
        // Listened to first, so that a short motion is not missed.
        let mut events = daemon.events(None)?;
        match self {
            Self::Jog(arm, angle) => {
                let arm = match arm {
                    Arm::Light => ArmName::Light,
                    Arm::Sensor => ArmName::Sensor,
                };
                daemon.jog(Jog {
                    arm,
                    angle_deg: angle.deg(),
                })?;
            }
            _ => daemon.act("/park")?,
        }
        rest(&mut events)?;
        let rig = daemon.rig()?;
        for (arm, view) in Arm::BOTH.into_iter().zip(&rig.arms) {
            if let Some(angle_deg) = view.measured_deg {
                terminal::say(format_args!("{arm} arm at {angle_deg:.2}°"));
            }
        }
        if as_json {
            document::RIG_STATE.print(&rig)?;
        }
        if let Some(fault) = rig.fault {
            terminal::say(format_args!("FAULT: {}", fault.text));
            return Ok(exit::code(Status::Rig));
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns once a motion that is told of has ended.
fn rest(events: &mut Stream) -> Result<(), CommandError> {
    const LOST: CommandError =
        CommandError::Absent("the daemon was lost while the arms moved; look at the rig");
    let mut moving = false;
    loop {
        let Ok(Some(told)) = events.next() else {
            return Err(LOST);
        };
        let Message::Event(event) = told.message() else {
            continue;
        };
        match event.what {
            What::Activity {
                activity: Activity::Moving,
            } => moving = true,
            What::Activity {
                activity: Activity::Idle,
            } if moving => return Ok(()),
            _ => {}
        }
    }
}
