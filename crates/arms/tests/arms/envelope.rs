use arms::{Arm, ArmAngle, Envelope, Limits, Pose, Violation};
use proptest::prelude::*;

fn envelope(can_pass: bool) -> Envelope {
    let limits = |min, max| Limits {
        min: ArmAngle::from_deg(min),
        max: ArmAngle::from_deg(max),
    };
    Envelope {
        light: limits(-88.0, 88.0),
        sensor: limits(-80.0, 85.0),
        separation_rad: 5.0_f64.to_radians(),
        can_pass,
    }
}

fn poses(range_deg: f64) -> impl Strategy<Value = Pose> {
    (-range_deg..range_deg, -range_deg..range_deg).prop_map(|(light, sensor)| Pose::from_deg(light, sensor))
}

/// The point at shares (s, t) of the rectangle between two poses.
fn between(from: Pose, to: Pose, s: f64, t: f64) -> Pose {
    Pose {
        light: ArmAngle::from_rad(from.light.rad() + s * (to.light - from.light)),
        sensor: ArmAngle::from_rad(from.sensor.rad() + t * (to.sensor - from.sensor)),
    }
}

#[test]
fn limits_and_separation_belong_to_what_is_allowed() {
    let envelope = Envelope {
        separation_rad: 0.5,
        ..envelope(false)
    };
    for light in [-88.0, 88.0] {
        let sensor = if light < 0.0 { 85.0 } else { -80.0 };
        assert_eq!(envelope.check_pose(Pose::from_deg(light, sensor)), Ok(()));
    }
    let beside = Pose {
        light: ArmAngle::from_rad(-0.25),
        sensor: ArmAngle::from_rad(0.25),
    };
    assert_eq!(envelope.check_pose(beside), Ok(()));
    assert!(!envelope.occluded(beside));
}

#[test]
fn what_is_just_outside_is_named() {
    let over = Pose::from_deg(-88.001, 40.0);
    let error = envelope(true).check_pose(over).unwrap_err();
    assert_eq!(
        error.to_string(),
        "light arm at -88.001° is outside its limits -88.000° … 88.000°"
    );
    let near = Pose::from_deg(36.0, 40.0);
    let error = envelope(false).check_pose(near).unwrap_err();
    assert_eq!(
        error.to_string(),
        "arms 4.000° apart with light at 36.000° and sensor at 40.000°, at least 5.000° are needed"
    );
    assert_eq!(
        envelope(true).check_pose(near),
        Ok(()),
        "passing arms may be there"
    );
    assert!(envelope(true).occluded(near), "but see nothing");
}

#[test]
fn what_is_no_number_is_nowhere() {
    let good = Pose::from_deg(-45.0, 45.0);
    for arm in Arm::BOTH {
        for angle in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let bad = good.with(arm, ArmAngle::from_rad(angle));
            for can_pass in [false, true] {
                let envelope = envelope(can_pass);
                assert!(
                    matches!(envelope.check_pose(bad), Err(Violation::Limit { arm: of, .. }) if of == arm)
                );
                assert!(envelope.check_path(good, bad).is_err());
                assert!(envelope.check_path(bad, good).is_err());
            }
        }
    }
}

#[test]
fn arms_that_collide_do_not_pass_each_other() {
    let (from, to) = (Pose::from_deg(-45.0, 45.0), Pose::from_deg(60.0, 45.0));
    assert_eq!(
        envelope(false).check_path(from, to),
        Err(Violation::Pass { from, to })
    );
    assert_eq!(envelope(true).check_path(from, to), Ok(()));
}

/// Both ends are fine and so is the straight line between them, but one arm may lag behind the other.
#[test]
fn a_lagging_arm_is_reckoned_with() {
    let (from, to) = (Pose::from_deg(-20.0, 0.0), Pose::from_deg(10.0, 30.0));
    let error = envelope(false).check_path(from, to).unwrap_err();
    assert!(matches!(
        error,
        Violation::Pass { .. } | Violation::Separation { .. }
    ));
}

proptest! {
    #[test]
    fn prop_an_allowed_path_has_no_forbidden_pose(
        from in poses(95.0), to in poses(95.0), s in 0.0..=1.0_f64, t in 0.0..=1.0_f64, can_pass: bool,
    ) {
        let envelope = envelope(can_pass);
        if envelope.check_path(from, to).is_ok() {
            prop_assert_eq!(envelope.check_pose(between(from, to, s, t)), Ok(()));
        }
    }

    /// Whatever is swept, and however much each angle is off: with a margin of as much as both together, nothing is in
    /// shadow.
    #[test]
    fn prop_what_is_clear_by_a_margin_is_nowhere_in_shadow_within_it(
        pose in poses(95.0), swept in prop::array::uniform2(-0.2..0.2_f64), margin in 0.0..0.05_f64,
        at in prop::array::uniform2(-0.5..=0.5_f64), share in 0.0..=1.0_f64, signs in prop::array::uniform2(prop::bool::ANY),
    ) {
        let envelope = envelope(true);
        let off = [share * margin, (1.0 - share) * margin];
        let angle = |arm: Arm, i: usize| {
            let off = if signs[i] { off[i] } else { -off[i] };
            ArmAngle::from_rad(pose.angle(arm).rad() + at[i] * swept[i] + off)
        };
        let within = Pose { light: angle(Arm::Light, 0), sensor: angle(Arm::Sensor, 1) };
        if envelope.clearance_rad(pose, swept) > margin {
            prop_assert!(!envelope.occluded(within), "{within:?}");
            prop_assert_eq!((within.light - within.sensor).signum(), (pose.light - pose.sensor).signum());
        }
    }

    /// And nothing is called in shadow that is not at some end of what is swept.
    #[test]
    fn prop_what_is_not_clear_is_in_shadow_at_a_corner_of_what_is_swept(
        pose in poses(95.0), swept in prop::array::uniform2(0.0..0.05_f64),
    ) {
        let envelope = envelope(true);
        let corner = |s: f64, t: f64| Pose {
            light: ArmAngle::from_rad(pose.light.rad() + s * swept[0]),
            sensor: ArmAngle::from_rad(pose.sensor.rad() + t * swept[1]),
        };
        let corners = [corner(0.5, 0.5), corner(0.5, -0.5), corner(-0.5, 0.5), corner(-0.5, -0.5)];
        if envelope.clearance_rad(pose, swept) < -1e-12 {
            prop_assert!(corners.into_iter().any(|corner| envelope.occluded(corner)), "{pose:?}");
        }
    }

    #[test]
    fn prop_a_refused_path_has_a_forbidden_pose(from in poses(88.0), to in poses(88.0)) {
        let envelope = envelope(false);
        let grid = (0..=40).flat_map(|s| (0..=40).map(move |t| (f64::from(s) / 40.0, f64::from(t) / 40.0)));
        // A grid finer than the separation cannot step over it.
        let forbidden = grid.into_iter().any(|(s, t)| envelope.check_pose(between(from, to, s, t)).is_err());
        prop_assert_eq!(envelope.check_path(from, to).is_err(), forbidden);
    }

    #[test]
    fn prop_the_way_back_is_as_good_as_the_way_there(from in poses(95.0), to in poses(95.0), can_pass: bool) {
        let envelope = envelope(can_pass);
        prop_assert_eq!(envelope.check_path(from, to).is_ok(), envelope.check_path(to, from).is_ok());
    }

    #[test]
    fn prop_the_deviation_is_that_of_the_directions(pose in poses(90.0)) {
        let (incident, exitant) = (pose.incident(), pose.exitant());
        prop_assert!((incident.length() - 1.0).abs() < 1e-12 && (exitant.length() - 1.0).abs() < 1e-12);
        prop_assert!((pose.deviation() - (incident.x + exitant.x)).abs() < 1e-12);
        prop_assert!((incident.angle_between(exitant) - pose.separation_rad()).abs() < 1e-7);
    }
}
