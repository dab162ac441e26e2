use arms::{Arm, ArmAngle, Pose};

use crate::{Mechanics, SweepError};

/// Where the arms stand between two steps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Standing {
    /// Their pose.
    pub(crate) pose: Pose,
    /// Whether each arm came there from the side of approach.
    pub(crate) approached: bool,
}

impl Standing {
    /// From a measured pose, put on the servos' grid. Arms do not stand still to a count, so where one is a step
    /// outside its limits the step inside is meant.
    pub(crate) fn measured(mechanics: &Mechanics, measured: Pose) -> Result<Self, SweepError> {
        let pose = Arm::BOTH.into_iter().fold(measured, |pose, arm| {
            let limits = mechanics.envelope.limits(arm);
            let steps = mechanics.steps(arm, measured.angle(arm)).round();
            let candidates = [0.0, 1.0, -1.0].map(|step| mechanics.angle(arm, steps + step));
            let inside = candidates.into_iter().find(|&angle| limits.contain(angle));
            pose.with(arm, inside.unwrap_or(candidates[0]))
        });
        match mechanics.envelope.check_pose(pose) {
            Ok(()) => Ok(Self {
                pose,
                approached: false,
            }),
            Err(source) => Err(SweepError::Start {
                pose: measured,
                source,
            }),
        }
    }
}

/// A checked way from one pose to another.
#[derive(Clone, Debug)]
pub(crate) struct Route {
    /// Waypoints, then the pose itself.
    pub(crate) path: Vec<Pose>,
    /// Seconds of motion.
    pub(crate) seconds: f64,
}

/// The way from where the arms measurably stand to a pose: waypoints, then the pose itself, every leg inside the
/// envelope, the last one in the direction of approach.
///
/// # Errors
/// The arms stand outside the envelope, or no safe way leads to the pose.
pub fn way(mechanics: &Mechanics, from: Pose, to: Pose) -> Result<Vec<Pose>, SweepError> {
    let standing = Standing::measured(mechanics, from)?;
    let route = route(mechanics, standing, to).ok_or(SweepError::NoWay { from, to })?;
    Ok(route.path)
}

/// The way to a pose: with the last approach from the side that the rig file asks for, and with every leg inside the
/// envelope. `None`: there is none.
pub(crate) fn route(mechanics: &Mechanics, from: Standing, to: Pose) -> Option<Route> {
    let wrong = Arm::BOTH.map(|arm| from_wrong_side(mechanics, from, to, arm));
    let path = if wrong.contains(&true) {
        // Where one arm alone has no room to overshoot, both may have.
        [wrong, [true, true]].into_iter().find_map(|beyond| {
            let beyond = overshoot(mechanics, to, beyond);
            let mut path = legs(mechanics, from.pose, beyond)?;
            mechanics.envelope.check_path(beyond, to).ok()?;
            path.push(to);
            Some(path)
        })?
    } else {
        legs(mechanics, from.pose, to)?
    };
    let starts = std::iter::once(&from.pose).chain(&path);
    let seconds = starts.zip(&path).map(|(&a, &b)| mechanics.leg_s(a, b)).sum();
    Some(Route { path, seconds })
}

fn from_wrong_side(mechanics: &Mechanics, from: Standing, to: Pose, arm: Arm) -> bool {
    let approach = f64::from(mechanics.approach);
    let way = (to.angle(arm) - from.pose.angle(arm)) * approach;
    let nothing = mechanics.resolution_rad[arm as usize] / 2.0;
    approach != 0.0 && (way < -nothing || (way <= nothing && !from.approached))
}

/// The pose from which the chosen arms come back to `pose` in the direction of approach.
pub(crate) fn overshoot(mechanics: &Mechanics, pose: Pose, arms: [bool; 2]) -> Pose {
    let back = f64::from(mechanics.approach) * mechanics.overshoot_rad;
    Arm::BOTH
        .into_iter()
        .zip(arms)
        .filter(|&(_, beyond)| beyond)
        .fold(pose, |pose, (arm, _)| {
            let angle = ArmAngle::from_rad(pose.angle(arm).rad() - back);
            pose.with(arm, mechanics.nearest(arm, angle))
        })
}

/// Both arms together where that is safe; otherwise one after the other, the one that makes room first.
fn legs(mechanics: &Mechanics, from: Pose, to: Pose) -> Option<Vec<Pose>> {
    let safe = |a, b| mechanics.envelope.check_path(a, b).is_ok();
    if safe(from, to) {
        return Some(vec![to]);
    }
    [Arm::Sensor, Arm::Light].into_iter().find_map(|first| {
        let corner = from.with(first, to.angle(first));
        (safe(from, corner) && safe(corner, to)).then(|| vec![corner, to])
    })
}
