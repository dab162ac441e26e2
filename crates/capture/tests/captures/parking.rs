//! Arms that go clear of the stage after a run, and only then.

use std::time::Duration;

use arms::Pose;
use capture::{Command, Event, Outcome, Record, State};
use firmware_sim::{Disturbance, Fault};
use rig::Device;

use crate::bench::{SHORT, Scene};

const PARKS: &str = "specimen = \"white-paint\"\n[motion]\npark_between = true\n";
const PARKING: Event = Event::State {
    state: State::Parking,
};

/// Whether the arms stand where the rig file parks them, as near as it asks for.
fn is_parked(scene: &Scene) -> bool {
    let [park, pose] = [scene.drive.file().motion.park, scene.bench.pose()];
    let near_deg = scene.drive.file().motion.near_rad.to_degrees() + 0.2;
    let off = |pose: Pose| [pose.light - park.light, pose.sensor - park.sensor];
    off(pose).iter().all(|by| by.abs().to_degrees() < near_deg)
}

fn ticks_at_the_end(scene: &Scene) -> u64 {
    match scene.journal.records.last() {
        Some(Record::End { device_ticks, .. }) => device_ticks.expect("it shut down well"),
        other => panic!("{other:?} is no end"),
    }
}

#[tokio::test(start_paused = true)]
async fn after_a_run_that_is_done_the_arms_park_and_it_costs_no_seconds_of_the_run() {
    let mut ticks = Vec::new();
    for (sim, parks) in [("specimen = \"white-paint\"", false), (PARKS, true)] {
        let mut scene = Scene::new(SHORT, sim).await;
        let mut parking = false;
        let outcome = scene.run(|event| parking |= event == PARKING).await.unwrap();
        assert_eq!(outcome, Outcome::Done);
        assert_eq!([parking, is_parked(&scene)], [parks; 2]);
        scene.assert_safe();
        ticks.push(ticks_at_the_end(&scene));
    }
    assert_eq!(ticks[0], ticks[1], "the way counts for no run");
}

#[tokio::test(start_paused = true)]
async fn after_a_stop_a_finish_or_an_emergency_stop_nothing_parks() {
    for command in [Command::Finish, Command::Stop, Command::Estop] {
        let mut scene = Scene::new(SHORT, PARKS).await;
        let control = scene.control.clone();
        let (mut readings, mut parking) = (0, false);
        let outcome = scene.run(|event| {
            readings += usize::from(matches!(event, Event::Reading { .. }));
            if readings == 32 {
                control.send_replace(command);
            }
            parking |= event == PARKING;
        });
        assert_ne!(outcome.await.unwrap(), Outcome::Done, "{command:?}");
        assert!(!parking && !is_parked(&scene), "{command:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn whatever_is_asked_for_on_the_way_to_park_holds_the_arms_and_the_run_is_done() {
    for command in [Command::Pause, Command::Finish, Command::Stop, Command::Estop] {
        let mut scene = Scene::new(SHORT, PARKS).await;
        let control = scene.control.clone();
        let outcome = scene.run(|event| {
            if event == PARKING {
                let control = control.clone();
                tokio::spawn(async move {
                    tokio::time::sleep(Duration::from_millis(250)).await;
                    control.send_replace(command);
                });
            }
        });
        assert_eq!(outcome.await.unwrap(), Outcome::Done, "{command:?}");
        assert!(!is_parked(&scene), "{command:?} came too late to try anything");
        // They brake on their profiles, and the last counts take a while.
        tokio::time::sleep(Duration::from_secs(1)).await;
        scene.assert_safe();
    }
}

#[tokio::test(start_paused = true)]
async fn what_was_asked_for_before_the_arms_set_off_to_park_leaves_them_where_they_are() {
    let mut scene = Scene::new(SHORT, PARKS).await;
    let control = scene.control.clone();
    let mut pose = None;
    let bench = scene.bench.clone();
    let outcome = scene.run(|event| {
        if event == PARKING {
            pose = Some(bench.pose());
            control.send_replace(Command::Stop);
        }
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Done);
    let (before, now) = (pose.expect("it was about to park"), scene.bench.pose());
    assert!(
        (before.light - now.light).abs().to_degrees() < 0.2,
        "{before:?}, {now:?}"
    );
    assert!(
        (before.sensor - now.sensor).abs().to_degrees() < 0.2,
        "{before:?}, {now:?}"
    );
}

#[tokio::test(start_paused = true)]
async fn an_arm_that_is_held_fast_on_the_way_to_park_is_a_fault_of_a_run_that_is_done() {
    let mut scene = Scene::new(SHORT, PARKS).await;
    let bench = scene.bench.clone();
    let mut told = None;
    let outcome = scene.run(|event| match event {
        event if event == PARKING => {
            bench.schedule(Fault {
                device: Device::Light,
                at: bench.now(),
                what: Disturbance::Stall(Duration::from_secs(30)),
            });
        }
        Event::Fault { fault, .. } => told = Some(fault),
        _ => {}
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Done);
    let told = told.expect("the light arm was held fast");
    assert!(
        told.starts_with("while parking the arms after the run: light arm"),
        "{told}"
    );
    assert!(matches!(
        scene.journal.records.last(),
        Some(Record::End {
            outcome: Outcome::Done,
            ..
        })
    ));
}
