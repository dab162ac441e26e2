use std::process::ExitCode;

use arms::{Arm, ArmAngle};
use goniod::Status;
use serde_json::{Value, json};

use crate::daemon::{ClientError, Daemon, Stream};
use crate::{exit, print};

/// What an operator's hand does with the rig, whatever job is under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Hand {
    Pause,
    Stop,
    Estop,
    Acknowledge,
    Jog(Arm, ArmAngle),
    Park,
}

impl Hand {
    /// Has the daemon do it, and says so; for machines, how the rig stands then. A motion is waited for; exit code 3
    /// where it ended in a fault.
    ///
    /// # Errors
    /// The daemon does not answer, or refuses.
    pub(crate) fn lay_on(self, daemon: &Daemon, as_json: bool) -> anyhow::Result<ExitCode> {
        let said = match self {
            Self::Pause => {
                daemon.act("/pause")?;
                "finishing the reading, then holding; `gonioctl resume` goes on"
            }
            Self::Stop => {
                daemon.act("/stop")?;
                "stopping; `gonioctl resume` goes on"
            }
            Self::Estop => {
                daemon.act("/estop")?;
                "EMERGENCY STOP; nothing moves until `gonioctl acknowledge`"
            }
            Self::Acknowledge => {
                daemon.act("/acknowledge")?;
                "acknowledged"
            }
            Self::Jog(..) | Self::Park => return self.drive(daemon, as_json),
        };
        print::say(said);
        if as_json {
            print::json(&daemon.read::<Value>("/rig")?)?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Has arms moved, waits until they stand, and says where.
    fn drive(self, daemon: &Daemon, as_json: bool) -> anyhow::Result<ExitCode> {
        // Listened to first, so that a short motion is not missed.
        let mut events = daemon.events(None)?;
        match self {
            Self::Jog(arm, angle) => {
                let arm = arm.to_string();
                daemon.act_on("/jog", &json!({ "arm": arm, "angle_deg": angle.deg() }))?;
            }
            _ => daemon.act("/park")?,
        }
        rest(&mut events)?;
        let rig: Value = daemon.read("/rig")?;
        for (i, arm) in Arm::BOTH.into_iter().enumerate() {
            if let Some(angle_deg) = rig["arms"][i]["measured_deg"].as_f64() {
                print::say(format_args!("{arm} arm at {angle_deg:.2}°"));
            }
        }
        if as_json {
            print::json(&rig)?;
        }
        if let Some(fault) = rig["fault"]["text"].as_str() {
            print::say(format_args!("FAULT: {fault}"));
            return Ok(exit::code(Status::Rig));
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns once a motion that is told of has ended.
fn rest(events: &mut Stream) -> Result<(), ClientError> {
    const LOST: ClientError =
        ClientError::Absent("the daemon was lost while the arms moved; look at the rig");
    let mut moving = false;
    loop {
        let Ok(Some(told)) = events.next() else {
            return Err(LOST);
        };
        let event: Value = serde_json::from_str(&told.data).unwrap_or_default();
        match event["activity"]
            .as_str()
            .filter(|_| event["event"] == "activity")
        {
            Some("moving") => moving = true,
            Some("idle") if moving => return Ok(()),
            _ => {}
        }
    }
}
