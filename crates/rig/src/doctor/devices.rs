use std::error::Error;

use arms::Arm;

use super::Finding;
use crate::{Actuator, Detector, Device, Drive, Dynamixel, Rig};

/// Whether a device answers what the other checks ask, whatever may be wrong with it.
pub async fn answers<R: Rig>(drive: &mut Drive<R>, device: Device) -> bool {
    // Three lost replies in a row are no chance.
    for _ in 0..3 {
        let rig = drive.rig();
        let answered = match device {
            Device::Light => rig.axis(Arm::Light).location().await.is_ok(),
            Device::Sensor => rig.axis(Arm::Sensor).location().await.is_ok(),
            Device::Photometer => rig.photometer().ticks().await.is_ok(),
        };
        if answered {
            return true;
        }
    }
    false
}

/// Whether all devices can be read in one transaction, as a run does; told only where they cannot, or not surely. The
/// servos' indirect addresses are set for that, in their RAM, or in the EEPROM of a P series. Moves nothing.
pub async fn together(drive: &mut Drive<Dynamixel>) -> Option<Finding> {
    const CHECK: &str = "bulk read";
    const READS: usize = 20;
    if let Err(error) = drive.rig().map_all().await {
        return Some(Finding::error(CHECK, &error));
    }
    let old = Arm::BOTH.map(|arm| drive.rig().axis(arm).lacks_indirect_data());
    for (arm, lacks) in Arm::BOTH.into_iter().zip(old) {
        if let Some((firmware, needed)) = lacks {
            let text = format!(
                "the {} ({}) has no indirect data at a known place before firmware {needed}, and has {firmware}: its \
                 state is read register by register, which takes several times as long and is not all of one moment",
                Device::from(arm),
                drive.file().arm(arm).model.name,
            );
            let remedy =
                "update its firmware with Dynamixel Wizard 2.0; until then do not use mode = \"fly\"";
            return Some(Finding::warn(CHECK, text, remedy));
        }
    }
    let (mut lost, mut last) = (0, None);
    for n in 0..READS {
        let read = match n % 2 {
            0 => drive.rig().snapshot().await.map(drop),
            _ => drive.rig().observe().await.map(drop),
        };
        if let Err(error) = read {
            lost += 1;
            last = Some(error);
        }
    }
    let error = last?;
    let text =
        format!("{lost} of {READS} reads of all devices in one transaction failed, the last one: {error}");
    let remedy = "each answers by itself, so it is their answers one after the other: make bus.latency_ms larger, set \
                  every return delay (address 9) to 250 or less, and update the firmware of the device that is named";
    Some(match lost == READS {
        true => Finding::fail(CHECK, text, remedy),
        false => Finding::warn(CHECK, text, remedy),
    })
}

/// Whether one device is as the rig file says and healthy: model, firmware, return delay, modes, limits, alert bits.
pub async fn device<R: Rig>(drive: &mut Drive<R>, device: Device) -> Finding {
    let check = match device {
        Device::Light => "light servo",
        Device::Sensor => "sensor servo",
        Device::Photometer => "photometer",
    };
    match drive.identify(device).await {
        Ok(identity) if device == Device::Photometer && !drive.file().detector.on_bus() => {
            let detector = &drive.file().detector;
            let text = format!("{} at {}", identity.model, detector.address);
            let limits = detector.abilities().limits();
            Finding::ok(check, format!("{text}; {}", limits.join("; ")))
        }
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
