use std::path::Path;
use std::process::ExitCode;

use goniod::DaemonError;
use rig::{Drive, Dynamixel, conform};

use crate::findings::Findings;
use crate::print;
use crate::signals::Signals;
use crate::wired::Wired;

/// Tries whether a rig behaves as this program expects of it; moves the arms.
///
/// # Errors
/// The rig file is wrong, or its port cannot be used.
pub(crate) fn conform(rig: Option<&Path>, restart: bool, as_json: bool) -> anyhow::Result<ExitCode> {
    let wired = Wired::new(rig)?;
    let mut findings = Findings::new(as_json);
    let opened = Dynamixel::open(&wired.port, &wired.file).map_err(|source| DaemonError::Port {
        file: wired.name.display().to_string(),
        source: Box::new(source),
    })?;
    let mut drive = Drive::new(opened, wired.file.clone());
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        // Before anything can move.
        let mut signals = Signals::listen()?;
        let mut tell = |finding| findings.tell(finding);
        tokio::select! {
            () = conform::conform(&mut drive, restart, &mut tell) => {}
            () = signals.next() => {
                print::say("interrupted; the arms stop, the lamp goes off");
                drive.stop_all().await;
                drive.disengage_all().await;
                anyhow::bail!("the suite was interrupted");
            }
        }
        Ok(())
    })?;
    findings.end(&wired.name)
}
