//! How long a capture takes beside what the mechanics and the light demand.

use arms::{Pose, Profile};
use capture::{Outcome, Reading};
use rig::RigFile;
use rig::dynamixel::register::servo;
use sweep::{Mechanics, Sweep};

use crate::bench::{PAPER, SERVOS, SHORT, Scene, assert_complete, peek};

/// Units of the profile registers in degrees/s and degrees/s²: 0.229 rev/min and 214.577 rev/min² (e-manual, "Profile
/// Velocity(112)", "Profile Acceleration(108)").
const VELOCITY_UNIT_DEG_S: f64 = 0.229 * 360.0 / 60.0;
const ACCELERATION_UNIT_DEG_S2: f64 = 214.577 * 360.0 / 3600.0;

/// The least that the readings of a capture take, by the profiles that the servos had in the end.
fn floor_s(scene: &Scene, from: Pose) -> f64 {
    let profiles = SERVOS.map(|device| {
        let velocity = peek(&scene.bench, device, servo::PROFILE_VELOCITY) as f64;
        let acceleration = peek(&scene.bench, device, servo::PROFILE_ACCELERATION) as f64;
        Profile {
            velocity_rad_s: (velocity * VELOCITY_UNIT_DEG_S).to_radians(),
            acceleration_rad_s2: (acceleration * ACCELERATION_UNIT_DEG_S2).to_radians(),
        }
    });
    let mechanics = Mechanics {
        profiles,
        ..capture::mechanics(scene.drive.file(), None)
    };
    let accepted = scene.journal.accepted();
    let readings = accepted
        .iter()
        .map(|reading| (reading.goal, reading.counts.exposure.duration().as_secs_f64()));
    sweep::floor_s(&mechanics, Some(from), readings)
}

fn of(readings: &[&Reading], sweep: Sweep) -> usize {
    readings.iter().filter(|reading| reading.sweep == sweep).count()
}

#[tokio::test(start_paused = true)]
async fn a_full_capture_takes_hardly_longer_than_its_motion_settling_and_light() {
    for specimen in ["gold-paint", "chrome", "alum-bronze"] {
        let mut scene = Scene::new(PAPER, &format!("specimen = \"{specimen}\"")).await;
        let start = scene.bench.pose();
        let before = scene.bench.now();
        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        let taken_s = (scene.bench.now() - before).as_secs_f64();
        let floor_s = floor_s(&scene, start);
        println!(
            "{specimen}: floor {floor_s:.2} s, taken {taken_s:.2} s, {:.3} of it",
            taken_s / floor_s
        );
        let readings = scene.journal.accepted();
        assert!(of(&readings, Sweep::Plane(0)) > 80 && of(&readings, Sweep::Arc) > 80);
        assert!(
            taken_s > 0.999 * floor_s,
            "{specimen}: faster than its floor of {floor_s} s"
        );
        assert!(
            taken_s < 1.15 * floor_s,
            "{specimen}: floor {floor_s} s, taken {taken_s} s"
        );
    }
}

/// The least and the most that a servo's profile registers hold within its velocity limit, in all four pairs: what is
/// measured does not depend on how the arms came there, and the plan knows how long they take.
#[tokio::test(start_paused = true)]
async fn very_slow_and_very_fast_arms_measure_the_same_in_the_time_that_was_planned() {
    let mut first: Option<Vec<[u32; 3]>> = None;
    for velocity in [1.4, 270.0] {
        for acceleration in [21.5, 100_000.0] {
            let arm = format!("velocity_deg_s = {velocity}\nacceleration_deg_s2 = {acceleration}\n");
            let text = format!(
                "[motion]\nlate_ms = 0\n[light]\n{arm}[sensor]\n{arm}[sim]\nimperfections = \"none\""
            );
            let file = RigFile::parse(&text, "test.toml".as_ref()).expect("a good rig file");
            let mut scene = Scene::on(file, SHORT).await;
            let before = scene.bench.now();
            assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
            assert_complete(&scene.journal);
            scene.assert_safe();
            let taken_s = (scene.bench.now() - before).as_secs_f64();
            let planned_s = scene.journal.plan().seconds();
            println!("{velocity}°/s, {acceleration}°/s²: planned {planned_s:.2} s, taken {taken_s:.2} s");
            assert!(
                (taken_s / planned_s - 1.0).abs() < 0.1,
                "{velocity}°/s, {acceleration}°/s²"
            );
            let rgb: Vec<[u32; 3]> = scene.journal.accepted().iter().map(|r| r.counts.rgb).collect();
            assert_eq!(
                *first.get_or_insert(rgb.clone()),
                rgb,
                "{velocity}°/s, {acceleration}°/s²"
            );
        }
    }
}
