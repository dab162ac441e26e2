use std::time::Duration;

use arms::Arm;

use super::{Result, check, failed};
use crate::doctor::Finding;
use crate::{Actuator, Drive, Dynamixel, Fault, FaultKind, Rig};

/// Beyond its time, a watchdog has tripped after this for certain: its register counts in steps of 20 ms.
const MARGIN: Duration = Duration::from_millis(200);

/// A servo that restarts answers again within this (the manual names no figure).
const RESTART: Duration = Duration::from_secs(5);

/// Between two questions whether it does.
const ASK: Duration = Duration::from_millis(100);

/// An arm that is further from where it stood before its restart has moved, degrees.
const STILL_DEG: f64 = 1.0;

/// Whether the servos' watchdogs trip when nobody speaks to them, and keep them from moving until they are engaged
/// again.
pub(super) async fn watchdogs(drive: &mut Drive<Dynamixel>) -> Result<Finding> {
    const CHECK: &str = "watchdogs";
    let time = drive.file().motion.watchdog;
    if time.is_zero() {
        return Ok(Finding::warn(
            CHECK,
            "not tried: motion.watchdog_ms is 0",
            "give it a time",
        ));
    }
    drive.engage_all().await?;
    let before = drive.snapshot().await?.pose();
    drive
        .rig()
        .wait(time + MARGIN)
        .await
        .map_err(failed("let time pass"))?;
    let mut dead = Vec::new();
    for arm in Arm::BOTH {
        let tripped = drive.rig().axis(arm).watchdog_tripped().await;
        if !tripped.map_err(failed("read the bus watchdog"))? {
            dead.push(arm.to_string());
        }
    }
    let text = format!("silent for {} ms", (time + MARGIN).as_millis());
    if !dead.is_empty() {
        return Ok(Finding::fail(
            CHECK,
            format!("{text}: {} did not trip", dead.join(" and ")),
            "a killed program would leave this arm moving to its goal: update the servo's firmware",
        ));
    }
    drive.engage_all().await?;
    let after = drive.snapshot().await?.pose();
    let moved = Arm::BOTH.map(|arm| (after.angle(arm) - before.angle(arm)).abs().to_degrees());
    if moved.into_iter().any(|moved| moved > STILL_DEG) {
        return Ok(Finding::fail(
            CHECK,
            format!("{text}: an arm moved"),
            "keep clear of this rig",
        ));
    }
    Ok(Finding::ok(
        CHECK,
        format!("{text}: both tripped, the arms held, and engaging cleared them"),
    ))
}

/// Whether a servo that is restarted comes back without torque where it was.
pub(super) async fn restart(drive: &mut Drive<Dynamixel>, arm: Arm) -> Result<Finding> {
    let check = check(arm, "light restart", "sensor restart");
    let before = drive.snapshot().await?.pose().angle(arm);
    drive.disengage_all().await;
    let restarted = drive.rig().axis(arm).reboot().await;
    restarted.map_err(failed("restart a servo"))?;
    let mut waited = Duration::ZERO;
    let location = loop {
        drive.rig().wait(ASK).await.map_err(failed("let time pass"))?;
        waited += ASK;
        match drive.rig().axis(arm).location().await {
            Ok(location) => break location,
            Err(error) if error.kind() == FaultKind::NoReply && waited < RESTART => {}
            Err(error) => return Err(failed("find the servo after its restart")(error)),
        }
    };
    let moved_deg = (location.measured - before).abs().to_degrees();
    let text = format!(
        "answers after {:.1} s, {moved_deg:.2}° from where it was, torque {}",
        waited.as_secs_f64(),
        if location.torque { "on" } else { "off" }
    );
    Ok(if location.torque {
        let remedy = "write 0 to address 60: no motor may come on by itself";
        Finding::fail(check, text, remedy)
    } else if moved_deg > STILL_DEG {
        Finding::warn(check, text, "without torque the arm sinks: balance it")
    } else {
        Finding::ok(check, text)
    })
}
