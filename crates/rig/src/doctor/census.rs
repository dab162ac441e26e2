use std::path::Path;

use super::Finding;
use crate::dynamixel::{BAUD_RATES, Census, Heard};
use crate::{Device, Port, RigError, RigFile};

const CHECK: &str = "devices";

/// Asks who is there at the rig file's baud rate, and at all others where somebody is missing. Opens and locks the
/// port and releases it again; blocks for about a second, several where somebody is missing.
///
/// Returns the devices of the rig file that answer at its baud rate, under their ids.
pub fn census(port: &Path, file: &RigFile, tell: &mut dyn FnMut(Finding)) -> Vec<Device> {
    match attempt(port, file, tell) {
        Ok(present) => present,
        Err(error) => {
            tell(Finding::error(CHECK, &error));
            Vec::new()
        }
    }
}

fn attempt(port: &Path, file: &RigFile, tell: &mut dyn FnMut(Finding)) -> Result<Vec<Device>, RigError> {
    let baud = file.bus.baud;
    let here = Census::take(port, &file.bus, baud)?;
    let wanted = wanted(file);
    let answers = |id: u8| here.heard.iter().any(|device| device.id == id);
    let (mut present, missing): (Vec<_>, Vec<_>) = wanted.iter().partition(|&&(_, id)| answers(id));
    let strangers: Vec<_> = here
        .heard
        .iter()
        .filter(|device| wanted.iter().all(|&(_, id)| id != device.id))
        .copied()
        .collect();
    if missing.is_empty() {
        let all = if wanted.len() == 3 {
            "all three"
        } else {
            "both servos"
        };
        let text = format!("{all} answer at {baud} baud: {}", listed(&here.heard));
        tell(Finding::ok(CHECK, text));
    }
    if here.damaged > 0 {
        let text = format!("{} damaged answers at {baud} baud", here.damaged);
        let remedy =
            "two devices with one id, a loose cable, a missing ground, or an adapter that echoes (bus.echo)";
        tell(Finding::warn(CHECK, text, remedy));
    }
    if !strangers.is_empty() && missing.is_empty() {
        let text = format!("there are more than the rig file names: {}", listed(&strangers));
        tell(Finding::warn(
            CHECK,
            text,
            "take them off the bus, or correct the ids",
        ));
    }
    if !missing.is_empty() {
        let elsewhere = elsewhere(port, file)?;
        for (device, id) in missing {
            // Alike servos with one id answer a ping with the same bytes at once, which is an undamaged answer.
            let twin = present.iter().find(|(other, _)| *other != Device::Photometer);
            let twin = twin.filter(|_| device != Device::Photometer).map(|&(_, id)| id);
            let remedy = remedy(device, id, baud, &strangers, &elsewhere, (here.damaged, twin));
            let text = format!("{device} (id {id}) gives no reply at {baud} baud");
            tell(Finding::fail(CHECK, text, remedy));
        }
    }
    // Whether one elsewhere answers shows when it is asked.
    if !file.detector.on_bus() && present.iter().all(|(device, _)| *device != Device::Photometer) {
        present.push((Device::Photometer, file.photometer.id));
    }
    Ok(present.into_iter().map(|(device, _)| device).collect())
}

/// The devices that a rig file names, and their ids.
fn wanted(file: &RigFile) -> Vec<(Device, u8)> {
    let mut wanted = vec![
        (Device::Light, file.arms[0].id),
        (Device::Sensor, file.arms[1].id),
    ];
    // The built-in simulator has one in any case, which lets time pass.
    if file.detector.has_node() || file.bus.port == Port::Sim {
        wanted.push((Device::Photometer, file.photometer.id));
    }
    wanted
}

/// Who answers at the other baud rates.
fn elsewhere(port: &Path, file: &RigFile) -> Result<Vec<(u32, Heard)>, RigError> {
    let mut found = Vec::new();
    for (_, baud) in BAUD_RATES {
        if baud == file.bus.baud {
            continue;
        }
        let census = match Census::take(port, &file.bus, baud) {
            // An adapter that cannot do it does not hide a device at it.
            Err(RigError::PortUnusable { .. }) => continue,
            other => other?,
        };
        found.extend(census.heard.into_iter().map(|device| (baud, device)));
    }
    Ok(found)
}

/// What to do about a device that does not answer, from who else does.
fn remedy(
    device: Device,
    id: u8,
    baud: u32,
    strangers: &[Heard],
    elsewhere: &[(u32, Heard)],
    (damaged, twin): (usize, Option<u8>),
) -> String {
    if let Some((at, _)) = elsewhere.iter().find(|(_, heard)| heard.id == id) {
        let code = BAUD_RATES.iter().find(|&&(_, rate)| rate == baud);
        let code = code.map_or(0, |&(code, _)| code);
        return format!(
            "it answers at {at} baud: set bus.baud = {at}, or write {code} to its address 8 at {at} baud"
        );
    }
    let alike = |heard: &&Heard| (heard.name() == Some("photometer")) == (device == Device::Photometer);
    if let Some(stranger) = strangers.iter().find(alike) {
        return format!(
            "{} answers under an id that the rig file does not name: correct the id, or write {id} to its address 7",
            named(stranger)
        );
    }
    if let Some((at, stranger)) = elsewhere.iter().find(|(_, heard)| alike(&heard)) {
        return format!(
            "{} answers at {at} baud: set its id and baud rate",
            named(stranger)
        );
    }
    if damaged > 0 {
        return format!(
            "answers were damaged, as those of two devices with one id are: unplug the others, see under which id the \
             {device} answers alone, and write {id} to its address 7"
        );
    }
    let nobody = "check its power and its cable; nobody answers under this id at any baud rate";
    match twin {
        Some(twin) => format!(
            "{nobody}. Or both servos have the id {twin}: two devices with one id answer a ping as one, where they are alike. \
             Unplug the other, see whether one still answers under {twin}, and write {id} to its address 7"
        ),
        None => nobody.to_owned(),
    }
}

fn listed(devices: &[Heard]) -> String {
    devices.iter().map(named).collect::<Vec<_>>().join(", ")
}

fn named(device: &Heard) -> String {
    match device.name() {
        Some(name) => format!("{name} (id {})", device.id),
        None => format!("model {} (id {})", device.model, device.id),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SERVO: Heard = Heard {
        id: 1,
        model: 1020,
        firmware: 45,
    };

    #[test]
    fn the_remedy_follows_from_who_else_answers() {
        let to = |device, id, strangers: &[Heard], elsewhere: &[(u32, Heard)]| {
            remedy(device, id, 1_000_000, strangers, elsewhere, (0, None))
        };
        let told = remedy(Device::Sensor, 2, 1_000_000, &[], &[], (0, Some(1)));
        assert!(told.contains("both servos have the id 1"), "{told}");
        let told = remedy(Device::Sensor, 2, 1_000_000, &[], &[], (3, None));
        assert!(
            told.contains("two devices with one id") && told.contains("write 2 to its address 7"),
            "{told}"
        );
        let told = to(Device::Light, 1, &[], &[(57_600, SERVO)]);
        assert_eq!(
            told,
            "it answers at 57600 baud: set bus.baud = 57600, or write 3 to its address 8 at 57600 baud"
        );
        let told = to(Device::Light, 9, &[SERVO], &[]);
        assert!(
            told.starts_with("XM430-W350 (id 1) answers under an id") && told.contains("write 9"),
            "{told}"
        );
        let told = to(Device::Photometer, 3, &[SERVO], &[]);
        assert!(
            told.starts_with("check its power"),
            "a servo is no photometer: {told}"
        );
        let told = to(Device::Sensor, 2, &[], &[(57_600, SERVO)]);
        assert!(
            told.starts_with("XM430-W350 (id 1) answers at 57600 baud"),
            "{told}"
        );
    }
}
