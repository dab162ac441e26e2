use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use serde_json::json;
use session::Status;
use study::{Campaign, Campaigned, Script, Wrong};

use crate::document;
use crate::exit;
use crate::junit::{Case, Junit, Outcome};

/// Fresh seeds are below this, so that they are short enough to be typed.
const SEEDS: u64 = 1_000_000_000;

/// Carries out a campaign and prints each capture that went wrong as a script to replay.
///
/// # Errors
/// Stdout refuses, or the file for CI servers cannot be written.
pub(crate) fn campaign(
    captures: u64,
    seed: Option<u64>,
    over_wire: bool,
    junit: Option<&Junit>,
    as_json: bool,
) -> anyhow::Result<ExitCode> {
    let fresh = || {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        since.as_micros() as u64 % SEEDS
    };
    let seed = seed.unwrap_or_else(fresh);
    terminal::say(format_args!("{captures} captures, seed {seed}"));
    let begun = Instant::now();
    let told = AtomicU64::new(0);
    let campaigned = Campaign {
        captures,
        seed,
        over_wire,
    }
    .run(&|done, of| {
        let tenth = 10 * done / of.max(1);
        if told.fetch_max(tenth, Ordering::Relaxed) < tenth {
            terminal::say(format_args!("{done} of {of}"));
        }
    });
    terminal::say(format_args!(
        "{} captures with {} faults in {:.1} s: {} executions, {} readings true within their uncertainty, {} captures told to be bad",
        campaigned.captures,
        campaigned.faults,
        begun.elapsed().as_secs_f64(),
        campaigned.executions,
        campaigned.readings,
        campaigned.bad
    ));
    if let Some(junit) = junit {
        junit.write(&cases(seed, &campaigned))?;
    }
    if as_json {
        document::CAMPAIGN.print(&campaigned)?;
    } else {
        for Wrong { script, why } in &campaigned.wrong {
            terminal::line(format_args!("# {}", why.replace('\n', " ")))?;
            for line in script.to_string().lines() {
                terminal::line(line)?;
            }
        }
    }
    Ok(verdict(campaigned.wrong.is_empty()))
}

/// Each capture as a test.
fn cases(seed: u64, campaigned: &Campaigned) -> Vec<Case> {
    let name = |seed: u64| format!("capture of seed {seed}");
    let wrong = |seed| {
        let wrong = campaigned.wrong.iter().find(|wrong| wrong.script.seed == seed)?;
        Some(Case::new(name(seed), Outcome::Failed(wrong.why.clone())).saying(wrong.script.to_string()))
    };
    let seeds = (0..campaigned.captures).map(|i| seed.wrapping_add(i));
    seeds
        .map(|seed| wrong(seed).unwrap_or_else(|| Case::new(name(seed), Outcome::Passed)))
        .collect()
}

/// Carries out one script.
///
/// # Errors
/// The file is no script, or the one for CI servers cannot be written; stdout refuses.
pub(crate) fn replay(path: &Path, junit: Option<&Junit>, as_json: bool) -> anyhow::Result<ExitCode> {
    let script = Script::read(path)?;
    let carried = script.carry();
    if let Some(junit) = junit {
        let outcome = match &carried {
            Ok(_) => Outcome::Passed,
            Err(why) => Outcome::Failed(why.clone()),
        };
        let name = format!("replay of {}", path.display());
        junit.write(&[Case::new(name, outcome).saying(script.to_string())])?;
    }
    match &carried {
        Ok(carried) if as_json => document::REPLAY.print(carried)?,
        Err(why) if as_json => document::REPLAY.print(&json!({ "wrong": why }))?,
        Ok(carried) if carried.bad => terminal::line(format_args!(
            "{} executions, and its report says that it is not to be believed",
            carried.executions
        ))?,
        Ok(carried) => terminal::line(format_args!(
            "{} executions, {} readings true within their uncertainty",
            carried.executions, carried.readings
        ))?,
        Err(why) => terminal::line(why)?,
    }
    Ok(verdict(carried.is_ok()))
}

fn verdict(right: bool) -> ExitCode {
    exit::code(if right { Status::Done } else { Status::Rig })
}
