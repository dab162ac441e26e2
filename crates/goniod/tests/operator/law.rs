//! The law, over what the devices were told.

use std::time::Duration;

use arms::{Arm, Pose};
use firmware_sim::in_process::{SharedBench, Written};
use goniod::FaultId;
use rig::dynamixel::register::{photometer, servo};
use rig::{Device, ServoUnits};

use crate::script::Op;

/// Something that happened, among what the devices were told.
#[derive(Clone, Debug)]
pub(crate) struct Mark {
    /// Writes before it.
    pub(crate) writes: usize,
    /// When, by the rig's clock.
    pub(crate) at: Duration,
    /// Where the arms were.
    pub(crate) pose: Pose,
    /// Which of the things that were asked for, from 0.
    pub(crate) number: usize,
    pub(crate) what: What,
}

#[derive(Clone, Debug)]
pub(crate) enum What {
    /// A request came in; an acknowledgement names a fault.
    Asked { op: Op, fault: Option<FaultId> },
    /// It was carried out, and whoever asked knows; an emergency stop has latched a fault.
    Answered { op: Op, fault: Option<FaultId> },
    /// It was refused.
    Refused,
    /// The sensor servo hears nothing for so long, and goes on with what it was doing.
    Silenced(Duration),
}

/// Profile acceleration of the rig file's default, rad/s².
const BRAKING_RAD_S2: f64 = 200.0 * std::f64::consts::PI / 180.0;
/// Profile velocity of the rig file's default, rad/s.
const FASTEST_RAD_S: f64 = 60.0 * std::f64::consts::PI / 180.0;

/// What of the law was broken; empty where nothing was.
pub(crate) fn breaches(bench: &SharedBench, marks: &[Mark]) -> Vec<String> {
    let mut breaches = Vec::new();
    for (i, write) in bench.writes().iter().enumerate() {
        let before = marks.iter().filter(|mark| mark.writes <= i).collect::<Vec<_>>();
        let what = if sets_off(write) {
            "goal"
        } else if write.device == Device::Photometer && write.value(photometer::LAMP_ENABLE) == Some(1) {
            "lamp"
        } else {
            continue;
        };
        if let Some(fault) = latched(&before, marks) {
            breaches.push(format!("{what} although fault {fault} is latched: {write:?}"));
        } else if !asked_since_stopped(&before) {
            breaches.push(format!("{what} although nobody asked since the stop: {write:?}"));
        }
    }
    breaches.extend(overruns(bench, marks));
    breaches
}

/// Whether a write sets an arm off, rather than halts it: a halting goal lies no farther than the arm needs to brake.
fn sets_off(write: &Written) -> bool {
    let Some(goal) = write
        .value(servo::GOAL_POSITION)
        .filter(|_| write.device != Device::Photometer)
    else {
        return false;
    };
    let speed = write.velocity as f64 * ServoUnits::X.velocity_rad_s;
    let braking = speed * speed / (2.0 * BRAKING_RAD_S2.min(255.0 * ServoUnits::X.acceleration_rad_s2));
    let way = (goal - write.position).abs() as f64 * std::f64::consts::TAU / ServoUnits::X.counts_per_turn;
    // A count of the encoder, and what rounding does to the braking distance.
    way > 1.05 * braking + 2.0 * std::f64::consts::TAU / ServoUnits::X.counts_per_turn
}

/// The fault of an emergency stop that was answered and that nobody has acknowledged by its name, or by that of a later
/// press, which takes its place.
fn latched(before: &[&Mark], all: &[Mark]) -> Option<FaultId> {
    let (pressed, fault) = before.iter().rev().find_map(|mark| match &mark.what {
        What::Answered {
            op: Op::Estop,
            fault: Some(fault),
        } => Some((mark.number, fault)),
        _ => None,
    })?;
    // From when it was asked for: what it allows may begin before its answer is heard.
    let acknowledged = before.iter().any(|mark| match &mark.what {
        What::Asked {
            op: Op::Acknowledge,
            fault: Some(named),
        } => {
            !refused(all, mark.number)
                && press(all, named, mark.number).is_some_and(|number| number >= pressed)
        }
        _ => false,
    });
    (!acknowledged).then(|| fault.clone())
}

/// Whether what was asked for was refused. What was neither that nor answered may have been done before a kill.
fn refused(all: &[Mark], number: usize) -> bool {
    all.iter()
        .any(|mark| mark.number == number && matches!(mark.what, What::Refused))
}

/// Which press latched a fault that was named later. One whose answer a kill swallowed has latched all the same, and is
/// the last that was not answered.
fn press(all: &[Mark], named: &FaultId, by: usize) -> Option<usize> {
    let answered = |of: Option<usize>| {
        all.iter().find_map(|mark| match &mark.what {
            What::Answered {
                op: Op::Estop,
                fault: Some(fault),
            } if of.map_or(fault == named, |number| number == mark.number) => Some(mark.number),
            _ => None,
        })
    };
    let swallowed = || {
        let asked = all.iter().rev().filter_map(|mark| match mark.what {
            What::Asked { op: Op::Estop, .. } if mark.number < by => Some(mark.number),
            _ => None,
        });
        asked.into_iter().find(|&number| answered(Some(number)).is_none())
    };
    answered(None).or_else(swallowed)
}

/// Whether somebody asked for a motion, and was answered no stop since.
fn asked_since_stopped(before: &[&Mark]) -> bool {
    let stopped = before
        .iter()
        .rposition(|mark| matches!(mark.what, What::Answered { op, .. } if op.stops()));
    let since = &before[stopped.map_or(0, |place| place + 1)..];
    since
        .iter()
        .any(|mark| matches!(mark.what, What::Asked { op, .. } if op.asks_to_move()))
}

/// For how long after a moment the sensor servo heard nothing.
fn deaf(marks: &[Mark], since: Duration) -> Duration {
    let mut until = since;
    for mark in marks {
        if let What::Silenced(time) = mark.what
            && mark.at <= until
        {
            until = until.max(mark.at + time);
        }
    }
    until - since
}

/// Arms that went farther after the last answered stop than they need to brake, although nobody asked for a motion.
fn overruns(bench: &SharedBench, marks: &[Mark]) -> Vec<String> {
    let Some(place) = marks
        .iter()
        .rposition(|mark| matches!(mark.what, What::Answered { op, .. } if op.stops()))
    else {
        return Vec::new();
    };
    let moved = marks[place..]
        .iter()
        .any(|mark| matches!(mark.what, What::Asked { op, .. } if op.asks_to_move()));
    if moved {
        return Vec::new();
    }
    let braking = FASTEST_RAD_S * FASTEST_RAD_S / (2.0 * BRAKING_RAD_S2);
    let now = bench.pose();
    let way = |arm: &Arm| (now.angle(*arm) - marks[place].pose.angle(*arm)).abs();
    // Nobody can stop an arm whose servo hears nothing, until it hears again.
    let deaf_rad = FASTEST_RAD_S * deaf(marks, marks[place].at).as_secs_f64();
    let far = Arm::BOTH.into_iter().filter(|arm| {
        let unheard_rad = if *arm == Arm::Sensor { deaf_rad } else { 0.0 };
        way(arm) > 1.1 * braking + unheard_rad
    });
    far.map(|arm| format!("the {arm} arm went {:.2}° after the stop", way(&arm).to_degrees()))
        .collect()
}
