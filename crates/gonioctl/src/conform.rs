use std::path::Path;
use std::process::ExitCode;

use rig::conform;
use session::OpenRig;

use crate::findings::Findings;
use crate::junit::Junit;
use crate::signals::Signals;

/// Tries whether a rig behaves as this program expects of it; moves the arms.
///
/// # Errors
/// The rig file is wrong, or its port cannot be used.
pub(crate) fn conform(
    rig: Option<&Path>,
    restart: bool,
    junit: Option<&Junit>,
    as_json: bool,
) -> anyhow::Result<ExitCode> {
    let (file, name) = session::rig_file(rig)?;
    let mut findings = Findings::new(as_json);
    let mut rig = OpenRig::open(&file, &name.display().to_string())?;
    let drive = &mut rig.drive;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        // Before anything can move.
        let mut signals = Signals::listen()?;
        let mut tell = |finding| findings.tell(finding);
        tokio::select! {
            () = conform::conform(drive, restart, &mut tell) => {}
            () = signals.next() => {
                terminal::say("interrupted; the arms stop, the lamp goes off");
                drive.stop_all().await;
                drive.disengage_all().await;
                anyhow::bail!("the suite was interrupted");
            }
        }
        Ok(())
    })?;
    findings.end(&name, junit)
}
