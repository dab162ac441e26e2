use std::time::Duration;

use arms::{Arm, Pose};

use super::{Result, check, clock_s, failed, since_s};
use crate::doctor::Finding;
use crate::{Drive, Dynamixel, Rig};

/// Between two looks at an arm that moves.
const LOOK: Duration = Duration::from_millis(2);

/// A motion may last longer or shorter than its profile by this share, or by this time, whichever is more: the lag of
/// the arm behind its profile, and the looks at it.
const SHARE: f64 = 0.05;
const SLACK_S: f64 = 0.06;

/// Visits of a pose from which its repeatability is told.
const VISITS: usize = 5;

/// How long a motion takes by the photometer's clock, against its profile.
pub(super) async fn timing(drive: &mut Drive<Dynamixel>, arm: Arm, to: Pose) -> Result<Finding> {
    let check = check(arm, "light profile", "sensor profile");
    let from = drive.snapshot().await?.pose();
    let way = to.angle(arm) - from.angle(arm);
    let planned_s = drive.file().arm(arm).profile.duration_s(way);
    let begun = clock_s(drive).await?;
    drive.rig().start(to).await.map_err(failed("set the arms off"))?;
    let limit_s = planned_s + drive.file().motion.timeout.as_secs_f64();
    let mut taken_s;
    loop {
        drive.wait(LOOK).await?;
        let snapshot = drive.snapshot().await?;
        taken_s = since_s(begun, clock_s(drive).await?);
        let location = snapshot.arms[arm as usize];
        let there = (location.measured - to.angle(arm)).abs() <= drive.file().motion.near_rad;
        if (there && !location.moving) || taken_s > limit_s {
            break;
        }
    }
    let text = format!(
        "{:+.1}° took {taken_s:.3} s, its profile {planned_s:.3} s",
        way.to_degrees()
    );
    let allowed_s = (SHARE * planned_s).max(SLACK_S);
    if (taken_s - planned_s).abs() <= allowed_s {
        return Ok(Finding::ok(check, text));
    }
    let remedy = format!(
        "{allowed_s:.3} s are allowed: the servo does not follow its profile (velocity limit, load, gains), or its \
         units are not those of the manual"
    );
    Ok(Finding::fail(check, text, remedy))
}

/// How far apart the measured angles of one pose are that was visited again and again.
pub(super) async fn repeatability(
    drive: &mut Drive<Dynamixel>,
    arm: Arm,
    pose: Pose,
    away: Pose,
) -> Result<Finding> {
    let check = check(arm, "light repeat", "sensor repeat");
    let mut errors_deg = Vec::with_capacity(VISITS);
    for _ in 0..VISITS {
        drive.travel(&[away]).await?;
        let there = drive.travel(&[pose]).await?.pose;
        errors_deg.push((there.angle(arm) - drive.file().nearest(pose).angle(arm)).to_degrees());
    }
    let low = errors_deg.iter().copied().fold(f64::INFINITY, f64::min);
    let high = errors_deg.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let text = format!("{VISITS} visits, measured {low:+.3} … {high:+.3}° off the goal");
    let near_deg = drive.file().motion.near_rad.to_degrees();
    Ok(if high - low <= near_deg {
        Finding::ok(check, text)
    } else {
        Finding::warn(
            check,
            text,
            format!("more than motion.near_deg = {near_deg:.3} apart: play, friction, or a loose arm"),
        )
    })
}
