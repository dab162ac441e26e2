use std::path::Path;

use api::{Action, Client, Job, JobId, JobState, VerdictView};
use serde_json::json;

use crate::document;
use crate::error::CommandError;

/// Adds a job file to the queue; prints the job's id.
///
/// # Errors
/// The file cannot be read, or is wrong; the daemon does not answer, or refuses.
pub(crate) fn submit(daemon: &Client, file: &Path, as_json: bool) -> anyhow::Result<()> {
    let job = hand_in(daemon, file, false)?;
    if as_json {
        return Ok(document::QUEUED.print(&job)?);
    }
    terminal::say(format_args!("{}: {}{}", job.specimen, job.state, advice(&job)));
    Ok(terminal::line(job.id)?)
}

/// Hands in a job file. A `whole` run directory gets all files, also the large ones that the daemon makes when somebody
/// asks for them.
///
/// # Errors
/// As [`submit`].
pub(crate) fn hand_in(daemon: &Client, file: &Path, whole: bool) -> anyhow::Result<Job> {
    let text = session::job_text(file)?;
    let whole = if whole { "&whole=true" } else { "" };
    let path = format!("/jobs?name={}{whole}", encoded(&file.to_string_lossy()));
    Ok(daemon.hand_in(&path, "application/toml", &text)?)
}

/// Lists the jobs that are not over, or all.
///
/// # Errors
/// The daemon does not answer, or refuses.
pub(crate) fn jobs(daemon: &Client, all: bool, as_json: bool) -> anyhow::Result<()> {
    let mut jobs = match all {
        true => daemon.all_jobs()?,
        false => daemon.jobs()?,
    };
    jobs.retain(|job| all || !job.state.over());
    if as_json {
        return Ok(document::QUEUE.print(&json!({ "jobs": jobs }))?);
    }
    if jobs.is_empty() {
        terminal::say("no job");
    }
    for job in &jobs {
        let state = job.state.to_string();
        terminal::line(format_args!(
            "{}  {state:<17}  {}  {}",
            job.id, job.submitted, job.specimen
        ))?;
        let why = job.why.as_deref().unwrap_or_default();
        let more = format!("{why}{}", advice(job));
        if !more.is_empty() {
            terminal::line(format_args!("{:<28}{}", "", more.trim_start_matches("; ")))?;
        }
    }
    Ok(())
}

/// Says that the specimen of a job is on the stage: of the one named, else of the one that waits for it.
///
/// # Errors
/// No job waits; the daemon does not answer, or refuses.
pub(crate) fn ready(daemon: &Client, job: Option<JobId>, as_json: bool) -> anyhow::Result<()> {
    let id = match job {
        Some(id) => id,
        None => only(daemon, JobState::AwaitingSpecimen)?
            .ok_or(CommandError::Absent("no job awaits its specimen"))?,
    };
    act(daemon, id, Action::Ready, as_json)
}

/// Goes on: with the job named, else after a pause, else with the one interrupted job.
///
/// # Errors
/// Nothing to go on with, or more than one; the daemon does not answer, or refuses.
pub(crate) fn resume(daemon: &Client, job: Option<JobId>, as_json: bool) -> anyhow::Result<()> {
    let paused = only(daemon, JobState::Paused)?;
    if paused.is_some() && (job.is_none() || job == paused) {
        daemon.act("/proceed")?;
        terminal::say("going on");
        if as_json {
            document::RIG_STATE.print(&daemon.rig()?)?;
        }
        return Ok(());
    }
    let id = match job {
        Some(id) => id,
        None => only(daemon, JobState::Interrupted)?.ok_or(CommandError::Absent(
            "nothing is paused, and no job was interrupted",
        ))?,
    };
    act(daemon, id, Action::Resume, as_json)
}

/// Gives a job up.
///
/// # Errors
/// The daemon does not answer, or refuses.
pub(crate) fn cancel(daemon: &Client, job: JobId, as_json: bool) -> anyhow::Result<()> {
    act(daemon, job, Action::Cancel, as_json)
}

fn act(daemon: &Client, id: JobId, action: Action, as_json: bool) -> anyhow::Result<()> {
    let job = daemon.act_on_job(id, action)?;
    if as_json {
        return Ok(document::QUEUED.print(&job)?);
    }
    terminal::say(format_args!("{}: {}", job.specimen, job.state));
    Ok(())
}

/// The one job in a state.
fn only(daemon: &Client, state: JobState) -> anyhow::Result<Option<JobId>> {
    let jobs = daemon.jobs()?;
    let ids: Vec<_> = jobs
        .iter()
        .filter(|job| job.state == state)
        .map(|job| job.id)
        .collect();
    if ids.len() > 1 {
        let names: Vec<_> = ids.iter().map(ToString::to_string).collect();
        anyhow::bail!("{} jobs are {state}, name one: {}", ids.len(), names.join(", "));
    }
    Ok(ids.first().copied())
}

/// What an operator does next about a job.
fn advice(job: &Job) -> &'static str {
    match job.state {
        JobState::AwaitingSpecimen => "; put the specimen on the stage, then `gonioctl ready`",
        JobState::Paused => "; `gonioctl resume` goes on",
        JobState::Interrupted => "; `gonioctl resume` goes on where it was",
        JobState::Done if job.verdict == Some(VerdictView::Bad) => {
            "; measured, but not usable: the report in its run directory says why"
        }
        _ => "",
    }
}

/// Percent-encoded for a query (RFC 3986, unreserved characters).
fn encoded(text: &str) -> String {
    let byte = |byte: u8| match byte {
        b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => char::from(byte).to_string(),
        _ => format!("%{byte:02X}"),
    };
    text.bytes().map(byte).collect()
}

#[cfg(test)]
mod tests {
    use super::encoded;

    #[test]
    fn a_file_name_survives_the_query() {
        assert_eq!(
            encoded("jobs/gold paint&é.toml"),
            "jobs%2Fgold%20paint%26%C3%A9.toml"
        );
    }
}
