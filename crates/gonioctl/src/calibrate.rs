use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use capture::{Command, Event, Outcome};
use report::{Standard, WhiteReference};
use serde_json::json;
use session::{Calibrated, Calibration};
use tokio::sync::watch;

use crate::cli::{CalibrateArguments, OnStage};
use crate::document;
use crate::exit;
use crate::progress::Progress;
use crate::run::obey;
use crate::signals::Signals;

/// Takes the readings of a standard and stores what they say.
///
/// # Errors
/// Whatever keeps the calibration from beginning, or its certificate from being made.
pub(crate) fn calibrate(arguments: &CalibrateArguments) -> anyhow::Result<ExitCode> {
    let calibration = Calibration::new(
        arguments.rig.rig.as_deref(),
        standard(&arguments.stage)?,
        arguments.specimen.as_deref(),
    )?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()?;
    let calibrated = runtime.block_on(async {
        let (sender, control) = watch::channel(Command::Run);
        // Before anything can move.
        let signals = Signals::listen()?;
        let begun = Arc::new(AtomicBool::new(false));
        tokio::spawn(obey(signals, sender, begun.clone()));
        let mut progress = Progress::new();
        let mut show = |event: Event| {
            begun.store(true, Ordering::Release);
            progress.show(&event);
        };
        let calibrated = calibration.carry_out(control, &mut show).await;
        progress.finish();
        anyhow::Ok(calibrated?)
    })?;
    if arguments.output.json {
        document::CALIBRATION.print(&json!({
            "outcome": calibrated.outcome,
            "directory": calibrated.directory,
            "certificate": calibrated.certificate.as_ref().map(|(certificate, _)| certificate),
        }))?;
    } else {
        say(&calibrated);
        if let Some((_, path)) = &calibrated.certificate {
            terminal::line(path.display())?;
        }
    }
    Ok(exit::code(calibrated.status()))
}

fn standard(stage: &OnStage) -> anyhow::Result<Standard> {
    Ok(match stage {
        OnStage::White { standard: None } => Standard::White(WhiteReference::default()),
        OnStage::White { standard: Some(path) } => {
            let name = path.display().to_string();
            let text = config::read_text(path).with_context(|| format!("cannot read {name}"))?;
            Standard::White(WhiteReference::parse(&text, &name)?)
        }
        OnStage::Trap => Standard::Trap,
        OnStage::Mirror => Standard::Mirror,
        OnStage::Patch { name, rgb } => Standard::Patch {
            name: name.clone(),
            rgb: [rgb[0], rgb[1], rgb[2]],
        },
    })
}

fn say(calibrated: &Calibrated) {
    match &calibrated.outcome {
        Outcome::Done => {}
        Outcome::Stopped => terminal::say("stopped; no certificate was made"),
        Outcome::Failed { fault } => terminal::say(format_args!("failed: {fault}; no certificate was made")),
    }
    let Some((certificate, _)) = &calibrated.certificate else {
        return;
    };
    terminal::say(format_args!("calibration {}", certificate.id));
    if let Some(white) = &certificate.white {
        let [r, g, b] = white.responsivity;
        let u = white.u_responsivity.into_iter().fold(0.0, f64::max);
        terminal::say(format_args!(
            "white     responsivity {r:.4}, {g:.4}, {b:.4} (± {:.2} %, k = 2)",
            200.0 * u
        ));
        terminal::say(format_args!(
            "          gains ×1, ×{:.3} (± {:.2} %), ×{:.2} (± {:.2} %); {:.3} % (± {:.3} %) lost at full scale, k = 2",
            white.gains[1],
            200.0 * white.u_gains[1],
            white.gains[2],
            200.0 * white.u_gains[2],
            100.0 * white.nonlinearity,
            200.0 * white.u_nonlinearity
        ));
    }
    if let Some(trap) = &certificate.trap {
        let most = trap
            .points
            .iter()
            .flat_map(|(_, rates)| *rates)
            .fold(0.0, f64::max);
        terminal::say(format_args!(
            "trap      stray light at {} poses, at most {most:.2e} counts/µs",
            trap.points.len()
        ));
    }
    if let Some(zero) = &certificate.zero {
        terminal::say(format_args!(
            "mirror    {:.3}° to be added to each angle (half the sum of the zeros ± {:.3}°, k = 2; their difference is not told)",
            zero.offset_rad.to_degrees(),
            2.0 * zero.u_rad.to_degrees()
        ));
    }
    match (&certificate.colour, certificate.patches.len()) {
        (Some(colour), n) => terminal::say(format_args!(
            "colour    matrix of {n} patches, {:.2} % left over",
            100.0 * colour.residual
        )),
        (None, 0) => {}
        (None, n) => terminal::say(format_args!(
            "colour    {n} patches; a matrix needs three that differ"
        )),
    }
}
