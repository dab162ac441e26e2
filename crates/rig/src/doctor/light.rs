use super::Finding;
use super::suspend::held;
use crate::{Counts, Drive, DriveError, Exposure, Gain, Lamp, LampControl, PhotometerSettings, Rig};

/// Longest integration that is tried, µs.
const INTEGRATION_US: u32 = 10_000;

/// Share of full scale in the dark that leaves too little room for light.
const DARK_MAX: f64 = 0.05;

/// Lamp output, of nominal, between which it is as it should be.
const LAMP: std::ops::RangeInclusive<f64> = 0.5..=1.5;

/// Lamp output, of nominal, below which there is no light.
const LAMP_MIN: f64 = 0.01;

/// Dark level, then the lamp: switches it on, waits until it is warm, looks at the monitor and switches it off again,
/// whatever happens. Moves nothing.
pub async fn light<R: Rig>(drive: &mut Drive<R>) -> Vec<Finding> {
    let mut findings = Vec::new();
    let done = attempt(drive, &mut findings).await;
    // Off on every way out; a photometer that is silent puts it out itself.
    let off = drive.lamp(false).await;
    for error in [done.err(), off.err()].into_iter().flatten() {
        findings.push(Finding::error("lamp", &error));
    }
    findings
}

async fn attempt<R: Rig>(
    drive: &mut Drive<R>,
    findings: &mut Vec<Finding>,
) -> Result<(), DriveError<R::Error>> {
    let settings = drive.file().photometer.clone();
    let integration_us = INTEGRATION_US.clamp(settings.integration_min_us, settings.integration_max_us);
    drive.lamp(false).await?;
    let mut dark = Vec::new();
    for gain in Gain::ALL {
        dark.push(drive.expose(Exposure { integration_us, gain }).await?);
    }
    findings.push(darkness(&dark, &settings));

    let monitor = drive.file().calibration.monitor;
    let fitting_us = settings.aim * f64::from(settings.full_scale) / monitor;
    let lit_us = integration_us
        .min(fitting_us as u32)
        .max(settings.integration_min_us);
    let exposure = Exposure {
        integration_us: lit_us,
        gain: Gain::X1,
    };
    let unlit = drive.expose(exposure).await?;
    drive.lamp(true).await?;
    drive.wait(settings.lamp_warm_up).await?;
    let lit = drive.expose(exposure).await?;
    let abilities = drive.file().detector.abilities();
    if !abilities.monitor {
        findings.push(unmonitored(&unlit, &lit, abilities.lamp));
        return Ok(());
    }
    let output = (f64::from(lit.monitor) - f64::from(unlit.monitor)) / (monitor * f64::from(lit_us));
    let followed = drive.file().visits.lamp == Lamp::Monitor;
    let bounds = drive.file().suspend.lamp_rel.filter(|_| followed);
    let text = format!(
        "the lamp is {:.1} % off its nominal output",
        100.0 * (output - 1.0).abs()
    );
    let held = held(bounds, (output - 1.0).abs(), &text, |_| {
        "set calibration.monitor to what this lamp gives, or widen suspend.lamp_percent".to_owned()
    });
    findings.push(lamp(output, lit.temperature_c));
    findings.extend(held);
    Ok(())
}

/// What is seen of a lamp that no monitor looks at: what the detector counts where the arms stand.
fn unmonitored(unlit: &Counts, lit: &Counts, lamp: LampControl) -> Finding {
    const CHECK: &str = "lamp";
    let text = format!(
        "no monitor tells its output; where the arms stand, {} counts with it and {} without",
        lit.rgb[0], unlit.rgb[0]
    );
    match lamp {
        LampControl::Always => Finding::warn(
            CHECK,
            format!("{text}: nothing switches it"),
            "no stop, fault or end of a run puts this lamp out: make sure that it may stay on, or let something switch it \
             (detector.lamp)",
        ),
        LampControl::Node | LampControl::Scpi => Finding::ok(CHECK, text),
    }
}

/// Judges dark readings, one at each gain.
fn darkness(dark: &[Counts], settings: &PhotometerSettings) -> Finding {
    const CHECK: &str = "dark";
    let levels: Vec<_> = dark
        .iter()
        .map(|counts| {
            let [r, g, b] = counts.rgb;
            format!("×{}: {r}, {g}, {b}", u16::from(counts.exposure.gain))
        })
        .collect();
    let time_ms = dark
        .first()
        .map_or(0.0, |counts| f64::from(counts.exposure.integration_us) / 1e3);
    let text = format!("counts in {time_ms} ms without lamp, {}", levels.join("; "));
    let share = |counts: &Counts| {
        let most = counts.rgb.into_iter().max().unwrap_or_default();
        f64::from(most) / f64::from(settings.full_scale)
    };
    let bright: Vec<_> = dark.iter().filter(|counts| share(counts) > DARK_MAX).collect();
    let remedy = "something shines in: cover the rig, darken the room, look for a lamp that stays on";
    match bright.as_slice() {
        [] => Finding::ok(CHECK, text),
        some if some.iter().any(|counts| counts.exposure.gain == Gain::X1) => {
            Finding::fail(CHECK, text, remedy)
        }
        _ => Finding::warn(CHECK, text, remedy),
    }
}

/// Judges the lamp's output, of nominal.
fn lamp(output: f64, temperature_c: u8) -> Finding {
    const CHECK: &str = "lamp";
    let text = format!(
        "{:.1} % of nominal by the monitor; photometer at {temperature_c} °C",
        100.0 * output
    );
    if output < LAMP_MIN {
        Finding::fail(
            CHECK,
            text,
            "no light: check the lamp, its supply and the monitor's photodiode",
        )
    } else if LAMP.contains(&output) {
        Finding::ok(CHECK, text)
    } else {
        Finding::warn(
            CHECK,
            text,
            "replace an aged lamp, or correct calibration.monitor after another was fitted",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RigFile;
    use crate::doctor::Verdict;

    fn dark(red: u32, gain: Gain) -> Counts {
        Counts {
            rgb: [red, 10, 10],
            monitor: 0,
            exposure: Exposure {
                integration_us: 10_000,
                gain,
            },
            saturated: false,
            sequence: 1,
            ticks: 0,
            temperature_c: 23,
        }
    }

    #[test]
    fn light_in_the_dark_is_told() {
        let settings = RigFile::default().photometer;
        let verdict = |red, gain| darkness(&[dark(red, gain)], &settings).verdict;
        assert_eq!(verdict(70, Gain::X1), Verdict::Ok);
        assert_eq!(verdict(60_000, Gain::X256), Verdict::Warn);
        assert_eq!(verdict(60_000, Gain::X1), Verdict::Fail);
    }

    #[test]
    fn a_weak_lamp_is_told_and_a_dark_one_fails() {
        let verdict = |output| lamp(output, 23).verdict;
        assert_eq!(verdict(0.001), Verdict::Fail);
        assert_eq!(verdict(0.2), Verdict::Warn);
        assert_eq!(verdict(0.98), Verdict::Ok);
        assert_eq!(verdict(3.0), Verdict::Warn);
        assert_eq!(verdict(f64::NAN), Verdict::Warn);
    }
}
