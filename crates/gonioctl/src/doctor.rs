use std::path::{Path, PathBuf};
use std::process::ExitCode;

use firmware_sim::Server;
use goniod::{DaemonError, Status};
use rig::doctor::{self, Bin, Finding, Host, Verdict};
use rig::{Device, Drive, Dynamixel, Port, RigFile};
use serde_json::json;

use crate::signals::Signals;
use crate::{exit, print};

/// Widest bar of the histogram, characters.
const BAR: usize = 40;

/// Checks a rig without moving it, and says what to do about what is wrong.
///
/// # Errors
/// The rig file is wrong.
pub(crate) fn doctor(rig: Option<&Path>, out: &Path, as_json: bool) -> anyhow::Result<ExitCode> {
    let (text, name) = goniod::rig_text(rig)?;
    let file = RigFile::parse(&text, &name).map_err(DaemonError::from)?;
    let mut findings = Vec::new();
    let mut tell = |finding: Finding| {
        if !as_json {
            // Whether stdout can be written shows at the end.
            let _ = show(&finding);
        }
        findings.push(finding);
    };
    examine(&file, &name, out, &mut tell)?;
    let worst = findings.iter().map(|finding| finding.verdict).max();
    if as_json {
        print::json(&json!({ "rig": name, "verdict": worst, "findings": findings }))?;
    }
    Ok(match worst {
        Some(Verdict::Fail) => exit::code(Status::Rig),
        _ => ExitCode::SUCCESS,
    })
}

/// All checks, from the machine to the light; those that build on one that failed are left out.
fn examine(file: &RigFile, name: &Path, out: &Path, tell: &mut dyn FnMut(Finding)) -> anyhow::Result<()> {
    tell(doctor::disk(out));
    let (port, _simulator): (PathBuf, Option<Server>) = match &file.bus.port {
        Port::Path(path) => (path.clone(), None),
        Port::Sim => {
            let server = Server::start(file).map_err(|source| DaemonError::Sim {
                file: name.display().to_string(),
                source,
            })?;
            (server.path().to_owned(), Some(server))
        }
    };
    let seen = Host::default().port(&port, file.bus.latency.as_secs_f64() * 1e3);
    let usable = seen.iter().all(|finding| finding.verdict != Verdict::Fail);
    seen.into_iter().for_each(&mut *tell);
    if !usable {
        return Ok(());
    }
    let present = doctor::census(&port, file, tell);
    if present.is_empty() {
        return Ok(());
    }
    let mut drive = Drive::new(Dynamixel::open(&port, file)?, file.clone());
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    runtime.block_on(async {
        let mut signals = Signals::listen()?;
        tokio::select! {
            () = ask(&mut drive, &present, tell) => {}
            () = signals.next() => {
                print::say("interrupted; the lamp goes off");
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

fn show(finding: &Finding) -> std::io::Result<()> {
    print::line(format_args!(
        "{:<4}  {:<15}{}",
        finding.verdict, finding.check, finding.text
    ))?;
    if let Some(remedy) = &finding.remedy {
        print::line(format_args!("{:<21}-> {remedy}", ""))?;
    }
    for line in bars(&finding.histogram) {
        print::line(format_args!("{:<21}{line}", ""))?;
    }
    Ok(())
}

/// The bins that hold something, and those between them, as bars.
fn bars(histogram: &[Bin]) -> Vec<String> {
    let filled = |bin: &Bin| bin.count > 0;
    let (Some(first), Some(last)) = (
        histogram.iter().position(filled),
        histogram.iter().rposition(filled),
    ) else {
        return Vec::new();
    };
    let most = histogram.iter().map(|bin| bin.count).max().unwrap_or(1);
    let line = |bin: &Bin| {
        let end = bin
            .below_ms
            .map_or_else(|| "more".to_owned(), |ms| format!("< {ms}"));
        let bar = "#".repeat((bin.count * BAR).div_ceil(most));
        format!("{end:>7} ms {:>4} {bar}", bin.count)
            .trim_end()
            .to_owned()
    };
    histogram[first..=last].iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_leave_out_what_is_empty_at_the_ends() {
        let bin = |below_ms, count| Bin { below_ms, count };
        let lines = bars(&[
            bin(Some(0.5), 0),
            bin(Some(1.0), 40),
            bin(Some(2.0), 0),
            bin(None, 1),
        ]);
        assert_eq!(
            lines,
            [
                format!("    < 1 ms   40 {}", "#".repeat(40)),
                "    < 2 ms    0".to_owned(),
                "   more ms    1 #".to_owned()
            ]
        );
        assert!(bars(&[bin(None, 0)]).is_empty());
    }
}
