use arms::{Arm, ArmAngle, Pose};
use sweep::{Light, Mechanics, Step, Sweep, SweepError, plan, way};

use crate::{PAPER, job, mechanics, poses, steps};

#[test]
fn the_papers_job_takes_every_reading_it_asks_for() {
    let plan = plan(&job(PAPER), &mechanics()).unwrap();
    assert_eq!(poses(&plan, Sweep::Plane(0)).len(), 90);
    assert_eq!(poses(&plan, Sweep::Arc).len(), 90);
    let left_out: Vec<String> = plan
        .left_out
        .iter()
        .map(|left| format!("{}: {} ({})", left.what, left.why, left.readings))
        .collect();
    let expected = [
        "plane 70.0°, light -90.0° … -88.1°: the light arm may be at -88.0° … 88.0° (0)",
        "plane 70.0°, light 65.0° … 74.9°: arms closer than 5.0° shadow each other (0)",
        "plane 70.0°, light 75.0° … 88.0°: the arms cannot pass each other (0)",
        "plane 70.0°, light 88.1° … 90.0°: the light arm may be at -88.0° … 88.0° (0)",
        "arc, sensor 0.0° … 2.5°: arms closer than 5.0° shadow each other (0)",
        "arc, sensor 88.1° … 90.0°: the light arm may be at -88.0° … 88.0° (0)",
    ];
    assert_eq!(left_out, expected);
}

#[test]
fn dark_readings_come_first_where_the_arms_stand() {
    let plan = plan(&job(PAPER), &mechanics()).unwrap();
    let dark: Vec<&Step> = steps(&plan, Sweep::Dark).collect();
    assert!(
        dark.iter().enumerate().all(|(i, step)| step.index == i),
        "they come first"
    );
    for gain in 0..3 {
        for integration_us in [100, 100_000] {
            let repeats = dark
                .iter()
                .filter(|step| step.exposure == Some((gain, integration_us)))
                .count();
            assert_eq!(repeats, 4, "gain step {gain}, {integration_us} µs");
        }
    }
    let resolution = mechanics().resolution_rad[0];
    for step in dark {
        let moved = [
            step.pose().light.rad() + 45.0_f64.to_radians(),
            step.pose().sensor.rad() - 45.0_f64.to_radians(),
        ];
        assert!(
            moved.iter().all(|rad| rad.abs() <= resolution / 2.0),
            "dark readings need no motion"
        );
        assert!(!step.lamp);
    }
    assert!(
        plan.steps
            .iter()
            .all(|step| step.lamp == (step.sweep != Sweep::Dark))
    );
}

#[test]
fn a_plane_covers_both_sides_of_the_mirror_direction_and_holds_the_sensor() {
    let plan = plan(&job(PAPER), &mechanics()).unwrap();
    let poses = poses(&plan, Sweep::Plane(0));
    let sensor = poses[0].sensor;
    assert!((sensor.deg() - 70.0).abs() <= 0.044, "{}", sensor.deg());
    assert!(poses.iter().all(|pose| pose.sensor == sensor));
    let (outwards, inwards) = poses
        .iter()
        .fold((0, 0), |(outwards, inwards), pose| match pose.deviation() {
            d if d < 0.0 => (outwards + 1, inwards),
            d if d > 0.0 => (outwards, inwards + 1),
            _ => (outwards, inwards),
        });
    assert!(
        outwards > 10 && inwards > 30,
        "{outwards} outwards, {inwards} inwards"
    );
    let light =
        |choose: fn(f64, f64) -> f64| poses.iter().map(|pose| pose.light.deg()).reduce(choose).unwrap();
    assert!((light(f64::min) + 88.0).abs() < 0.1 && (light(f64::max) - 65.0).abs() < 0.1);
}

#[test]
fn the_arc_keeps_its_offset_and_meets_each_plane_in_one_pose() {
    // At 70° nothing lies 0.25 further out.
    for (offset, met) in [("0.0", [1, 1]), ("0.3", [1, 1]), ("-0.25", [0, 1])] {
        let text = format!(
            "[[plane]]\ntheta_r_deg = 70\nreadings = 40\n[[plane]]\ntheta_r_deg = 40\nreadings = 40\n\
             [arc]\nreadings = 50\noffset = {offset}"
        );
        let plan = plan(&job(&text), &mechanics()).unwrap();
        let arc = poses(&plan, Sweep::Arc);
        let offset: f64 = offset.parse().unwrap();
        for pose in &arc {
            // Half a count of the light.
            let half = pose.light.rad().cos() * mechanics().resolution_rad[0] / 2.0 + 1e-6;
            assert!(
                (pose.deviation() - offset).abs() <= half,
                "{pose:?} deviates by {}",
                pose.deviation()
            );
        }
        let shared = [0, 1].map(|plane| {
            let plane = poses(&plan, Sweep::Plane(plane));
            arc.iter().filter(|pose| plane.contains(pose)).count()
        });
        assert_eq!(shared, met, "offset {offset}");
    }
}

#[test]
fn the_mirror_arc_reaches_from_half_the_separation_to_the_limits() {
    let plan = plan(&job(PAPER), &mechanics()).unwrap();
    let mut sensor: Vec<f64> = poses(&plan, Sweep::Arc)
        .iter()
        .map(|pose| pose.sensor.deg())
        .collect();
    sensor.sort_by(f64::total_cmp);
    assert!(
        (sensor[0] - 2.5).abs() < 0.1 && (sensor[89] - 88.0).abs() < 0.1,
        "{sensor:?}"
    );
    assert!(
        poses(&plan, Sweep::Arc)
            .iter()
            .all(|pose| pose.light.rad() == -pose.sensor.rad())
    );
}

/// Near retro-reflection a rig whose arms pass each other has only a gap.
#[test]
fn arms_that_pass_each_other_measure_beyond_the_gap() {
    let mut mechanics = mechanics();
    mechanics.envelope.can_pass = true;
    let plan = plan(
        &job("[[plane]]\ntheta_r_deg = 45\nreadings = 200\ndistribution = \"uniform\""),
        &mechanics,
    );
    let poses = poses(&plan.unwrap(), Sweep::Plane(0));
    let beyond = poses.iter().filter(|pose| pose.light > pose.sensor).count();
    assert!(beyond > 10, "{beyond} beyond the sensor");
    assert!(poses.iter().all(|&pose| !mechanics.envelope.occluded(pose)));
}

/// At θ_r = 0 the mirror direction is behind the sensor.
#[test]
fn a_sensor_at_the_normal_sees_one_side() {
    let plan = plan(&job("[[plane]]\ntheta_r_deg = 0\nreadings = 30"), &mechanics()).unwrap();
    let poses = poses(&plan, Sweep::Plane(0));
    assert_eq!(poses.len(), 30);
    assert!(
        poses
            .iter()
            .all(|pose| (-88.0..=-5.0).contains(&pose.light.deg()))
    );
}

#[test]
fn the_papers_distribution_merges_what_falls_on_one_count() {
    let text = "[[plane]]\ntheta_r_deg = 70\nreadings = 90\ndistribution = \"paper\"";
    let plan = plan(&job(text), &mechanics()).unwrap();
    let left = plan
        .left_out
        .iter()
        .find(|left| left.readings > 0)
        .expect("some were merged");
    assert_eq!(poses(&plan, Sweep::Plane(0)).len() + left.readings, 90);
    assert_eq!(left.what, format!("plane 70.0°, {} values of d_p", left.readings));
}

#[test]
fn what_this_rig_cannot_do_is_refused_with_the_key() {
    let small = |mut mechanics: Mechanics| {
        mechanics.envelope.sensor.max = ArmAngle::from_deg(60.0);
        mechanics
    };
    let error = plan(&job(PAPER), &small(mechanics())).unwrap_err();
    assert_eq!(
        error.to_string(),
        "job.toml: plane[0].theta_r_deg: nothing can be measured at 70.0°: the sensor arm may be at -88.0° … 60.0°"
    );
    // The arms stand the wrong way round for the mirror direction.
    let swapped = Mechanics {
        start: Some(Pose::from_deg(45.0, -45.0)),
        ..mechanics()
    };
    let text = "[[plane]]\ntheta_r_deg = 0\nreadings = 9\n[arc]\nreadings = 9";
    let error = plan(&job(text), &swapped).unwrap_err();
    assert_eq!(
        error.to_string(),
        "job.toml: arc.offset: nothing can be measured at 0: the arms cannot pass each other"
    );
    let outside = Mechanics {
        start: Some(Pose::from_deg(-91.0, 45.0)),
        ..mechanics()
    };
    let error = plan(&job(PAPER), &outside).unwrap_err();
    assert!(matches!(error, SweepError::Start { .. }), "{error}");
    let touching = Mechanics {
        start: Some(Pose::from_deg(44.0, 45.0)),
        ..mechanics()
    };
    let error = plan(&job(PAPER), &touching).unwrap_err();
    assert!(matches!(error, SweepError::Start { .. }), "{error}");
}

/// A servo at its limit hardly ever reads exactly that.
#[test]
fn an_arm_that_stands_a_hair_beyond_its_limit_may_start() {
    let start = Some(Pose::from_deg(-88.05, 88.05));
    let plan = plan(&job(PAPER), &Mechanics { start, ..mechanics() }).unwrap();
    assert!(mechanics().envelope.check_pose(plan.steps[0].pose()).is_ok());
}

#[test]
fn sweeps_are_taken_in_the_order_with_the_least_travel() {
    let text = "[[plane]]\ntheta_r_deg = 80\nreadings = 20\n[[plane]]\ntheta_r_deg = 10\nreadings = 20\n\
                [[plane]]\ntheta_r_deg = 45\nreadings = 20\n[arc]\nreadings = 20";
    let job = job(text);
    let order = |start| {
        let plan = plan(
            &job,
            &Mechanics {
                start: Some(start),
                ..mechanics()
            },
        )
        .unwrap();
        let mut sweeps: Vec<Sweep> = plan.steps.iter().map(|step| step.sweep).collect();
        sweeps.dedup();
        (sweeps, plan.seconds())
    };
    let (low, _) = order(Pose::from_deg(0.0, 10.0));
    assert_eq!(low[1], Sweep::Plane(1), "begins with the plane at hand: {low:?}");
    let (high, _) = order(Pose::from_deg(70.0, 80.0));
    assert_eq!(
        high[1],
        Sweep::Plane(0),
        "begins with the plane at hand: {high:?}"
    );
}

#[test]
fn the_sensor_makes_room_before_the_light_follows() {
    let way = way(
        &mechanics(),
        Pose::from_deg(15.0, 20.0),
        Pose::from_deg(64.0, 70.0),
    )
    .unwrap();
    assert_eq!(way.len(), 2);
    assert!((way[0].light.deg() - 15.0).abs() < 0.05 && (way[0].sensor.deg() - 70.0).abs() < 0.05);
}

#[test]
fn no_way_leads_past_the_other_arm() {
    let error = way(
        &mechanics(),
        Pose::from_deg(-20.0, 20.0),
        Pose::from_deg(40.0, 20.0),
    )
    .unwrap_err();
    assert_eq!(
        error.to_string(),
        "no safe way leads from light -20.00°, sensor 20.00° to light 40.00°, sensor 20.00°"
    );
}

/// Every motion ends in the direction of approach, also the first one of an arm.
#[test]
fn every_approach_is_from_the_side_that_is_asked_for() {
    for approach in [1, -1] {
        let mechanics = Mechanics {
            approach,
            ..mechanics()
        };
        let plan = plan(&job(PAPER), &mechanics).unwrap();
        let mut from = plan.steps[0].pose();
        let mut came = [0.0; 2];
        for step in &plan.steps {
            for &to in &step.path {
                for arm in Arm::BOTH {
                    let way = to.angle(arm) - from.angle(arm);
                    if way.abs() > 1e-9 {
                        came[arm as usize] = way.signum();
                    }
                }
                from = to;
            }
            if step.sweep != Sweep::Dark {
                assert_eq!(
                    came,
                    [f64::from(approach); 2],
                    "step {}: {:?}",
                    step.index,
                    step.path
                );
            }
        }
    }
}

/// What a step is said to take is what its parts take.
#[test]
fn seconds_are_those_of_profiles_settling_and_integration() {
    let mechanics = mechanics();
    let plan = plan(&job(PAPER), &mechanics).unwrap();
    let mut from = plan.steps[0].pose();
    for step in &plan.steps {
        let mut motion = 0.0;
        for &to in &step.path {
            let legs = Arm::BOTH
                .map(|arm| mechanics.profiles[arm as usize].duration_s(to.angle(arm) - from.angle(arm)));
            motion += legs[0].max(legs[1]);
            from = to;
        }
        let rest = step.seconds - motion - mechanics.settle_s - mechanics.transaction_s;
        match step.exposure {
            Some((_, us)) => assert!((rest - f64::from(us) * 1e-6).abs() < 1e-9, "step {}", step.index),
            None => assert!(
                rest > 0.006 && rest < 0.1,
                "step {}: {rest} s of integration",
                step.index
            ),
        }
    }
    let sum: f64 = plan.steps.iter().map(|step| step.seconds).sum();
    assert!((plan.seconds() - sum - mechanics.warm_up_s - plan.closing_s).abs() < 1e-9);
}

#[test]
fn without_a_known_start_the_first_way_is_not_timed() {
    let unknown = plan(
        &job(PAPER),
        &Mechanics {
            start: None,
            ..mechanics()
        },
    )
    .unwrap();
    let first = steps(&unknown, Sweep::Dark).next().unwrap().pose();
    let next = unknown.steps.iter().find(|step| step.lamp).unwrap();
    assert_eq!(
        next.path,
        [first],
        "dark readings are taken where the first sweep begins"
    );
}

#[test]
fn the_choice_of_exposures_has_its_price_in_the_plan() {
    let mechanics = mechanics();
    let plan = plan(&job(PAPER), &mechanics).unwrap();
    let light = Light::new(&plan, &mechanics);
    let dark_s: f64 = steps(&plan, Sweep::Dark)
        .map(|step| f64::from(step.exposure.expect("fixed").1) * 1e-6)
        .sum();
    let lit = plan.steps.iter().filter(|step| step.lamp).count();
    assert_eq!(light.readings, lit);
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    assert!(near(light.least_s, dark_s + lit as f64 * 1e-4), "{light:?}");
    assert!(near(light.most_s, dark_s + lit as f64 * 0.1), "{light:?}");
    assert!(
        light.least_s < light.foreseen_s && light.foreseen_s < light.most_s,
        "{light:?}"
    );
    assert!(light.again_s > 0.006 && light.again_s < 0.106, "{light:?}");
    // Motion, settling and the dark as planned, and nine of the longest for each reading.
    let rest_s = plan.seconds() - lit as f64 * light.again_s;
    assert!(
        near(light.worst_s, rest_s + lit as f64 * 9.0 * 0.106),
        "{light:?}"
    );
    // What is flown may all have to be taken again.
    let fly = PAPER.replace("mode = \"step\"", "mode = \"fly\"");
    let flown = sweep::plan(&job(&fly), &mechanics).unwrap();
    let price = Light::new(&flown, &mechanics);
    assert_eq!(price.readings, lit);
    assert!(
        price.worst_s > flown.seconds() + lit as f64 * 9.0 * 0.106,
        "{price:?}"
    );
}

const SNAKE: &str = "[snake]\nlegs = 6\n[sweep]\nmode = \"fly\"";

#[test]
fn a_snake_is_flown_leg_by_leg_without_a_way_between() {
    for (legs, most_s) in [(3, 7.0), (6, 11.0), (10, 17.0)] {
        let text = SNAKE.replace('6', &legs.to_string());
        let plan = plan(&job(&text), &mechanics()).unwrap();
        println!(
            "{legs} legs: {:.1} s, {} readings",
            plan.seconds(),
            plan.steps.len()
        );
        assert!(plan.seconds() < most_s, "{legs} legs take {} s", plan.seconds());
        let lit: Vec<&Step> = plan.steps.iter().filter(|step| step.lamp).collect();
        assert!(
            lit.iter().all(|step| step.pass.is_some()),
            "not all of it is flown"
        );
        // Each begins where the one before ended.
        for pair in lit.windows(2).filter(|pair| pair[0].sweep != pair[1].sweep) {
            let [from, to] = [pair[0].pose(), pair[1].pose()];
            assert!((from.light - to.light).abs() < 1e-9 && (from.sensor - to.sensor).abs() < 1e-9);
        }
        for leg in 0..legs {
            let poses = poses(&plan, Sweep::Leg(leg));
            assert!(poses.len() > 20, "leg {leg} has {} readings", poses.len());
            let half: Vec<f64> = poses
                .iter()
                .map(|p| (p.light.deg() + p.sensor.deg()) / 2.0)
                .collect();
            // Both sides of the mirror direction, read closely about it.
            assert!(half.iter().any(|&h| h < -1.5) && half.iter().any(|&h| h > 1.5));
            let near = half
                .windows(2)
                .filter(|pair| pair[0].abs() < 2.0 && pair[1].abs() < 2.0);
            assert!(near.clone().count() > 0 && near.clone().all(|pair| (pair[1] - pair[0]).abs() < 1.0));
        }
    }
}

#[test]
fn a_leg_has_as_many_readings_as_it_asks_for_and_is_stepped_where_the_job_says_so() {
    let text = "[[leg]]\nhalf_deg = [-3.0, 43.0]\ndifference_deg = [55.0, 42.0]\nreadings = 17";
    let plan = plan(&job(text), &mechanics()).unwrap();
    let steps: Vec<&Step> = steps(&plan, Sweep::Leg(0)).collect();
    assert_eq!(steps.len(), 17);
    assert!(steps.iter().all(|step| step.pass.is_none()));
    let ends = [steps[0].pose(), steps[16].pose()];
    let expected = [Pose::from_deg(-58.0, 52.0), Pose::from_deg(1.0, 85.0)];
    let near = |a: Pose, b: Pose| (a.light - b.light).abs() < 2e-3 && (a.sensor - b.sensor).abs() < 2e-3;
    let forth = near(ends[0], expected[0]) && near(ends[1], expected[1]);
    let back = near(ends[1], expected[0]) && near(ends[0], expected[1]);
    assert!(forth || back, "{ends:?}");
}

/// What of a leg cannot be measured is left out in words, and the rest of it flown.
#[test]
fn a_leg_is_cut_where_the_arms_cannot_go() {
    let mut mechanics = mechanics();
    mechanics.envelope.sensor.max = ArmAngle::from_deg(80.0);
    let plan = plan(&job(SNAKE), &mechanics).unwrap();
    let left = plan
        .left_out
        .iter()
        .find(|left| left.what.starts_with("leg 3, sensor"));
    let left = left.unwrap_or_else(|| panic!("{:?}", plan.left_out));
    assert!(left.why.contains("80.0°"), "{left:?}");
    for step in steps(&plan, Sweep::Leg(3)) {
        assert!(step.pose().sensor.deg() <= 80.0);
    }
    mechanics.envelope.sensor.max = ArmAngle::from_deg(60.0);
    mechanics.start = Some(Pose::from_deg(-45.0, 40.0));
    let error = sweep::plan(&job(SNAKE), &mechanics).unwrap_err().to_string();
    assert!(error.contains("leg[5]: nothing of it can be measured"), "{error}");
}
