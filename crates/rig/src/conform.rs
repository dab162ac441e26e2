//! Whether a bus behaves as this program expects of it: ours, a stranger's simulator, or the real thing.
//!
//! Unlike [`doctor`] this moves the arms, within the envelope, lets the servos' watchdogs trip and
//! switches the lamp. The arms must be clear, and somebody must stand by.

mod motion;
mod photometer;
mod silence;

use arms::{Arm, Pose};

use crate::doctor::{self, Finding, Verdict};
use crate::{Device, Drive, DriveError, Dynamixel, RigError};

type Result<T> = std::result::Result<T, DriveError<RigError>>;

/// How far an arm is moved, degrees; the first that the envelope allows.
const STROKES_DEG: [f64; 6] = [20.0, -20.0, 10.0, -10.0, 5.0, -5.0];

/// The whole suite: identities and limits, round trips, timing of the profiles, repeatability of the position, the
/// bus watchdogs, the restart of a servo where `restart` says so (its arm has no torque meanwhile), dark noise,
/// linearity, and that nobody ended with an alert. The arms end at rest where the rig file parks them, the lamp off.
///
/// It ends early where going on makes no sense or is not safe.
pub async fn conform(drive: &mut Drive<Dynamixel>, restart: bool, tell: &mut (dyn FnMut(Finding) + Send)) {
    const DEVICES: [Device; 3] = [Device::Light, Device::Sensor, Device::Photometer];
    let mut sound = true;
    let mut judge = |finding: Finding| {
        sound &= finding.verdict != Verdict::Fail;
        tell(finding);
    };
    for device in DEVICES {
        judge(doctor::device(drive, device).await);
    }
    judge(doctor::pose(drive).await);
    judge(doctor::round_trip(drive, None).await);
    if !sound {
        return;
    }
    if let Err(error) = moved(drive, restart, tell).await {
        tell(Finding::error("suite", &error));
    }
    // On every way out: whatever goes wrong here was told above.
    drive.disengage_all().await;
    for device in DEVICES {
        let finding = doctor::device(drive, device).await;
        if finding.verdict != Verdict::Ok {
            tell(Finding {
                check: "alert",
                ..finding
            });
        }
    }
}

async fn moved(
    drive: &mut Drive<Dynamixel>,
    restart: bool,
    tell: &mut (dyn FnMut(Finding) + Send),
) -> Result<()> {
    drive.engage_all().await?;
    let park = drive.file().motion.park;
    drive.travel(&[park]).await?;
    for arm in Arm::BOTH {
        let Some(away) = stroke(drive, park, arm) else {
            continue;
        };
        tell(motion::timing(drive, arm, away).await?);
        tell(motion::timing(drive, arm, park).await?);
        tell(motion::repeatability(drive, arm, park, away).await?);
    }
    tell(silence::watchdogs(drive).await?);
    if restart {
        for arm in Arm::BOTH {
            tell(silence::restart(drive, arm).await?);
        }
    }
    drive.engage_all().await?;
    drive.travel(&[park]).await?;
    for finding in photometer::noise(drive).await? {
        tell(finding);
    }
    drive.lamp(true).await?;
    tell(photometer::linearity(drive).await?);
    drive.lamp(false).await?;
    Ok(())
}

/// Where to move one arm to from a pose, safely.
fn stroke(drive: &Drive<Dynamixel>, from: Pose, arm: Arm) -> Option<Pose> {
    let envelope = &drive.file().envelope;
    STROKES_DEG.into_iter().find_map(|stroke| {
        let angle = arms::ArmAngle::from_deg(from.angle(arm).deg() + stroke);
        let to = drive.file().nearest(from.with(arm, angle));
        envelope.check_path(from, to).is_ok().then_some(to)
    })
}

/// The photometer's clock, s, which wraps after 168 s.
async fn clock_s(drive: &mut Drive<Dynamixel>) -> Result<f64> {
    Ok(f64::from(drive.ticks().await?) * 1e-5)
}

/// Seconds from one reading of the clock to another.
fn since_s(earlier: f64, later: f64) -> f64 {
    (later - earlier).rem_euclid(f64::from(1 << 24) * 1e-5)
}

/// A name for a check of one arm.
fn check(arm: Arm, light: &'static str, sensor: &'static str) -> &'static str {
    match arm {
        Arm::Light => light,
        Arm::Sensor => sensor,
    }
}

/// An error of the bus alone, as one of the drive.
fn failed(what: &'static str) -> impl Fn(RigError) -> DriveError<RigError> {
    move |source| DriveError::Device {
        what,
        retries: 0,
        tried: std::time::Duration::ZERO,
        source,
    }
}
