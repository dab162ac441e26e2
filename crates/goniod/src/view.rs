//! How what goes over HTTP is made of what the rig, the capture and the report say.

use api::{
    Activity, ArmView, FaultCode, LeftOutView, LightView, PlanView, ReadingView, RigView, SweepView,
    VerdictView,
};
use arms::Arm;
use report::{Measurement, Verdict};
use rig::{FaultKind, RigFile, Snapshot};
use sweep::{Light, Plan};

/// The code of a kind of fault.
pub(crate) fn fault_code(kind: FaultKind) -> FaultCode {
    match kind {
        FaultKind::NoReply => FaultCode::NoReply,
        FaultKind::Refused => FaultCode::Refused,
        FaultKind::Hardware => FaultCode::Hardware,
        FaultKind::Motion => FaultCode::Motion,
        FaultKind::Light => FaultCode::Light,
        FaultKind::Disconnected => FaultCode::Disconnected,
        FaultKind::Mismatch => FaultCode::Mismatch,
        FaultKind::StoodStill => FaultCode::StoodStill,
        _ => FaultCode::Setup,
    }
}

/// What the rig is doing in a state of a capture.
pub(crate) fn activity(state: capture::State) -> Activity {
    match state {
        capture::State::Identifying => Activity::Identifying,
        capture::State::Engaging => Activity::Engaging,
        capture::State::WarmingUp => Activity::WarmingUp,
        capture::State::Running => Activity::Running,
        capture::State::Paused => Activity::Paused,
        capture::State::Suspended => Activity::Suspended,
        capture::State::ShuttingDown => Activity::ShuttingDown,
        capture::State::Parking => Activity::Moving,
    }
}

/// A rig of which nothing is known but its file.
pub(crate) fn unknown_rig(rig: &RigFile) -> RigView {
    let arm = |arm: Arm| {
        let limits = rig.envelope.limits(arm);
        ArmView {
            measured_deg: None,
            goal_deg: None,
            moving: false,
            torque: false,
            min_deg: limits.min.deg(),
            max_deg: limits.max.deg(),
        }
    };
    RigView {
        connected: false,
        trouble: None,
        activity: Activity::Idle,
        arms: Arm::BOTH.map(arm),
        separation_deg: rig.envelope.separation_rad.to_degrees(),
        can_pass: rig.envelope.can_pass,
        lamp: false,
        lamp_monitor: None,
        temperature_c: None,
        fault: None,
        queue_held: None,
        job: None,
        run: None,
        progress: None,
    }
}

/// Shows in the picture of a rig what a snapshot saw.
pub(crate) fn show_snapshot(view: &mut RigView, snapshot: &Snapshot) {
    for (arm, location) in view.arms.iter_mut().zip(&snapshot.arms) {
        arm.measured_deg = Some(location.measured.deg());
        arm.goal_deg = Some(location.goal.deg());
        arm.moving = location.moving;
        arm.torque = location.torque;
    }
    view.connected = true;
    view.trouble = None;
}

/// A plan and what the choice of exposures may make of its time.
pub(crate) fn plan(plan: &Plan, light: Light) -> PlanView {
    let mut sweeps: Vec<SweepView> = Vec::new();
    for step in &plan.steps {
        let sweep = step.sweep.to_string();
        match sweeps.iter_mut().find(|known| known.sweep == sweep) {
            Some(known) => known.readings += 1,
            None => sweeps.push(SweepView { sweep, readings: 1 }),
        }
    }
    let left_out = plan.left_out.iter().map(|left| LeftOutView {
        what: left.what.clone(),
        why: left.why.clone(),
        readings: left.readings,
        seconds: left.seconds,
    });
    PlanView {
        readings: plan.steps.len(),
        seconds: plan.seconds(),
        sweeps,
        light: LightView {
            readings: light.readings,
            foreseen_s: light.foreseen_s,
            least_s: light.least_s,
            most_s: light.most_s,
            again_s: light.again_s,
            worst_s: light.worst_s,
        },
        left_out: left_out.collect(),
        open: plan.open,
    }
}

/// A reading with what follows from it.
pub(crate) fn reading(measurement: &Measurement) -> ReadingView {
    let reading = &measurement.reading;
    let counts = &reading.counts;
    ReadingView {
        step: reading.step,
        attempt: reading.attempt,
        accepted: reading.accepted,
        sweep: reading.sweep.to_string(),
        lamp: reading.lamp,
        light_deg: reading.measured.light.deg(),
        sensor_deg: reading.measured.sensor.deg(),
        theta_r_deg: measurement.theta_r.to_degrees(),
        deviation: measurement.deviation,
        counts: counts.rgb,
        monitor: counts.monitor,
        gain: counts.exposure.gain.into(),
        integration_us: counts.exposure.integration_us,
        temperature_c: counts.temperature_c,
        f: measurement.rgb().map(|rgb| rgb.to_array()),
        flags: reading
            .flags
            .iter()
            .map(|&flag| report::flag_name(flag).to_owned())
            .collect(),
        time_s: measurement.time_s,
    }
}

/// What the checks say of a run's result.
pub(crate) fn verdict(verdict: Verdict) -> VerdictView {
    match verdict {
        Verdict::Unknown => VerdictView::Unknown,
        Verdict::Good => VerdictView::Good,
        Verdict::Look => VerdictView::Look,
        Verdict::Bad => VerdictView::Bad,
    }
}
