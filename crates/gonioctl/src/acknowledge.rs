use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;

use api::{Acknowledgement, Client, FaultId, FaultView};

use crate::document;
use crate::error::CommandError;

/// Acknowledges the newest latched fault: the one that is named, else the one that is shown and confirmed on the
/// terminal.
///
/// # Errors
/// No fault is latched; none is named and there is no terminal to ask on; the answer is no; the daemon does not answer,
/// or refuses because another fault is newer.
pub(crate) fn acknowledge(daemon: &Client, fault: Option<&str>, as_json: bool) -> anyhow::Result<ExitCode> {
    let id = match fault {
        Some(id) => FaultId::from(id.to_owned()),
        None => confirmed(daemon)?,
    };
    daemon.act_on("/acknowledge", &Acknowledgement { fault: id.clone() })?;
    terminal::say(format_args!("fault {id} is acknowledged; nothing starts by that"));
    let rig = daemon.rig()?;
    if let Some(fault) = &rig.fault {
        terminal::say(format_args!("still latched: {}", described(fault)));
    }
    if as_json {
        document::RIG_STATE.print(&rig)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Shows the newest fault and asks whether it is the one that was looked at.
fn confirmed(daemon: &Client) -> anyhow::Result<FaultId> {
    let Some(fault) = daemon.rig()?.fault else {
        return Err(CommandError::Absent("no fault is latched").into());
    };
    terminal::say(described(&fault));
    anyhow::ensure!(
        io::stdin().is_terminal(),
        "nobody can be asked here whether the rig was looked at; name the fault: --fault {}",
        fault.id
    );
    let mut stderr = io::stderr();
    // Nobody is there to ask where stderr is gone; then no answer comes either.
    let _ = write!(
        stderr,
        "Have you looked at the rig, and may it move again? [y/N] "
    );
    let _ = stderr.flush();
    let mut answer = String::new();
    io::stdin().read_line(&mut answer)?;
    let yes = matches!(answer.trim().to_lowercase().as_str(), "y" | "yes");
    anyhow::ensure!(yes, "not acknowledged: the fault stays latched");
    Ok(fault.id)
}

fn described(fault: &FaultView) -> String {
    let remedy = fault
        .remedy
        .as_deref()
        .map(|remedy| format!("\nwhat to do: {remedy}"));
    let remedy = remedy.unwrap_or_default();
    format!("fault {} of {}: {}{remedy}", fault.id, fault.at, fault.text)
}
