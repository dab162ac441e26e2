//! Captures whose arms do not stop for a reading.

use std::time::Duration;

use capture::{Command, Event, Flag, Outcome, Reading};
use firmware_sim::{Disturbance, Fault};
use rig::dynamixel::register;
use rig::{Device, RigFile};

use crate::bench::{PAPER, SERVOS, Scene, peek};

const SHORT: &str =
    "[[plane]]\ntheta_r_deg = 60\nreadings = 24\n[arc]\nreadings = 16\n[sweep]\nmode = \"fly\"";

fn paper() -> String {
    PAPER.replace("mode = \"step\"", "mode = \"fly\"")
}

/// Seconds of a whole capture.
async fn seconds(scene: &mut Scene) -> f64 {
    let before = scene.bench.now();
    assert_eq!(scene.run(|_| ()).await.expect("it runs"), Outcome::Done);
    (scene.bench.now() - before).as_secs_f64()
}

fn in_flight(scene: &Scene) -> Vec<&Reading> {
    let accepted = scene.journal.accepted();
    accepted
        .into_iter()
        .filter(|reading| reading.lamp && reading.swept_rad.is_some())
        .collect()
}

#[tokio::test(start_paused = true)]
async fn a_flight_is_three_times_as_fast_as_stopping_and_below_40_s() {
    for specimen in ["gold-paint", "chrome", "alum-bronze", "nickel"] {
        let sim = format!("specimen = \"{specimen}\"");
        let stepped_s = seconds(&mut Scene::new(PAPER, &sim).await).await;
        let mut scene = Scene::new(&paper(), &sim).await;
        let flown_s = seconds(&mut scene).await;
        let planned_s = scene.journal.plan().seconds();
        let lit = scene.journal.accepted().iter().filter(|r| r.lamp).count();
        let flown = in_flight(&scene).len();
        println!(
            "{specimen}: stepped {stepped_s:.2} s, flown {flown_s:.2} s (planned {planned_s:.2} s), {:.2} times as fast, \
             {flown} of {lit} readings in flight",
            stepped_s / flown_s
        );
        assert_each_once(&scene);
        scene.assert_safe();
        assert!(flown * 100 > lit * 97, "{flown} of {lit} in flight");
        assert!(
            flown_s < 40.0 && flown_s * 3.0 < stepped_s,
            "{flown_s} s, {stepped_s} s stepped"
        );
        // What will be taken again at rest is not planned.
        assert!(
            (0.95..1.4).contains(&(flown_s / planned_s)),
            "{flown_s} s, planned {planned_s} s"
        );
    }
}

/// Every step has one reading that counts.
pub(crate) fn assert_each_once(scene: &Scene) {
    let mut steps: Vec<usize> = scene.journal.accepted().iter().map(|r| r.step).collect();
    steps.sort_unstable();
    assert_eq!(steps, (0..scene.journal.step_count()).collect::<Vec<_>>());
}

/// Gives commands at times after the start.
fn at(scene: &Scene, commands: &[(u64, Command)]) {
    let (control, commands) = (scene.control.clone(), commands.to_vec());
    let begun = tokio::time::Instant::now();
    tokio::spawn(async move {
        for (ms, command) in commands {
            tokio::time::sleep_until(begun + Duration::from_millis(ms)).await;
            control.send_replace(command);
        }
    });
}

/// The operator stops a capture before, in and between its flights, in every way, and goes on.
#[tokio::test(start_paused = true)]
async fn a_flight_that_is_stopped_is_safe_and_taken_again() {
    let mut torn = 0;
    for command in [Command::Finish, Command::Stop, Command::Estop] {
        for ms in (100..9000).step_by(350) {
            let mut scene = Scene::new(SHORT, "").await;
            at(&scene, &[(ms, command)]);
            let outcome = scene.run(|_| ()).await.unwrap();
            // The arms may still brake.
            tokio::time::sleep(Duration::from_secs(1)).await;
            scene.assert_safe();
            if outcome == Outcome::Done {
                continue;
            }
            assert_eq!(
                matches!(outcome, Outcome::Failed { .. }),
                command == Command::Estop,
                "{outcome:?}"
            );
            torn += scene
                .journal
                .readings()
                .iter()
                .filter(|r| r.flags.contains(&Flag::Blurred))
                .count();
            let kept = scene.journal.readings().len();
            let all = scene.journal.accepted().len() == scene.journal.step_count();
            scene.control.send_replace(Command::Run);
            assert_eq!(
                scene.run(|_| ()).await.unwrap(),
                Outcome::Done,
                "{command:?} after {ms} ms"
            );
            assert!(all || scene.journal.readings().len() > kept);
            assert_each_once(&scene);
            scene.assert_safe();
        }
    }
    assert!(torn > 0, "nothing was stopped in flight");
}

#[tokio::test(start_paused = true)]
async fn a_flight_that_is_held_brakes_and_is_flown_again() {
    for ms in (100..8000).step_by(450) {
        let mut scene = Scene::new(SHORT, "").await;
        at(&scene, &[(ms, Command::Pause), (ms + 5000, Command::Run)]);
        let (bench, mut at_rest) = (scene.bench.clone(), true);
        let outcome = scene.run(|event| {
            let held = matches!(
                event,
                capture::Event::State {
                    state: capture::State::Paused
                }
            );
            at_rest &= !held
                || SERVOS
                    .iter()
                    .all(|&servo| peek(&bench, servo, register::servo::MOVING) == 0);
        });
        assert_eq!(outcome.await.unwrap(), Outcome::Done);
        assert!(at_rest, "an arm moved when it was said to be held, {ms} ms");
        assert_each_once(&scene);
        scene.assert_safe();
    }
}

#[tokio::test(start_paused = true)]
async fn an_arm_that_is_stuck_in_flight_is_a_fault_and_no_reading_counts() {
    let mut scene = Scene::new(SHORT, "").await;
    scene.bench.schedule(Fault {
        device: Device::Light,
        at: IN_THE_AIR,
        what: Disturbance::Stall(Duration::from_secs(3)),
    });
    let outcome = scene.run(|_| ()).await.unwrap();
    assert!(
        matches!(&outcome, Outcome::Failed { fault } if fault.contains("light arm stands at")),
        "{outcome:?}"
    );
    tokio::time::sleep(Duration::from_secs(4)).await;
    scene.assert_safe();
    assert!(in_flight(&scene).is_empty());
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_each_once(&scene);
}

/// The first pass is in the air from 1.4 s to 3 s.
const IN_THE_AIR: Duration = Duration::from_millis(2000);

#[tokio::test(start_paused = true)]
async fn what_suspends_a_run_holds_it_in_flight() {
    let file = RigFile::parse("[suspend]\nevery_s = 0.2", "test.toml".as_ref()).unwrap();
    let mut scene = Scene::on(file, SHORT).await;
    scene.bench.schedule(Fault {
        device: Device::Sensor,
        at: IN_THE_AIR,
        what: Disturbance::Sag(Duration::from_secs(30)),
    });
    let bench = scene.bench.clone();
    let (mut held, mut at_rest) = (Vec::new(), true);
    let outcome = scene.run(|event| {
        if let Event::Suspended { why } = event {
            assert!(why.contains("sensor servo is 10.0 V"), "{why}");
            held.push(bench.now());
            at_rest &= SERVOS
                .iter()
                .all(|&servo| peek(&bench, servo, register::servo::MOVING) == 0);
        }
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Done);
    // A look every 0.2 s, and braking from 60 degrees/s at 200 degrees/s².
    let soon = IN_THE_AIR..IN_THE_AIR + Duration::from_millis(700);
    assert!(held.len() == 1 && soon.contains(&held[0]), "{held:?}");
    assert!(at_rest, "an arm moved when the run was said to be suspended");
    assert_each_once(&scene);
    scene.assert_safe();
}

#[tokio::test(start_paused = true)]
async fn a_lamp_that_goes_out_in_flight_is_a_fault_and_no_dark_reading_counts() {
    let mut scene = Scene::new(SHORT, "").await;
    let bench = scene.bench.clone();
    tokio::spawn(async move {
        tokio::time::sleep(IN_THE_AIR).await;
        bench.poke(Device::Photometer, register::photometer::LAMP_ENABLE, 0)
    });
    let outcome = scene.run(|_| ()).await.unwrap();
    assert!(
        matches!(&outcome, Outcome::Failed { fault } if fault.contains("the lamp is out")),
        "{outcome:?}"
    );
    tokio::time::sleep(Duration::from_secs(1)).await;
    scene.assert_safe();
    let lit = |reading: &&Reading| reading.counts.monitor * 5 > reading.counts.exposure.integration_us;
    assert!(in_flight(&scene).iter().all(lit), "a dark reading counts");
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_each_once(&scene);
    assert!(in_flight(&scene).iter().all(lit), "a dark reading counts");
}

/// Between two readings of a mirror lie all gains of the photometer.
#[tokio::test(start_paused = true)]
async fn what_saturates_in_flight_is_taken_again_at_rest() {
    let mut scene = Scene::new(SHORT, "specimen = \"mirror:0.9\"").await;
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_each_once(&scene);
    let accepted = scene.journal.accepted();
    // Arms that tremble at the edge of a mirror see it and do not; the last of all exposures counts as it is.
    const LAST: u32 = 8;
    let full = |r: &&&Reading| r.counts.saturated && r.attempt < LAST;
    let counting: Vec<_> = accepted.iter().filter(full).collect();
    assert!(counting.is_empty(), "{counting:?}");
    let readings = scene.journal.readings();
    let full = |r: &&&Reading| r.swept_rad.is_some() && r.counts.saturated;
    let full: Vec<_> = readings.iter().filter(full).collect();
    assert!(!full.is_empty(), "nothing saturated in flight");
    for reading in full {
        let counts = accepted.iter().find(|r| r.step == reading.step);
        assert!(counts.is_some_and(|r| r.swept_rad.is_none()), "{reading:?}");
    }
}

/// Standard deviation of a reading's brightest channel, relative to it, by what the rig file knows of the photometer.
fn noise_rel(scene: &Scene, of: &Reading) -> f64 {
    let brightest = |reading: &Reading| f64::from(reading.counts.rgb.into_iter().fold(0, u32::max));
    let exposure = of.counts.exposure;
    let accepted = scene.journal.accepted();
    let alike = accepted
        .iter()
        .filter(|dark| !dark.lamp && dark.counts.exposure.gain == exposure.gain);
    let dark = alike.min_by_key(|dark| {
        dark.counts
            .exposure
            .integration_us
            .abs_diff(exposure.integration_us)
    });
    let net = (brightest(of) - brightest(dark.expect("each gain has dark readings"))).max(1.0);
    let known = &scene.drive.file().uncertainty;
    known.variance(net, exposure.gain.factor()).sqrt() / net
}

/// Where poses are far apart, the flank of a lobe lies between two of them, and the arms fly on with the exposure that was
/// right for its peak.
#[tokio::test(start_paused = true)]
async fn what_is_far_too_faint_in_flight_is_taken_again_at_rest() {
    const FEW: &str =
        "[[plane]]\ntheta_r_deg = 60\nreadings = 8\n[arc]\nreadings = 6\n[sweep]\nmode = \"fly\"";
    for specimen in ["chrome", "nickel"] {
        let mut scene = Scene::new(FEW, &format!("specimen = \"{specimen}\"")).await;
        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        assert_each_once(&scene);
        let accepted = scene.journal.accepted();
        let readings = scene.journal.readings();
        let faint = readings.iter().filter(|reading| {
            let flawed = reading.counts.saturated || reading.flags.contains(&Flag::Blurred);
            reading.swept_rad.is_some() && !reading.accepted && !flawed
        });
        let allowed_rel = scene.drive.file().photometer.flight_noise_rel;
        let mut again = 0;
        for reading in faint {
            let kept = accepted.iter().find(|kept| kept.step == reading.step);
            let kept = kept.expect("every step has a reading that counts");
            let [noise, left] = [reading, kept].map(|reading| noise_rel(&scene, reading));
            println!(
                "{specimen}, step {}: noise {noise:.4}, at rest {left:.4}",
                reading.step
            );
            assert_eq!(kept.swept_rad, None, "{kept:?}");
            assert!(
                noise > 4.0 * allowed_rel,
                "{noise} was not too faint: {reading:?}"
            );
            assert!(left < noise / 2.0, "{noise} became {left}: {kept:?}");
            again += 1;
        }
        assert!(again > 0, "{specimen}: nothing was too faint in flight");
    }
}

/// Chrome is some ten thousand times as bright where its arc begins as where its plane does; the plane says so.
#[tokio::test(start_paused = true)]
async fn the_first_of_a_run_alone_is_ranged_at_rest() {
    let mut scene = Scene::new(SHORT, "specimen = \"chrome\"").await;
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    let accepted = scene.journal.accepted();
    let first = accepted.iter().find(|r| r.lamp).expect("it was measured");
    assert_eq!(first.swept_rad, None, "{} begins in flight", first.sweep);
    assert!(first.flags.is_empty(), "it begins with {:?}", first.flags);
    let ranged = |r: &&&Reading| r.lamp && r.swept_rad.is_none() && r.sweep != first.sweep && r.attempt == 0;
    assert_eq!(
        accepted.iter().filter(ranged).count(),
        0,
        "a later sweep begins at rest"
    );
    let refused = |r: &&&Reading| !r.accepted && r.swept_rad.is_some();
    let refused = scene.journal.readings().iter().filter(refused).count();
    assert!(refused <= 1, "{refused} readings in flight that do not count");
}

/// Watchdogs that trip after 100 ms hear enough of a flight.
#[tokio::test(start_paused = true)]
async fn watchdogs_stay_armed_in_flight() {
    let file = RigFile::parse("[motion]\nwatchdog_ms = 100", "test.toml".as_ref()).unwrap();
    let mut scene = Scene::on(file, SHORT).await;
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_each_once(&scene);
    assert!(!in_flight(&scene).is_empty());
}
