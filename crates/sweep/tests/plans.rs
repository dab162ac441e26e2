//! Whole jobs become plans, on rigs that can do them and on rigs that cannot.

use std::f64::consts::TAU;

use arms::{ArmAngle, Envelope, Limits, Pose, Profile};
use sweep::{Job, Mechanics, Plan, Sweep, plan};

const QUICKSTART: &str = include_str!("../../../config/jobs/quickstart.toml");

/// The rig of config/rig.toml.
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
        profiles: [profile; 2],
        resolution_rad: [TAU / 4096.0; 2],
        grid_rad: [0.0; 2],
        approach: 0,
        overshoot_rad: 1.0_f64.to_radians(),
        settle_s: 0.02,
        integration_us: [100, 100_000],
        transaction_s: 0.006,
        warm_up_s: 0.2,
        start: Some(Pose::from_deg(-45.0, 45.0)),
    }
}

fn job(text: &str) -> Job {
    Job::parse(text, "job.toml").expect("a good job")
}

fn poses(plan: &Plan, sweep: Sweep) -> Vec<Pose> {
    let steps = plan.steps.iter().filter(|step| step.sweep == sweep);
    steps.map(sweep::Step::pose).collect()
}

#[test]
fn quickstart_takes_every_reading_it_asks_for() {
    let plan = plan(&job(QUICKSTART), &mechanics()).expect("a plan");
    assert_eq!(poses(&plan, Sweep::Dark).len(), 24);
    assert_eq!(poses(&plan, Sweep::Plane(0)).len(), 90);
    assert_eq!(poses(&plan, Sweep::Arc).len(), 90);
}
