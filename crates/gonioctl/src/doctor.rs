use std::path::Path;
use std::process::ExitCode;

use rig::doctor::{self, Finding, Host, Verdict};
use rig::{Device, Drive, Dynamixel, RigFile};
use session::RigPort;

use crate::findings::Findings;
use crate::junit::Junit;
use crate::signals::Signals;

/// Devices of a rig: two servos and the photometer.
const ALL: usize = 3;

/// Checks a rig without moving it, and says what to do about what is wrong.
///
/// # Errors
/// The rig file is wrong.
pub(crate) fn doctor(
    rig: Option<&Path>,
    out: &Path,
    junit: Option<&Junit>,
    as_json: bool,
) -> anyhow::Result<ExitCode> {
    let (file, name) = session::rig_file(rig)?;
    let port = RigPort::new(&file, &name.display().to_string())?;
    let mut findings = Findings::new(as_json);
    examine(port.path(), port.file(&file), out, &mut |finding| {
        findings.tell(finding);
    })?;
    findings.end(&name, junit)
}

/// All checks, from the machine to the light; those that build on one that failed are left out.
fn examine(port: &Path, file: &RigFile, out: &Path, tell: &mut dyn FnMut(Finding)) -> anyhow::Result<()> {
    tell(doctor::clock());
    tell(doctor::disk(out, file.suspend.disk_bytes));
    let seen = Host::default().port(port, file.bus.latency.as_secs_f64() * 1e3);
    let usable = seen.iter().all(|finding| finding.verdict != Verdict::Fail);
    let timer = seen.iter().find(|finding| finding.check == "latency timer");
    let timer = timer.map(|finding| finding.verdict);
    seen.into_iter().for_each(&mut *tell);
    if !usable {
        return Ok(());
    }
    let present = doctor::census(port, file, tell);
    if present.is_empty() {
        return Ok(());
    }
    let mut drive = Drive::new(Dynamixel::open(port, file)?, file.clone());
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let mut signals = Signals::listen()?;
        tokio::select! {
            () = ask(&mut drive, &present, timer, tell) => {}
            () = signals.next() => {
                terminal::say("interrupted; the lamp goes off");
                drive.lamp(false).await?;
            }
        }
        Ok(())
    })
}

/// What the devices say. One that does not answer is asked nothing more: whatever was said of it then would point
/// elsewhere than what is known already.
async fn ask(
    drive: &mut Drive<Dynamixel>,
    present: &[Device],
    timer: Option<Verdict>,
    tell: &mut dyn FnMut(Finding),
) {
    let mut answering = Vec::new();
    for &device in present {
        let finding = doctor::device(drive, device).await;
        if finding.verdict != Verdict::Fail || doctor::answers(drive, device).await {
            answering.push(device);
        }
        tell(finding);
    }
    let photometer = answering.contains(&Device::Photometer);
    // One elsewhere tells nothing of the bus.
    if photometer && drive.file().detector.on_bus() {
        tell(doctor::round_trip(drive, timer).await);
    }
    if answering.len() == ALL {
        doctor::together(drive).await.into_iter().for_each(&mut *tell);
        tell(doctor::pose(drive).await);
        doctor::suspend(drive).await.into_iter().for_each(&mut *tell);
    }
    if photometer {
        doctor::light(drive).await.into_iter().for_each(tell);
    }
}
