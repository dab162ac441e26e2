//! Flights of both arms at once: what they measure, and that the arms never meet, whatever stops.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use arms::{Arm, Pose};
use capture::Outcome;
use firmware_sim::{Disturbance, Fault};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::RigFile;
use rig::dynamixel::register::servo;

use crate::bench::{SERVOS, Scene, peek};
use crate::fly::assert_each_once;

const SNAKE: &str = "[snake]\nlegs = 6\n[sweep]\nmode = \"fly\"";
/// The first two legs alone: those along which one arm follows the other closely.
const CLOSE: &str = "[[leg]]\nhalf_deg = [-3.0, 70.0]\ndifference_deg = [5.0, 15.0]\n\
                     [[leg]]\nhalf_deg = [70.0, -3.0]\ndifference_deg = [15.0, 30.0]\n[sweep]\nmode = \"fly\"";

/// Lag up to which arms arrive at a pose in the time that they have, ms.
const LATEST_MS: u64 = 150;

/// Looks at the arms every 2 ms, as long as the test runs; holds how near they came, rad.
fn nearest(scene: &Scene) -> Arc<Mutex<f64>> {
    let nearest = Arc::new(Mutex::new(f64::INFINITY));
    let (bench, file, least) = (scene.bench.clone(), scene.drive.file().clone(), nearest.clone());
    tokio::spawn(async move {
        loop {
            let pose = Arm::BOTH.into_iter().fold(Pose::default(), |pose, arm| {
                let counts = peek(&bench, SERVOS[arm as usize], servo::PRESENT_POSITION);
                pose.with(arm, file.arm(arm).axis.angle(counts as f64))
            });
            {
                let mut least = least.lock().expect("nobody panics with it");
                *least = least.min(pose.sensor - pose.light);
            }
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    });
    nearest
}

fn assert_apart(scene: &Scene, nearest: &Mutex<f64>, what: &str) {
    let file = scene.drive.file();
    let count_rad = file.arms[0].axis.resolution_rad();
    let least = *nearest.lock().expect("nobody panics with it");
    assert!(
        least >= file.envelope.separation_rad - count_rad,
        "{what}: the arms came within {:.2}°, allowed are {:.2}°",
        least.to_degrees(),
        file.envelope.separation_rad.to_degrees()
    );
}

#[tokio::test(start_paused = true)]
async fn a_snake_is_flown_with_both_arms_in_the_time_that_is_planned() {
    for specimen in ["gold-paint", "nickel", "blue-rubber"] {
        let mut scene = Scene::new(SNAKE, &format!("specimen = \"{specimen}\"")).await;
        let near = nearest(&scene);
        let begun = scene.bench.now();
        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        let seconds = (scene.bench.now() - begun).as_secs_f64();
        let planned = scene.journal.plan().seconds();
        assert_each_once(&scene);
        scene.assert_safe();
        assert_apart(&scene, &near, specimen);
        let accepted = scene.journal.accepted();
        let lit = accepted.iter().filter(|r| r.lamp).count();
        let flown = accepted.iter().filter(|r| r.swept_rad.is_some()).count();
        println!("{specimen}: {seconds:.1} s, planned {planned:.1} s, {flown} of {lit} in flight");
        assert!(flown * 100 >= lit * 98, "{specimen}: {flown} of {lit} in flight");
        assert!(
            (0.8..1.3).contains(&(seconds / planned)),
            "{specimen}: {seconds} s, planned {planned} s"
        );
        // Both arms move within an integration.
        let both = |r: &&&capture::Reading| r.swept_rad.is_some_and(|by| by[0] != 0.0 && by[1] != 0.0);
        assert!(accepted.iter().filter(both).count() * 10 > 9 * lit);
    }
}

/// Whatever stops or falls silent, at any moment: the arms stay apart, and the run ends true or with a fault that says so, and
/// goes on.
///
/// `LEG_FLIGHTS` flights (12 in the tests, 10,000 by `just trials legs`) from the seed `LEG_SEED`.
#[tokio::test(start_paused = true)]
async fn arms_that_fly_together_never_meet_whatever_stops() {
    let of = |name: &str, usual: u64| std::env::var(name).map_or(usual, |n| n.parse().expect("a number"));
    let (flights, first) = (of("LEG_FLIGHTS", 12), of("LEG_SEED", 1));
    let mut faults = 0;
    for seed in first..first + flights {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut below = |n: u64| random.random_range(0..n);
        let device = SERVOS[below(2) as usize];
        let at = Duration::from_millis(1000 + below(6000));
        let lag_ms = below(301);
        let for_ms = Duration::from_millis(100 + below(3000));
        let what = match below(5) {
            0 | 1 => Some(Disturbance::Stall(for_ms)),
            2 => Some(Disturbance::Silence(for_ms)),
            3 => Some(Disturbance::OVERLOAD),
            _ => None,
        };
        let pause = below(3) == 0;
        let about = format!(
            "seed {seed}: {what:?} of {device} at {at:?}, lag {lag_ms} ms, the host {} there",
            if pause { "stops" } else { "goes on" }
        );
        let text = format!("[sim]\nspecimen = \"gold-paint\"\nfollowing_lag_ms = {lag_ms}\nseed = {seed}");
        let file = RigFile::parse(&text, "test.toml".as_ref()).expect("a good rig file");
        let mut scene = Scene::on(file, CLOSE).await;
        let near = nearest(&scene);
        if let Some(what) = what {
            scene.bench.schedule(Fault { device, at, what });
        }
        let outcome = {
            let run = scene.run(|_| ());
            tokio::pin!(run);
            // A host that stops in the midst of a flight tells nobody anything for as long as it likes.
            match pause {
                true => match tokio::time::timeout(at, &mut run).await {
                    Ok(outcome) => outcome,
                    Err(_) => {
                        tokio::time::sleep(for_ms).await;
                        run.await
                    }
                },
                false => run.await,
            }
        };
        let outcome = outcome.unwrap_or_else(|error| panic!("{about}: {error}"));
        tokio::time::sleep(Duration::from_secs(4)).await;
        assert_apart(&scene, &near, &about);
        assert!(!scene.lamp_is_on(), "{about}: the lamp is on");
        if let Outcome::Failed { fault } = &outcome {
            assert!(!fault.is_empty(), "{about}: a fault that says nothing");
            faults += 1;
            for device in SERVOS {
                scene.bench.reboot(device);
            }
            // A device that restarts is deaf for a while.
            tokio::time::sleep(Duration::from_secs(2)).await;
            let again = scene
                .run(|_| ())
                .await
                .unwrap_or_else(|error| panic!("{about}: {error}"));
            // Arms that are later than a motion to a pose allows do not arrive, and say so.
            if let Outcome::Failed { fault } = &again {
                assert!(lag_ms > LATEST_MS, "{about}: does not go on: {fault}");
                assert_apart(&scene, &near, &about);
                continue;
            }
        }
        assert_each_once(&scene);
        assert_apart(&scene, &near, &about);
    }
    assert!(faults > 0, "nothing ever stopped a flight");
}

/// Unplugged in the midst of a leg: nobody tells the servos anything any more.
#[tokio::test(start_paused = true)]
async fn arms_that_nobody_leads_any_more_come_to_rest_apart() {
    for ms in (1500..5500).step_by(200) {
        let mut scene = Scene::new(CLOSE, "").await;
        let near = nearest(&scene);
        {
            let run = scene.run(|_| ());
            tokio::pin!(run);
            let cut = tokio::time::timeout(Duration::from_millis(ms), &mut run).await;
            assert!(cut.is_err(), "the run was over before it was cut at {ms} ms");
        }
        tokio::time::sleep(Duration::from_secs(5)).await;
        assert_apart(&scene, &near, &format!("cut at {ms} ms"));
        let moving = |device: &rig::Device| peek(&scene.bench, *device, servo::MOVING) != 0;
        assert!(!SERVOS.iter().any(moving), "an arm still moves, cut at {ms} ms");
    }
}
