use std::str::FromStr;

use anyhow::Context;
use pdv::{Check, Placement};
use report::RunExport;

use crate::cli::DaemonArguments;
use crate::run_files::RunFiles;

/// Degrees by which a wedge tilts. Below 15° a reading on it tells next to nothing, and beyond 60° few arms stand above it.
const TILT_DEG: std::ops::RangeInclusive<f64> = 15.0..=60.0;

/// Mean |ln(f/f̂)| of what the others foretell of each reading above which somebody should look: with all imperfections one of 40
/// stand-ins is above it, and 11 of 20 on two wedges that were swapped.
const UNLIKELY: f64 = 0.4;

/// A run whose specimen lay on a wedge about the plane of the arms, as `--wedge` takes it: `20=RUN`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wedge {
    tilt_deg: f64,
    run: String,
}

impl FromStr for Wedge {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((tilt, run)) = text.split_once('=') else {
            return Err("it has no \"=\"; write DEGREES=RUN, such as 20=runs/on-20".to_owned());
        };
        if run.is_empty() {
            return Err(
                "no run stands behind the \"=\"; write DEGREES=RUN, such as 20=runs/on-20".to_owned(),
            );
        }
        match tilt.trim().parse::<f64>() {
            Ok(tilt_deg) if TILT_DEG.contains(&tilt_deg) => Ok(Self {
                tilt_deg,
                run: run.to_owned(),
            }),
            _ => Err(format!(
                "the wedge is \"{tilt}\"; allowed is a tilt of {} … {} degrees",
                TILT_DEG.start(),
                TILT_DEG.end()
            )),
        }
    }
}

/// Corrects a result by runs on wedges, and says on stderr what they changed.
///
/// # Errors
/// A run that cannot be found or read, or that none of its readings say anything of the specimen.
pub(crate) fn correct(
    result: RunExport,
    wedges: &[Wedge],
    daemon: &DaemonArguments,
) -> anyhow::Result<RunExport> {
    if wedges.is_empty() {
        return Ok(result);
    }
    let mut readings = Vec::new();
    for wedge in wedges {
        let on = Placement {
            tilt: wedge.tilt_deg.to_radians(),
            ..Placement::FLAT
        };
        let of_run = RunFiles::find(&wedge.run, daemon)?
            .records()
            .and_then(|records| Ok(report::readings_on_wedge(&records, &on)?))
            .with_context(|| format!("the run {} on the wedge of {}°", wedge.run, wedge.tilt_deg))?;
        readings.extend(of_run);
    }
    let (result, check) = result.corrected(&readings);
    terminal::say(told(&check)?);
    Ok(result)
}

/// What the readings say of the model, in words.
fn told(check: &Check) -> anyhow::Result<String> {
    let (Some(before), Some(foretold), Some(after)) = (check.before, check.foretold, check.after) else {
        anyhow::bail!(
            "none of the {} readings on wedges tells anything: each lies in one plane with the normal, beyond 80°, or saw no \
             light; wedges of 20 and 45° with the arms along the arc tell most",
            check.dropped
        );
    };
    let percent = |log: f64| 100.0 * log.exp_m1();
    let helped = match foretold < before {
        true => "each is foretold by the others, so they also help where nothing was read",
        false => "none is foretold by the others: they say little of where nothing was read",
    };
    let unlikely = match foretold > UNLIKELY {
        true => {
            "; that is unusual: look whether the tilts belong to these runs, and whether the wedges stood with their notches in \
             the plane of the arms; else this specimen is far from what the plane tells of it"
        }
        false => "",
    };
    Ok(format!(
        "{} readings on wedges correct the result, {} tell nothing; it was off from them by {:.1} % in the mean, by {:.1} % where \
         the others correct it, and now is by {:.1} %; {helped}{unlikely}",
        check.readings,
        check.dropped,
        percent(before),
        percent(foretold),
        percent(after)
    ))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn prop_a_wedge_is_read_as_it_is_written(tilt_deg in TILT_DEG, run in "[a-zA-Z0-9/.:=-]{1,40}") {
            let read = format!("{tilt_deg}={run}").parse::<Wedge>();
            prop_assert_eq!(read, Ok(Wedge { tilt_deg, run }));
        }

        #[test]
        fn prop_no_text_panics(text in any::<String>()) {
            let _ = text.parse::<Wedge>();
        }
    }

    #[test]
    fn what_is_no_wedge_is_told_with_what_is() {
        for (text, said) in [
            ("20", "DEGREES=RUN"),
            ("20=", "DEGREES=RUN"),
            ("10=runs/a", "15 … 60"),
            ("NaN=runs/a", "15 … 60"),
            ("steep=runs/a", "\"steep\""),
        ] {
            let why = text.parse::<Wedge>().unwrap_err();
            assert!(why.contains(said), "{text}: {why}");
        }
    }

    #[test]
    fn what_wedges_changed_is_told_and_nothing_is_an_error() {
        let check = Check {
            readings: 8,
            dropped: 2,
            before: Some(0.2),
            foretold: Some(0.1),
            after: Some(0.05),
        };
        let text = told(&check).unwrap();
        for part in ["8 readings", "22.1 %", "10.5 %", "5.1 %", "also help"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let useless = Check {
            foretold: Some(0.3),
            ..check
        };
        assert!(told(&useless).unwrap().contains("say little"));
        let swapped = Check {
            foretold: Some(0.6),
            ..check
        };
        assert!(told(&swapped).unwrap().contains("look whether the tilts"));
        let nothing = Check {
            readings: 0,
            dropped: 5,
            before: None,
            foretold: None,
            after: None,
        };
        let why = told(&nothing).unwrap_err().to_string();
        assert!(
            why.contains("none of the 5") && why.contains("20 and 45°"),
            "{why}"
        );
    }
}
