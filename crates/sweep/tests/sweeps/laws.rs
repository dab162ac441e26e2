use arms::{Arm, ArmAngle, Limits, Pose};
use proptest::prelude::*;
use sweep::{Arc, Distribution, Job, Mechanics, Mode, Model, Plan, Plane, Sweep, SweepError, plan};

use crate::{mechanics, poses};

prop_compose! {
    fn limits()(min in -89.0..-40.0_f64, max in 40.0..89.0_f64) -> Limits {
        Limits { min: ArmAngle::from_deg(min), max: ArmAngle::from_deg(max) }
    }
}

prop_compose! {
    fn rigs()(
        light in limits(),
        sensor in limits(),
        separation_deg in 0.5..30.0_f64,
        can_pass: bool,
        approach in -1_i8..=1,
        gear in prop::sample::select(vec![0.5, 1.0, 2.3]),
        grid_rad in prop::array::uniform2(-1e-3..1e-3_f64),
        start in prop::option::of((-39.0..-16.0_f64, 16.0..39.0_f64)),
        swapped: bool,
        unsure_rad in (0.0..5e-3_f64, 1e-3..5e-3_f64),
    ) -> Mechanics {
        let mut mechanics = mechanics();
        mechanics.envelope.light = light;
        mechanics.envelope.sensor = sensor;
        mechanics.envelope.separation_rad = separation_deg.to_radians();
        mechanics.envelope.can_pass = can_pass;
        mechanics.approach = approach;
        (mechanics.margin_rad, mechanics.tolerance_rad) = unsure_rad;
        mechanics.resolution_rad = mechanics.resolution_rad.map(|rad| rad / gear);
        mechanics.grid_rad = grid_rad;
        mechanics.start = start.map(|(a, b)| if swapped { Pose::from_deg(b, a) } else { Pose::from_deg(a, b) });
        mechanics
    }
}

prop_compose! {
    fn planes()(
        theta_r_deg in 0.0..=85.0_f64,
        readings in 1_usize..120,
        distribution in prop::sample::select(vec![Distribution::Capped, Distribution::Paper, Distribution::Uniform, Distribution::Lobe]),
    ) -> Plane {
        Plane { theta_r: theta_r_deg.to_radians(), readings, distribution }
    }
}

prop_compose! {
    fn jobs()(
        planes in prop::collection::vec(planes(), 1..4),
        arc in prop::option::of((1_usize..120, -0.6..0.6_f64)),
        mirror: bool,
        fly: bool,
        passes in 1_usize..=2,
    ) -> Job {
        Job {
            name: "job.toml".to_owned(),
            specimen: sweep::Specimen::default(),
            operator: String::new(),
            project: String::new(),
            on_stage: false,
            planes,
            legs: Vec::new(),
            arc: arc.map(|(readings, offset)| Arc { readings, offset: if mirror { 0.0 } else { offset } }),
            mode: if fly { Mode::Fly } else { Mode::Step },
            passes,
            model: Model::Separable,
            scene: None,
            formats: Vec::new(),
            until: None,
        }
    }
}

/// The plan, where the rig can do every sweep of the job.
fn possible(job: &Job, mechanics: &Mechanics) -> Result<Plan, TestCaseError> {
    match plan(job, mechanics) {
        Ok(plan) => Ok(plan),
        Err(SweepError::Unreachable { .. }) => Err(TestCaseError::reject("beyond this rig")),
        Err(error) => Err(TestCaseError::fail(error.to_string())),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_global_rejects: 100_000, ..ProptestConfig::default() })]

    #[test]
    fn prop_every_leg_and_every_pose_is_allowed(job in jobs(), mechanics in rigs()) {
        let plan = possible(&job, &mechanics)?;
        let mut from = plan.steps[0].pose();
        for step in &plan.steps {
            for &to in &step.path {
                prop_assert_eq!(mechanics.envelope.check_path(from, to), Ok(()), "step {}", step.index);
                from = to;
            }
            prop_assert_eq!(mechanics.envelope.check_pose(step.pose()), Ok(()));
            // Wherever the arms come to rest for it, and wherever they really are then.
            let clearance = mechanics.envelope.clearance_rad(step.pose(), [2.0 * mechanics.tolerance_rad; 2]);
            prop_assert!(!step.lamp || clearance >= mechanics.margin_rad, "step {} is in shadow", step.index);
        }
    }

    /// What is collected evenly about each pose of a flight, within its cell, is collected clear of the shadow.
    #[test]
    fn prop_a_cell_keeps_clear_of_the_shadow(job in jobs(), mechanics in rigs()) {
        let plan = possible(&Job { mode: Mode::Fly, ..job }, &mechanics)?;
        let margin_rad = mechanics.margin_rad + mechanics.tolerance_rad;
        for flight in plan.steps.chunk_by(|a, b| a.pass == b.pass).filter(|of| of[0].pass.is_some() && of[0].lamp) {
            let poses: Vec<Pose> = flight.iter().map(sweep::Step::pose).collect();
            let (first, last) = (poses[0], poses[poses.len() - 1]);
            let way = |arm: Arm| (last.angle(arm) - first.angle(arm)).abs();
            let lead = if way(Arm::Light) >= way(Arm::Sensor) { Arm::Light } else { Arm::Sensor };
            for (pose, [low, high]) in poses.iter().zip(sweep::cells(&poses, lead, &mechanics.envelope, margin_rad)) {
                let along = (pose.angle(lead) - first.angle(lead)).abs();
                prop_assert!(low <= along && along <= high);
                let swept = Arm::BOTH.map(|arm| if way(arm) > 0.0 { high - low } else { 0.0 });
                let clearance = mechanics.envelope.clearance_rad(*pose, swept);
                prop_assert!(clearance >= margin_rad - 1e-12, "{clearance} rad clear at {pose:?}");
                prop_assert!(high - low > 0.0, "no light can be collected at {pose:?}");
            }
        }
    }

    /// An arm in flight may be anywhere on its way when another is stuck.
    #[test]
    fn prop_a_flight_is_free_from_end_to_end_and_taken_once_or_there_and_back(job in jobs(), mechanics in rigs()) {
        let each = job.passes;
        let plan = possible(&Job { mode: Mode::Fly, ..job }, &mechanics)?;
        let passes = plan.steps.iter().filter_map(|step| step.pass).max().map_or(0, |last| last + 1);
        let lit = |pass: usize| plan.steps.iter().filter(move |step| step.lamp && step.pass == Some(pass));
        let poses: Vec<Vec<_>> = (0..passes)
            .map(|pass| lit(pass).map(sweep::Step::pose).collect())
            .filter(|poses: &Vec<_>| !poses.is_empty())
            .collect();
        for pass in &poses {
            prop_assert_eq!(mechanics.envelope.check_path(pass[0], pass[pass.len() - 1]), Ok(()));
        }
        for both in poses.chunks(each) {
            prop_assert_eq!(both.len(), each);
            prop_assert!(each == 1 || both[0].iter().rev().eq(&both[1]));
        }
    }

    #[test]
    fn prop_nothing_asked_for_is_lost_unsaid(job in jobs(), mechanics in rigs()) {
        let job = Job { mode: Mode::Step, ..job };
        let plan = possible(&job, &mechanics)?;
        let asked = job.planes.iter().map(|plane| plane.readings).sum::<usize>()
            + job.arc.map_or(0, |arc| arc.readings);
        let taken = plan.steps.iter().filter(|step| step.sweep != Sweep::Dark).count();
        let left_out: usize = plan.left_out.iter().map(|left| left.readings).sum();
        prop_assert_eq!(taken + left_out, asked, "{:?}", plan.left_out);
    }

    #[test]
    fn prop_no_pose_is_read_twice_in_a_sweep(job in jobs(), mechanics in rigs()) {
        let job = Job { mode: Mode::Step, ..job };
        let plan = possible(&job, &mechanics)?;
        let sweeps = (0..job.planes.len()).map(Sweep::Plane).chain([Sweep::Arc]);
        for sweep in sweeps {
            let mut poses = poses(&plan, sweep);
            poses.sort_by(|a, b| {
                let by = |arm| a.angle(arm).rad().total_cmp(&b.angle(arm).rad());
                by(Arm::Light).then(by(Arm::Sensor))
            });
            prop_assert!(poses.windows(2).all(|pair| pair[0] != pair[1]), "{sweep}: {poses:?}");
        }
    }

    #[test]
    fn prop_poses_are_whole_counts(job in jobs(), mechanics in rigs()) {
        let plan = possible(&job, &mechanics)?;
        for pose in plan.steps.iter().flat_map(|step| &step.path) {
            for arm in Arm::BOTH {
                let counts = (pose.angle(arm).rad() - mechanics.grid_rad[arm as usize])
                    / mechanics.resolution_rad[arm as usize];
                prop_assert!((counts - counts.round()).abs() < 1e-6, "{arm} at {counts} counts");
            }
        }
    }

    #[test]
    fn prop_a_plan_survives_json_and_is_numbered(job in jobs(), mechanics in rigs()) {
        let plan = possible(&job, &mechanics)?;
        let json = serde_json::to_string(&plan).expect("plain data");
        prop_assert_eq!(&serde_json::from_str::<Plan>(&json).expect("its own JSON"), &plan);
        prop_assert!(plan.steps.iter().enumerate().all(|(i, step)| step.index == i));
        prop_assert!(plan.steps.iter().all(|step| step.seconds.is_finite() && step.seconds > 0.0));
    }

    #[test]
    fn prop_any_text_is_a_job_or_an_error(text in "\\PC{0,80}") {
        let text = format!("[[plane]]\ntheta_r_deg = 3\n{text}");
        if let Ok(job) = Job::parse(&text, "job.toml") {
            prop_assert!(!job.planes.is_empty());
        }
    }
}
