use std::error::Error;

use arms::Arm;

use super::Finding;
use crate::{Device, Drive, Rig};

/// Whether one device is as the rig file says and healthy: model, firmware, return delay, modes, limits, alert bits.
pub async fn device<R: Rig>(drive: &mut Drive<R>, device: Device) -> Finding {
    let check = match device {
        Device::Light => "light servo",
        Device::Sensor => "sensor servo",
        Device::Photometer => "photometer",
    };
    match drive.identify(device).await {
        Ok(identity) => {
            let checked = match device {
                Device::Photometer => "",
                _ => "; return delay, modes and limits as the rig file says",
            };
            let text = format!(
                "{} (id {}), firmware {}{checked}; no hardware error",
                identity.model, identity.id, identity.firmware
            );
            Finding::ok(check, text)
        }
        // The cause alone: that it was being identified is nothing new.
        Err(error) => Finding::error(check, error.source().unwrap_or(&error)),
    }
}

/// Where the arms stand, and whether a motion may begin there.
pub async fn pose<R: Rig>(drive: &mut Drive<R>) -> Finding {
    const CHECK: &str = "pose";
    let snapshot = match drive.snapshot().await {
        Ok(snapshot) => snapshot,
        Err(error) => return Finding::error(CHECK, &error),
    };
    let arms = Arm::BOTH.map(|arm| {
        let location = snapshot.arms[arm as usize];
        let torque = if location.torque { "on" } else { "off" };
        format!("{arm} at {:.2}°, torque {torque}", location.measured.deg())
    });
    let text = arms.join("; ");
    match drive.tolerant().check_pose(snapshot.pose()) {
        Ok(()) => Finding::ok(CHECK, text),
        Err(violation) => Finding::fail(
            CHECK,
            format!("{text}: {violation}"),
            "no motion may begin here: with their power off, move the arms by hand; or correct zero_deg and sign",
        ),
    }
}
