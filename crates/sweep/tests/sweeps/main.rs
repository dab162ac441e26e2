//! Job files become jobs, and jobs plans, on rigs that can do them and on rigs that cannot.

mod jobs;
mod laws;
mod plans;
mod scenes;

use std::f64::consts::TAU;

use arms::{ArmAngle, Envelope, Limits, Pose, Profile};
use sweep::{Job, Mechanics, Plan, Step, Sweep};

const PAPER: &str = include_str!("../../../../config/jobs/paper.toml");

/// A rig like that of config/rig.toml.
fn mechanics() -> Mechanics {
    let limits = Limits {
        min: ArmAngle::from_deg(-88.0),
        max: ArmAngle::from_deg(88.0),
    };
    let profile = Profile {
        velocity_rad_s: 59.1_f64.to_radians(),
        acceleration_rad_s2: 193.1_f64.to_radians(),
    };
    Mechanics {
        envelope: Envelope {
            light: limits,
            sensor: limits,
            separation_rad: 5.0_f64.to_radians(),
            can_pass: false,
        },
        margin_rad: 0.0,
        tolerance_rad: 0.0,
        profiles: [profile; 2],
        resolution_rad: [TAU / 4096.0; 2],
        grid_rad: [0.0; 2],
        approach: 0,
        overshoot_rad: 1.0_f64.to_radians(),
        settle_s: 0.02,
        late_s: 0.0,
        integration_us: [100, 100_000],
        exposures: 9,
        transaction_s: 0.006,
        in_flight: true,
        flight_s: 0.009,
        warm_up_s: 0.2,
        dark_every_s: 600.0,
        reference: None,
        start: Some(Pose::from_deg(-45.0, 45.0)),
    }
}

fn job(text: &str) -> Job {
    Job::parse(text, "job.toml").expect("a good job")
}

fn steps(plan: &Plan, sweep: Sweep) -> impl Iterator<Item = &Step> {
    plan.steps.iter().filter(move |step| step.sweep == sweep)
}

fn poses(plan: &Plan, sweep: Sweep) -> Vec<Pose> {
    steps(plan, sweep).map(Step::pose).collect()
}
