use super::Finding;
use crate::{Band, Device, Drive, Rig, Surroundings, Suspend};

const CHECK: &str = "suspend";

/// What of the surroundings would hold a run by `[suspend]` before its first motion; nothing where none would. Reads what
/// a run reads, and moves nothing.
pub async fn suspend<R: Rig>(drive: &mut Drive<R>) -> Vec<Finding> {
    match drive.surroundings().await {
        Ok(found) => judged(&found, &drive.file().suspend),
        Err(error) => vec![Finding::error(CHECK, &error)],
    }
}

fn judged(found: &Surroundings, bounds: &Suspend) -> Vec<Finding> {
    let devices = [Device::Light, Device::Sensor, Device::Photometer];
    let mut findings = Vec::new();
    if bounds.door && found.door_open {
        findings.push(Finding::fail(
            CHECK,
            "the door is open, and [suspend] holds every run until it is closed",
            "close it, or set suspend.door = false",
        ));
    }
    for (device, value) in devices.into_iter().zip(found.supply_v) {
        let text = format!("the supply of the {device} is {value:.1} V");
        findings.extend(held(bounds.supply_v, value, &text, |band| {
            format!(
                "raise the supply to {} V at the servo, where it is 12 V by right; or lower suspend.supply_v",
                band.release
            )
        }));
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
        let bounds = RigFile::default().suspend;
        let found = Surroundings {
            supply_v: [12.0, 5.0],
            ..sound()
        };
        let findings = judged(&found, &bounds);
        assert_eq!(findings.len(), 1, "{findings:?}");
        assert!(findings[0].text.contains("sensor servo is 5.0 V"), "{findings:?}");
        let remedy = findings[0].remedy.as_ref().unwrap();
        assert!(
            remedy.contains("to 11 V") && remedy.contains("suspend.supply_v"),
            "{remedy}"
        );
    }

    proptest! {
        /// Nothing is told exactly where a run would not be held.
        #[test]
        fn prop_a_finding_is_told_where_a_run_would_be_held(
            supply_v in 3.0..20.0f64,
            temperature_c in 0.0..120.0f64,
            door_open in any::<bool>(),
            door in any::<bool>(),
        ) {
            let bounds = Suspend { door, ..RigFile::default().suspend };
            let found = Surroundings {
                supply_v: [12.0, supply_v],
                temperature_c: [30.0, temperature_c, 30.0],
                door_open,
            };
            let holds = |band: Option<Band>, value| band.is_some_and(|band| band.holds(value, false));
            let held = (door && door_open)
                || holds(bounds.supply_v, supply_v)
                || holds(bounds.temperature_c, temperature_c);
            prop_assert_eq!(judged(&found, &bounds).is_empty(), !held);
        }
    }
}
