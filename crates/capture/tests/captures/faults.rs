use std::time::Duration;

use capture::{Event, Outcome, Record};
use firmware_sim::{Disturbance, Fault};
use rig::dynamixel::register::{common, servo};
use rig::{Device, FaultKind, RigFile};

use crate::bench::{SERVOS, SHORT, Scene, assert_complete, peek};

/// Lets something go wrong in the middle of the capture, and returns how it ended and how long after.
async fn disturb(scene: &mut Scene, device: Device, what: Disturbance) -> (Outcome, Duration) {
    let bench = scene.bench.clone();
    let mut readings = 0;
    let mut at = Duration::ZERO;
    let outcome = scene.run(|event| {
        if matches!(event, Event::Reading { .. }) {
            readings += 1;
            if readings == 34 {
                // Arms are on their way by then.
                at = bench.now() + Duration::from_millis(30);
                bench.schedule(Fault { device, at, what });
            }
        }
    });
    let outcome = outcome.await.expect("the journal is sound");
    (outcome, scene.bench.now() - at)
}

fn fault(outcome: Outcome) -> String {
    match outcome {
        Outcome::Failed { fault } => fault,
        other => panic!("{other:?}"),
    }
}

#[tokio::test(start_paused = true)]
async fn a_servo_that_falls_silent_ends_the_run_within_two_seconds() {
    for device in SERVOS {
        let mut scene = Scene::new(SHORT, "").await;
        let (outcome, took) =
            disturb(&mut scene, device, Disturbance::Silence(Duration::from_secs(30))).await;
        assert!(took < Duration::from_secs(2), "{device}: {took:?}");
        assert!(fault(outcome).contains(&device.to_string()), "{device}");
        assert!(!scene.lamp_is_on());
        let kept = scene.journal.accepted().len();
        assert!(kept >= 33, "{kept} readings kept");
        assert!(matches!(
            scene.journal.records.last(),
            Some(Record::End {
                outcome: Outcome::Failed { .. },
                ..
            })
        ));
        for other in SERVOS.into_iter().filter(|&other| other != device) {
            assert_eq!(
                peek(&scene.bench, other, servo::MOVING),
                0,
                "{other} moves after {device} fell silent"
            );
        }

        tokio::time::sleep(Duration::from_secs(31)).await;
        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        assert_complete(&scene.journal);
        scene.assert_safe();
    }
}

#[tokio::test(start_paused = true)]
async fn a_photometer_that_falls_silent_ends_the_run_within_two_seconds() {
    let mut scene = Scene::new(SHORT, "").await;
    let (outcome, took) = disturb(
        &mut scene,
        Device::Photometer,
        Disturbance::Silence(Duration::from_secs(30)),
    )
    .await;
    assert!(took < Duration::from_secs(2), "{took:?}");
    assert!(fault(outcome).contains("photometer"));
    for device in SERVOS {
        assert_eq!(peek(&scene.bench, device, servo::MOVING), 0, "{device}");
    }
    // It hears nothing, so its own watchdog is what puts the lamp out.
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert!(!scene.lamp_is_on());
    tokio::time::sleep(Duration::from_secs(31)).await;
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
}

#[tokio::test(start_paused = true)]
async fn a_servo_that_trips_overload_ends_the_run_and_is_resumed_after_a_restart() {
    for device in SERVOS {
        let mut scene = Scene::new(SHORT, "").await;
        let (outcome, took) = disturb(&mut scene, device, Disturbance::OVERLOAD).await;
        assert!(took < Duration::from_secs(2), "{device}: {took:?}");
        let fault = fault(outcome);
        assert!(fault.contains("overload"), "{fault}");
        assert!(!scene.lamp_is_on());
        for other in SERVOS.into_iter().filter(|&other| other != device) {
            assert_eq!(peek(&scene.bench, other, servo::MOVING), 0, "{other}");
        }
        scene.bench.reboot(device);
        tokio::time::sleep(Duration::from_secs(2)).await;
        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        assert_complete(&scene.journal);
        scene.assert_safe();
    }
}

#[tokio::test(start_paused = true)]
async fn a_stalled_arm_ends_the_run() {
    let mut scene = Scene::new(SHORT, "").await;
    let (outcome, took) = disturb(
        &mut scene,
        Device::Light,
        Disturbance::Stall(Duration::from_secs(30)),
    )
    .await;
    assert!(took < Duration::from_secs(3), "{took:?}");
    let fault = fault(outcome);
    assert!(fault.starts_with("light arm stands at"), "{fault}");
    assert!(!scene.lamp_is_on());
}

#[tokio::test(start_paused = true)]
async fn a_short_silence_is_retried_counted_and_flagged() {
    let mut scene = Scene::new(SHORT, "").await;
    let (outcome, _) = disturb(
        &mut scene,
        Device::Light,
        Disturbance::Silence(Duration::from_millis(100)),
    )
    .await;
    assert_eq!(outcome, Outcome::Done);
    assert_complete(&scene.journal);
    let retried: Vec<_> = scene
        .journal
        .readings()
        .into_iter()
        .filter(|reading| reading.retries > 0)
        .collect();
    assert!(!retried.is_empty());
    assert!(
        retried
            .iter()
            .all(|reading| reading.flags.contains(&capture::Flag::Retried))
    );
    let sum: u32 = retried.iter().map(|reading| reading.retries).sum();
    assert_eq!(sum, scene.drive.retries(), "every retry belongs to a reading");
}

#[tokio::test(start_paused = true)]
async fn a_lost_acknowledgement_exposes_once() {
    let mut scene = Scene::new(SHORT, "").await;
    let (outcome, _) = disturb(&mut scene, Device::Photometer, Disturbance::LostAcknowledgement).await;
    assert_eq!(outcome, Outcome::Done);
    assert_complete(&scene.journal);
    let sequences: Vec<u32> = scene
        .journal
        .readings()
        .iter()
        .map(|reading| reading.counts.sequence)
        .collect();
    assert!(
        sequences.windows(2).all(|pair| pair[1] == pair[0] + 1),
        "{sequences:?}"
    );
}

#[tokio::test(start_paused = true)]
async fn nothing_moves_or_lights_up_while_a_device_is_not_as_the_rig_file_says() {
    let silent = Disturbance::Silence(Duration::from_secs(60));
    for device in [Device::Light, Device::Sensor, Device::Photometer] {
        let mut scene = Scene::new(SHORT, "").await;
        let pose = scene.bench.pose();
        scene.bench.schedule(Fault {
            device,
            at: Duration::ZERO,
            what: silent,
        });
        let fault = fault(scene.run(|_| ()).await.unwrap());
        assert!(fault.contains(&device.to_string()), "{fault}");
        assert_eq!(scene.bench.pose(), pose);
        assert!(!scene.lamp_is_on());
        for device in SERVOS {
            assert_eq!(
                peek(&scene.bench, device, servo::TORQUE_ENABLE),
                0,
                "{device} was not even engaged"
            );
        }
        assert!(scene.journal.readings().is_empty());
    }
}

#[tokio::test(start_paused = true)]
async fn another_operating_mode_is_told_before_anything_moves() {
    let file = RigFile::parse("", "test.toml".as_ref()).unwrap();
    let mut scene = Scene::on(file, SHORT).await;
    scene
        .bench
        .poke(Device::Sensor, servo::OPERATING_MODE, 4)
        .unwrap();
    let pose = scene.bench.pose();
    let fault = fault(scene.run(|_| ()).await.unwrap());
    assert!(fault.contains("Operating Mode is 4"), "{fault}");
    assert_eq!(scene.bench.pose(), pose);
}

/// A watchdog that trips although the host is alive, here the shortest one, must not pass for an arrival.
#[tokio::test(start_paused = true)]
async fn a_tripped_watchdog_is_a_fault_and_is_cleared_on_resuming() {
    let mut scene = Scene::new(SHORT, "").await;
    let bench = scene.bench.clone();
    let mut readings = 0;
    let outcome = scene.run(|event| {
        if matches!(event, Event::Reading { .. }) {
            readings += 1;
            if readings == 34 {
                bench.poke(Device::Light, common::BUS_WATCHDOG, 1).unwrap();
            }
        }
    });
    let fault = fault(outcome.await.unwrap());
    assert!(fault.contains("watchdog"), "{fault}");
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
}

#[tokio::test(start_paused = true)]
async fn a_computer_that_slept_is_no_failed_device_and_the_run_can_be_resumed() {
    // In the dark readings, in the plane and in the arc.
    for after in [2, 12, 34] {
        let mut scene = Scene::new(SHORT, "").await;
        let (mut readings, mut kinds) = (0, Vec::new());
        let outcome = scene.run(|event| match event {
            Event::Reading { .. } => {
                readings += 1;
                if readings == after {
                    // Nobody speaks to the devices meanwhile, as while a computer sleeps.
                    tokio::spawn(tokio::time::advance(Duration::from_secs(5)));
                }
            }
            Event::Fault { kind, device, .. } => kinds.push((kind, device)),
            _ => {}
        });
        let fault = fault(outcome.await.expect("the journal is sound"));
        assert!(
            fault.starts_with("this computer or program stood still for 5."),
            "{after}: {fault}"
        );
        assert_eq!(kinds, [(FaultKind::StoodStill, None)], "{after}");
        scene.assert_safe();

        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        assert_complete(&scene.journal);
        scene.assert_safe();
    }
}
