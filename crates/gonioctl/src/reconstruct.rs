use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use anyhow::Context;
use report::RunDirectory;
use serde_json::Value;
use session::Status;

use crate::error::CommandError;
use crate::{closing, document, exit};

/// Makes everything in a run directory again: from the daemon's store where that knows the run, else from the
/// directory's own journal. The exit code says whether the result can be used.
///
/// # Errors
/// No journal there, or a damaged one; a file that cannot be written; a store, and no daemon's program that could read it.
pub(crate) fn reconstruct(run: PathBuf, as_json: bool) -> anyhow::Result<ExitCode> {
    let directory = RunDirectory::at(&run);
    let report = match from_store(&run) {
        Some(Ok(report)) => report,
        // The journal in the directory may be older than the store, and is all that can be read then.
        Some(Err(error)) if directory.journal().exists() && !error.is::<CommandError>() => {
            terminal::say(format_args!(
                "{error:#}; the journal of the run directory is used"
            ));
            serde_json::to_value(report::reconstruct(&directory)?)?
        }
        Some(Err(error)) => return Err(error),
        None => serde_json::to_value(report::reconstruct(&directory)?)?,
    };
    let status = match report["verdict"] == "bad" {
        true => Status::Unusable,
        false => Status::Done,
    };
    if as_json {
        document::REPORT.print(&report)?;
        return Ok(exit::code(status));
    }
    let mut bad = Vec::new();
    for check in report["checks"].as_array().into_iter().flatten() {
        let [verdict, name, text] =
            ["verdict", "name", "text"].map(|key| check[key].as_str().unwrap_or_default());
        terminal::line(format_args!("{verdict}: {name}: {text}"))?;
        if verdict == "bad" {
            bad.push(name);
        }
    }
    if status == Status::Unusable {
        terminal::say(closing::not_usable(bad));
    }
    Ok(exit::code(status))
}

/// Has the daemon's program make the run directory from the store that lies beside `runs`: only that program reads it.
/// `None`: there is no store, or it does not know the run.
fn from_store(run: &Path) -> Option<anyhow::Result<Value>> {
    let run = std::path::absolute(run).ok()?;
    let store = run.parent()?.parent()?.join("goniod.db");
    store
        .exists()
        .then(|| ask_goniod(&run))
        .and_then(Result::transpose)
}

fn ask_goniod(run: &Path) -> anyhow::Result<Option<Value>> {
    let program = goniod();
    let output = Command::new(&program)
        .arg("--reconstruct")
        .arg(run)
        .stdin(Stdio::null())
        .output()
        .with_context(|| {
            format!(
                "cannot start {}, which reads the store of the run; install it beside gonioctl",
                program.display()
            )
        })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(CommandError::Unbegun {
            why: format!("{} cannot make the run again: {}", program.display(), said.trim()),
            status: status(output.status.code()),
        }
        .into());
    }
    let report: Value = serde_json::from_slice(&output.stdout)
        .with_context(|| format!("{} is of another version", program.display()))?;
    Ok((!report.is_null()).then_some(report))
}

/// What a program of ours means by its exit code.
fn status(code: Option<i32>) -> Status {
    let all = [Status::Rig, Status::Stopped, Status::Daemon, Status::Unusable];
    let meant = all
        .into_iter()
        .find(|status| Some(i32::from(status.code())) == code);
    meant.unwrap_or(Status::Invalid)
}

/// The daemon's program: the one beside this program that is named as this one is, else the one on the search path.
fn goniod() -> PathBuf {
    const NAME: &str = "goniod";
    let beside = std::env::current_exe().ok().and_then(|this| {
        let name = this.file_name()?.to_str()?.replace("gonioctl", NAME);
        let beside = this.with_file_name(OsString::from(name));
        (beside != this && beside.is_file()).then_some(beside)
    });
    beside.unwrap_or_else(|| PathBuf::from(NAME))
}
