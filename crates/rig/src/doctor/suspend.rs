use super::Finding;
use crate::dynamixel::Model;
use crate::{Band, Device, Drive, Rig, RigFile, Surroundings};

const CHECK: &str = "suspend";

/// What of the surroundings would hold a run by `[suspend]` before its first motion, and a supply that a servo is not made
/// for; nothing where none would. Reads what a run reads, and moves nothing.
pub async fn suspend<R: Rig>(drive: &mut Drive<R>) -> Vec<Finding> {
    match drive.surroundings().await {
        Ok(found) => judged(&found, drive.file()),
        Err(error) => vec![Finding::error(CHECK, &error)],
    }
}

fn judged(found: &Surroundings, file: &RigFile) -> Vec<Finding> {
    let bounds = &file.suspend;
    let devices = [Device::Light, Device::Sensor, Device::Photometer];
    let mut findings = Vec::new();
    if bounds.door && found.door_open {
        findings.push(Finding::fail(
            CHECK,
            "the door is open, and [suspend] holds every run until it is closed",
            "close it, or set suspend.door = false",
        ));
    }
    for (arm, device) in file.arms.iter().zip(devices) {
        let (value, model) = (found.supply_v[device as usize], arm.model);
        let text = format!("the supply of the {device} is {value:.1} V");
        let held = held(bounds.supply_v[device as usize], value, &text, |band| {
            format!(
                "raise the supply to {} V at the servo, where it is {} V by right; or lower suspend.supply_v",
                band.release, model.supply_v
            )
        });
        findings.extend(held.or_else(|| outside(value, &text, model)));
    }
    for (device, value) in devices.into_iter().zip(found.temperature_c) {
        let text = format!("the {device} has {value} °C");
        findings.extend(held(bounds.temperature_c, value, &text, |band| {
            format!(
                "let it cool to {} °C: less load, more air; or raise suspend.temperature_c",
                band.release
            )
        }));
    }
    findings
}

/// A supply that a model is not made for.
fn outside(value_v: f64, text: &str, model: &Model) -> Option<Finding> {
    let range = model.voltage_v();
    if range.contains(&value_v) {
        return None;
    }
    let text = format!(
        "{text}, and the {} takes {} … {} V",
        model.name,
        range.start(),
        range.end()
    );
    let remedy = format!("give it the {} V that it is made for", model.supply_v);
    Some(Finding::fail(CHECK, text, remedy))
}

/// A value at which a run would be held.
pub(super) fn held(
    band: Option<Band>,
    value: f64,
    text: &str,
    remedy: impl Fn(Band) -> String,
) -> Option<Finding> {
    let band = band.filter(|band| band.holds(value, false))?;
    let text = format!(
        "{text}: [suspend] holds every run there, from {} on until {}",
        band.hold, band.release
    );
    Some(Finding::fail(CHECK, text, remedy(band)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::RigFile;

    fn sound() -> Surroundings {
        Surroundings {
            supply_v: [12.0; 2],
            temperature_c: [30.0; 3],
            door_open: false,
        }
    }

    #[test]
    fn a_supply_of_5_v_is_told_with_what_it_must_be() {
        let found = Surroundings {
            supply_v: [12.0, 5.0],
            ..sound()
        };
        let findings = judged(&found, &RigFile::default());
        assert_eq!(findings.len(), 1, "{findings:?}");
        assert!(findings[0].text.contains("sensor servo is 5.0 V"), "{findings:?}");
        let remedy = findings[0].remedy.as_ref().unwrap();
        assert!(
            remedy.contains("to 11 V") && remedy.contains("suspend.supply_v"),
            "{remedy}"
        );
    }

    #[test]
    fn a_supply_that_a_model_is_not_made_for_is_told() {
        let rig = |model: &str| {
            let text = format!("[light]\nmodel = \"{model}\"\nvelocity_deg_s = 30\n");
            RigFile::parse(&text, std::path::Path::new("test.toml")).unwrap()
        };
        let found = |supply_v| Surroundings {
            supply_v: [supply_v, 12.0],
            ..sound()
        };
        let text = |model, supply_v| {
            judged(&found(supply_v), &rig(model))
                .first()
                .map(|f| f.text.clone())
        };
        let told = text("XM430-W350", 24.0).unwrap();
        assert!(
            told.contains("24.0 V, and the XM430-W350 takes 9.5 … 16 V"),
            "{told}"
        );
        assert_eq!(text("XH430-V350", 24.0), None);
        let told = text("XH430-V350", 12.0).unwrap();
        assert!(
            told.contains("12.0 V: [suspend] holds every run there, from 21 on until 22"),
            "{told}"
        );
        assert_eq!(text("XL330-M288", 5.0), None);
        assert!(text("XL330-M288", 12.0).is_some());
    }

    proptest! {
        /// Something is told where a run would be held or a servo has a supply that it is not made for, and only there.
        #[test]
        fn prop_a_finding_is_told_where_a_run_would_be_held(
            supply_v in 3.0..20.0f64,
            temperature_c in 0.0..120.0f64,
            door_open in any::<bool>(),
            door in any::<bool>(),
        ) {
            let mut file = RigFile::default();
            file.suspend.door = door;
            let bounds = file.suspend;
            let found = Surroundings {
                supply_v: [12.0, supply_v],
                temperature_c: [30.0, temperature_c, 30.0],
                door_open,
            };
            let holds = |band: Option<Band>, value| band.is_some_and(|band| band.holds(value, false));
            let held = (door && door_open)
                || holds(bounds.supply_v[1], supply_v)
                || !file.arms[1].model.voltage_v().contains(&supply_v)
                || holds(bounds.temperature_c, temperature_c);
            prop_assert_eq!(judged(&found, &file).is_empty(), !held);
        }
    }
}
