use std::path::Path;
use std::process::ExitCode;

use rig::doctor::{self, Finding, Host, Verdict};
use rig::{Device, Drive, Dynamixel, RigFile};
use session::RigPort;

use crate::findings::Findings;
use crate::signals::Signals;

/// Checks a rig without moving it, and says what to do about what is wrong.
///
/// # Errors
/// The rig file is wrong.
pub(crate) fn doctor(rig: Option<&Path>, out: &Path, as_json: bool) -> anyhow::Result<ExitCode> {
    let (file, name) = session::rig_file(rig)?;
    let port = RigPort::new(&file, &name.display().to_string())?;
    let mut findings = Findings::new(as_json);
    examine(port.path(), &file, out, &mut |finding| findings.tell(finding))?;
    findings.end(&name)
}

/// All checks, from the machine to the light; those that build on one that failed are left out.
fn examine(port: &Path, file: &RigFile, out: &Path, tell: &mut dyn FnMut(Finding)) -> anyhow::Result<()> {
    tell(doctor::disk(out));
    let seen = Host::default().port(port, file.bus.latency.as_secs_f64() * 1e3);
    let usable = seen.iter().all(|finding| finding.verdict != Verdict::Fail);
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
            () = ask(&mut drive, &present, tell) => {}
            () = signals.next() => {
                terminal::say("interrupted; the lamp goes off");
                drive.lamp(false).await?;
            }
        }
        Ok(())
    })
}

/// What the devices say.
async fn ask(drive: &mut Drive<Dynamixel>, present: &[Device], tell: &mut dyn FnMut(Finding)) {
    for &device in present {
        tell(doctor::device(drive, device).await);
    }
    let here = |device| present.contains(&device);
    if here(Device::Photometer) {
        tell(doctor::round_trip(drive).await);
    }
    if [Device::Light, Device::Sensor, Device::Photometer]
        .into_iter()
        .all(here)
    {
        tell(doctor::pose(drive).await);
        doctor::light(drive).await.into_iter().for_each(tell);
    }
}
