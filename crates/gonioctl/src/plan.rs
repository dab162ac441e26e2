use std::path::Path;
use std::time::SystemTime;

use serde_json::json;
use session::RunRequest;
use sweep::{LeftOut, Light, Plan, Sweep, Until};

use crate::document;
use crate::progress::clock;

/// Says what a job would do; touches no hardware.
///
/// # Errors
/// What is wrong with the job or the rig file.
pub(crate) fn plan(job: &Path, rig: Option<&Path>, as_json: bool) -> anyhow::Result<()> {
    let order = RunRequest::read(job, rig)?;
    let plan = order.plan(None)?;
    if as_json {
        document::PLAN.print(&json!({
            "seconds": plan.seconds(),
            "overhead_s": plan.overhead_s,
            "closing_s": plan.closing_s,
            "readings": plan.steps.len(),
            "light": order.light(&plan),
            "left_out": plan.left_out,
            "open": plan.open,
            "until": order.job.until,
            "steps": plan.steps.iter().map(step).collect::<Vec<_>>(),
        }))?;
        return Ok(());
    }
    list(&plan, order.light(&plan))?;
    for limit in order.rig.detector.abilities().limits() {
        terminal::line(format_args!("detector   {limit}"))?;
    }
    if let Some(until) = order.job.until {
        terminal::line(then(until))?;
    }
    Ok(())
}

/// Prints the key under which the results of a job on a rig can be kept.
///
/// # Errors
/// What is wrong with the job or the rig file.
pub(crate) fn hash(job: &Path, rig: Option<&Path>, as_json: bool) -> anyhow::Result<()> {
    let order = RunRequest::read(job, rig)?;
    let hash = order.hash(&order.plan(None)?, SystemTime::now())?;
    match as_json {
        true => document::PLAN_HASH.print(&json!({ "hash": hash }))?,
        false => terminal::line(hash)?,
    }
    Ok(())
}

/// What follows on the first sweeps, in words.
fn then(until: Until) -> String {
    let target = until
        .target_male
        .map(|male| format!(" until an error (MALE) of {male} is expected,"));
    let budget = until
        .budget_s
        .map(|budget_s| format!(", at most until {} are over", clock(budget_s)));
    format!(
        "then       what the readings call for,{} or until nothing more would gain{}",
        target.unwrap_or_default(),
        budget.unwrap_or_default()
    )
}

/// What the choice of exposures may make of the time, in words.
fn exposures(light: Light) -> String {
    format!(
        "           {} of a bright specimen, {} of a dark one; {:.2} s more for each reading exposed again; at worst {} in all",
        clock(light.least_s),
        clock(light.most_s),
        light.again_s,
        clock(light.worst_s)
    )
}

/// A step for machines, in degrees.
fn step(step: &sweep::Step) -> serde_json::Value {
    let pose = step.pose();
    json!({
        "index": step.index,
        "sweep": step.sweep.to_string(),
        "light_deg": pose.light.deg(),
        "sensor_deg": pose.sensor.deg(),
        "d_p": pose.deviation().abs(),
        "lamp": step.lamp,
        "pass": step.pass,
        "legs": step.path.len(),
        "seconds": step.seconds,
    })
}

/// Prints a plan for people: each sweep in a line, then what is left out.
fn list(plan: &Plan, light: Light) -> std::io::Result<()> {
    let mut sweeps: Vec<(Sweep, bool, usize, f64)> = Vec::new();
    for step in &plan.steps {
        match sweeps.last_mut().filter(|sweep| sweep.0 == step.sweep) {
            Some((_, _, readings, seconds)) => {
                *readings += 1;
                *seconds += step.seconds;
            }
            None => sweeps.push((step.sweep, step.pass.is_some(), 1, step.seconds)),
        }
    }
    for (sweep, in_flight, readings, seconds) in sweeps {
        let name = match in_flight {
            true => format!("{sweep}, fly"),
            false => sweep.to_string(),
        };
        terminal::line(format_args!(
            "{name:<10} {readings:>5} readings {:>12}",
            clock(seconds)
        ))?;
    }
    terminal::line(format_args!(
        "{:<10} {:>14} {:>12}",
        "warm-up",
        "",
        clock(plan.overhead_s)
    ))?;
    terminal::line(format_args!(
        "{:<10} {:>14} {:>12}",
        "last dark",
        "",
        clock(plan.closing_s)
    ))?;
    terminal::line(format_args!(
        "{:<10} {:>5} readings {:>12}",
        "together",
        plan.steps.len(),
        clock(plan.seconds())
    ))?;
    terminal::line(format_args!(
        "{:<10} {:>5} readings {:>12}",
        "its light",
        light.readings,
        clock(light.foreseen_s)
    ))?;
    terminal::line(exposures(light))?;
    left_out(plan).into_iter().try_for_each(terminal::line)
}

/// What a plan leaves out, a line each; then, by the reason, where the arms cannot be without that a reading is lost.
fn left_out(plan: &Plan) -> Vec<String> {
    let (lost, free): (Vec<_>, Vec<_>) = plan.left_out.iter().partition(|left_out| left_out.readings > 0);
    let lost = lost.into_iter().map(|left_out| {
        let saved = match left_out.seconds {
            0.0 => String::new(),
            seconds => format!(", {seconds:.1} s saved"),
        };
        format!(
            "left out: {} ({} readings{saved}): {}",
            left_out.what, left_out.readings, left_out.why
        )
    });
    let mut lines: Vec<String> = lost.collect();
    if lines.is_empty() {
        lines.push("every reading that the job asks for is taken".to_owned());
    }
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for LeftOut { what, why, .. } in free {
        match reasons.iter_mut().find(|(known, _)| known == why) {
            Some((_, places)) => places.push(what),
            None => reasons.push((why, vec![what])),
        }
    }
    let reasons = reasons
        .into_iter()
        .map(|(why, places)| format!("no reading is lost although {why}: {}", places.join("; ")));
    lines.extend(reasons);
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(what: &str, why: &str, readings: usize) -> LeftOut {
        LeftOut {
            what: what.to_owned(),
            why: why.to_owned(),
            readings,
            seconds: 0.0,
        }
    }

    fn plan(left_out: Vec<LeftOut>) -> Plan {
        Plan {
            steps: Vec::new(),
            left_out,
            overhead_s: 0.0,
            closing_s: 0.0,
            open: false,
        }
    }

    #[test]
    fn only_readings_that_are_not_taken_are_said_to_be_left_out() {
        let near = "arms closer than 5.0° shadow each other";
        let all = left_out(&plan(vec![
            entry("plane 20°", near, 0),
            entry("plane 45°", near, 0),
        ]));
        assert_eq!(
            all,
            [
                "every reading that the job asks for is taken".to_owned(),
                format!("no reading is lost although {near}: plane 20°; plane 45°"),
            ]
        );
        let some = left_out(&plan(vec![entry("arc", near, 3), entry("plane 45°", near, 0)]));
        assert_eq!(some[0], format!("left out: arc (3 readings): {near}"));
        for line in some.iter().chain(&all) {
            assert!(!line.contains("(0 readings)"), "{line}");
        }
    }
}
