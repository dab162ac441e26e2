use arms::{Profile, Trajectory};
use proptest::prelude::*;

/// Speed and acceleration of X-series registers V and A, degrees (e-manual, Profile Velocity and Acceleration).
fn registers(v: f64, a: f64) -> Profile {
    Profile {
        velocity_rad_s: (v * 0.229 * 6.0).to_radians(),
        acceleration_rad_s2: (a * 214.577 / 10.0).to_radians(),
    }
}

/// Durations that ROBOTIS figures give for V=20, A=5 and for V=100, A=20.
#[test]
fn durations_are_those_of_the_servo() {
    let slow = registers(20.0, 5.0);
    let fast = registers(100.0, 20.0);
    let table = [
        (slow, 1.0, 0.193),
        (slow, 5.0, 0.432),
        (slow, 90.0, 3.53),
        (slow, 160.0, 6.08),
        (fast, 90.0, 0.975),
    ];
    for (profile, degrees, seconds) in table {
        for way in [f64::to_radians(degrees), -f64::to_radians(degrees)] {
            let duration = profile.duration_s(way);
            assert!(
                (duration / seconds - 1.0).abs() < 3e-3,
                "{degrees}°: {duration} s, not {seconds} s"
            );
        }
    }
}

#[test]
fn no_way_takes_no_time() {
    let profile = registers(20.0, 5.0);
    assert_eq!(profile.duration_s(0.0), 0.0);
    assert_eq!(Trajectory::new(1.0, 0.0, 1.0, profile).at(0.0), (1.0, 0.0));
}

#[test]
fn without_acceleration_limit_the_profile_is_a_rectangle() {
    let profile = Profile {
        velocity_rad_s: 0.5,
        acceleration_rad_s2: f64::INFINITY,
    };
    let motion = Trajectory::new(1.0, 0.0, 0.0, profile);
    assert_eq!(motion.duration_s(), 2.0);
    assert_eq!(motion.at(0.5), (0.75, -0.5));
    assert_eq!(motion.at(2.0), (0.0, 0.0));
}

/// Steps into which the laws below cut a motion.
const STEPS: usize = 400;

prop_compose! {
    fn motion()(
        position in -3.0..3.0_f64,
        velocity in -4.0..4.0_f64,
        goal in -3.0..3.0_f64,
        cruise in 0.05..3.0_f64,
        acceleration in 0.2..30.0_f64,
    ) -> (f64, f64, Profile, Trajectory) {
        let profile = Profile { velocity_rad_s: cruise, acceleration_rad_s2: acceleration };
        (position, velocity, profile, Trajectory::new(position, velocity, goal, profile))
    }
}

proptest! {
    #[test]
    fn prop_begins_as_told_and_ends_at_rest_at_the_goal((position, velocity, _, motion) in motion()) {
        let (p, v) = motion.at(0.0);
        prop_assert!((p - position).abs() < 1e-12 && (v - velocity).abs() < 1e-12);
        let end = motion.duration_s();
        let (p, v) = motion.at(end * (1.0 - 1e-12));
        prop_assert!((p - motion.goal()).abs() < 1e-9, "{p} just before the end, goal {}", motion.goal());
        prop_assert!(v.abs() < 1e-8, "{v} rad/s just before the end");
        prop_assert_eq!(motion.at(end), (motion.goal(), 0.0));
        prop_assert_eq!(motion.at(end + 1.0), (motion.goal(), 0.0));
    }

    #[test]
    fn prop_position_and_velocity_are_continuous_within_the_profile((_, velocity, profile, motion) in motion()) {
        let dt = motion.duration_s() / STEPS as f64;
        let fastest = profile.velocity_rad_s.max(velocity.abs());
        let (mut p, mut v) = motion.at(0.0);
        for i in 1..=STEPS {
            let (next_p, next_v) = motion.at(i as f64 * dt);
            prop_assert!(next_v.abs() <= fastest * (1.0 + 1e-12), "step {i}: {next_v} rad/s");
            let change = profile.acceleration_rad_s2 * dt;
            prop_assert!((next_v - v).abs() <= change * (1.0 + 1e-9) + 1e-9, "step {i}: {v} to {next_v} rad/s");
            // The mean of the two speeds, off by what a turn of the acceleration within the step can make.
            let way = (v + next_v) / 2.0 * dt;
            prop_assert!((next_p - p - way).abs() <= change * dt / 2.0 + 1e-9, "step {i}: {p} to {next_p}");
            (p, v) = (next_p, next_v);
        }
    }

    #[test]
    fn prop_above_cruising_speed_it_only_slows_down((_, velocity, profile, motion) in motion()) {
        let dt = motion.duration_s() / STEPS as f64;
        let mut last = velocity.abs();
        for i in 1..=STEPS {
            let speed = motion.at(i as f64 * dt).1.abs();
            prop_assert!(speed <= last.max(profile.velocity_rad_s) * (1.0 + 1e-12));
            last = speed;
        }
    }

    #[test]
    fn prop_from_rest_it_never_leaves_the_way_between(position in -3.0..3.0_f64, goal in -3.0..3.0_f64) {
        let motion = Trajectory::new(position, 0.0, goal, registers(43.0, 9.0));
        let (low, high) = (position.min(goal) - 1e-12, position.max(goal) + 1e-12);
        for i in 0..=STEPS {
            let (p, _) = motion.at(motion.duration_s() * i as f64 / STEPS as f64);
            prop_assert!(low <= p && p <= high, "{p} between {position} and {goal}");
        }
    }

    #[test]
    fn prop_a_motion_taken_up_half_way_goes_on_the_same((_, _, profile, motion) in motion(), share in 0.0..1.0_f64) {
        let now = share * motion.duration_s();
        let (p, v) = motion.at(now);
        let rest = Trajectory::new(p, v, motion.goal(), profile);
        prop_assert!((now + rest.duration_s() - motion.duration_s()).abs() < 1e-6);
        let half = rest.duration_s() / 2.0;
        prop_assert!((rest.at(half).0 - motion.at(now + half).0).abs() < 1e-6);
    }

    #[test]
    fn prop_duration_from_rest_is_that_of_the_trapezoid(way in 0.0..6.0_f64, v in 0.05..3.0_f64, a in 0.2..30.0_f64) {
        let profile = Profile { velocity_rad_s: v, acceleration_rad_s2: a };
        let expected = if way < v * v / a { 2.0 * (way / a).sqrt() } else { way / v + v / a };
        prop_assert!((profile.duration_s(way) - expected).abs() < 1e-9);
        prop_assert!((profile.duration_s(-way) - expected).abs() < 1e-9);
    }
}
