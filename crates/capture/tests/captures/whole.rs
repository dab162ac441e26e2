use capture::{Event, Flag, Outcome, Record};
use rig::dynamixel::register::servo;
use rig::{Device, RigFile};
use sweep::Sweep;

use crate::bench::{PAPER, SERVOS, SHORT, Scene, assert_complete, peek};

#[tokio::test(start_paused = true)]
async fn a_capture_reads_every_step_once_and_leaves_the_rig_safe() {
    let mut scene = Scene::new(PAPER, "specimen = \"gold-paint\"").await;
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
    scene.assert_safe();
    let first = &scene.journal.records[1];
    assert!(
        matches!(first, Record::Begin { identities, .. } if identities.len() == 3),
        "{first:?}"
    );
    let last = scene.journal.records.last().unwrap();
    assert!(
        matches!(
            last,
            Record::End {
                outcome: Outcome::Done,
                device_ticks: Some(_),
                ..
            }
        ),
        "{last:?}"
    );
}

#[tokio::test(start_paused = true)]
async fn a_capture_takes_the_time_that_was_planned() {
    for (specimen, tolerance) in [
        ("gold-paint", 0.05),
        ("blue-rubber", 0.05),
        ("white-paint", 0.05),
        ("chrome", 0.05),
    ] {
        let mut scene = Scene::new(PAPER, &format!("specimen = \"{specimen}\"")).await;
        let before = scene.bench.now();
        let mut left = Vec::new();
        let bench = scene.bench.clone();
        let outcome = scene.run(|event| {
            if let Event::Progress {
                done,
                of,
                seconds_left,
                ..
            } = event
            {
                left.push((done, of, seconds_left, bench.now()));
            }
        });
        assert_eq!(outcome.await.unwrap(), Outcome::Done);
        let after = scene.bench.now();
        let taken = (after - before).as_secs_f64();
        let planned = scene.journal.plan().seconds();
        println!("{specimen}: planned {planned:.2} s, taken {taken:.2} s");
        assert!(
            (taken / planned - 1.0).abs() < tolerance,
            "{specimen}: planned {planned} s, taken {taken} s"
        );
        for &(done, of, seconds_left, at) in &left {
            let truly_left = (after - at).as_secs_f64();
            // How dark the last readings are, and so how long they take, shows only then.
            let allowed = 0.2 * truly_left + 0.5;
            assert!(
                (seconds_left - truly_left).abs() < allowed,
                "{specimen}: {seconds_left} s said, {truly_left} s left after {done} of {of}"
            );
        }
        let &(done, of, seconds_left, _) = left.last().unwrap();
        assert_eq!(
            (done, of),
            (scene.journal.plan().steps.len(), scene.journal.plan().steps.len())
        );
        assert!(seconds_left.abs() < 1e-6, "{seconds_left} s left at the end");
    }
}

#[tokio::test(start_paused = true)]
async fn a_reading_is_durable_before_the_next_motion_starts() {
    let mut scene = Scene::new(SHORT, "specimen = \"gold-paint\"").await;
    let bench = scene.bench.clone();
    let axes = scene.drive.file().arms.each_ref().map(|arm| arm.axis);
    scene.journal.at_append = Box::new(move |record| {
        if let Record::Reading(reading) = record {
            let goals = [reading.goal.light, reading.goal.sensor];
            for ((device, axis), goal) in SERVOS.into_iter().zip(axes).zip(goals) {
                assert_eq!(
                    peek(&bench, device, servo::GOAL_POSITION),
                    axis.counts(goal).round() as i64
                );
                assert_eq!(
                    peek(&bench, device, servo::MOVING),
                    0,
                    "{device} moves, step {}",
                    reading.step
                );
            }
        }
        Ok(())
    });
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
}

#[tokio::test(start_paused = true)]
async fn arms_are_measured_where_they_were_told_to_be() {
    let mut scene = Scene::new(SHORT, "specimen = \"gold-paint\"").await;
    scene.run(|_| ()).await.unwrap();
    let tolerance = scene.drive.file().motion.near_rad;
    for reading in scene.journal.readings() {
        let off = [
            reading.measured.light - reading.goal.light,
            reading.measured.sensor - reading.goal.sensor,
        ];
        assert!(
            off.iter().all(|rad| rad.abs() <= tolerance),
            "step {}: {off:?} rad off",
            reading.step
        );
    }
}

#[tokio::test(start_paused = true)]
async fn dark_readings_are_dark_and_the_others_are_not() {
    let mut scene = Scene::new(SHORT, "specimen = \"lambert:0.5\"").await;
    scene.run(|_| ()).await.unwrap();
    let monitor_rate = scene.drive.file().calibration.monitor;
    for reading in scene.journal.readings() {
        let per_us = f64::from(reading.counts.monitor) / f64::from(reading.counts.exposure.integration_us);
        assert_eq!(reading.lamp, reading.sweep != Sweep::Dark);
        assert_eq!(
            per_us > 0.5 * monitor_rate,
            reading.lamp,
            "step {}: {per_us} counts/µs",
            reading.step
        );
        if let Some((gain, integration_us)) = scene.journal.plan().steps[reading.step].exposure {
            assert_eq!(
                (
                    reading.counts.exposure.gain as u8,
                    reading.counts.exposure.integration_us
                ),
                (gain, integration_us)
            );
        }
    }
}

/// A mirror is dark but for one direction, where it saturates whatever was seen before.
#[tokio::test(start_paused = true)]
async fn saturated_and_dim_readings_are_exposed_again() {
    let mut scene = Scene::new(SHORT, "specimen = \"mirror:0.9\"").await;
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
    let sensitivity =
        |counts: &rig::Counts| f64::from(counts.exposure.integration_us) * counts.exposure.gain.factor();
    let mut weaker = 0;
    for pair in scene.journal.readings().windows(2) {
        let [one, next] = pair else { unreachable!() };
        assert_eq!(
            one.accepted,
            next.step != one.step,
            "the accepted one is the last of its step"
        );
        if !one.accepted {
            assert_eq!(next.attempt, one.attempt + 1);
            let change = sensitivity(&next.counts) / sensitivity(&one.counts);
            assert_eq!(one.counts.saturated, change < 1.0, "step {}: {change}", one.step);
            weaker += usize::from(one.counts.saturated);
        }
    }
    assert!(weaker > 0, "nothing was saturated");
    let enough = scene.drive.file().photometer.enough;
    for reading in scene.journal.accepted().iter().filter(|reading| reading.lamp) {
        let brightest = reading.counts.rgb.into_iter().fold(0, u32::max);
        assert!(!reading.counts.saturated, "step {}", reading.step);
        assert_eq!(
            brightest < enough / 2,
            reading.flags.contains(&Flag::Dim) && brightest < enough / 2
        );
        if brightest < enough / 2 {
            let exposure = reading.counts.exposure;
            assert_eq!(
                (exposure.gain, exposure.integration_us),
                (rig::Gain::X256, 100_000),
                "nothing more to be had"
            );
        }
    }
}

#[tokio::test(start_paused = true)]
async fn what_is_too_bright_for_the_weakest_exposure_is_flagged_and_kept() {
    let text = "[photometer]\nintegration_min_us = 50000\n[sim]\nspecimen = \"mirror:0.9\"";
    let file = RigFile::parse(text, "test.toml".as_ref()).unwrap();
    let mut scene = Scene::on(file, SHORT).await;
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
    let accepted = scene.journal.accepted();
    let saturated: Vec<_> = accepted
        .iter()
        .filter(|reading| reading.flags.contains(&Flag::Saturated))
        .collect();
    assert!(!saturated.is_empty());
    for reading in saturated {
        let exposure = reading.counts.exposure;
        assert_eq!((exposure.gain, exposure.integration_us), (rig::Gain::X1, 50_000));
    }
}

#[tokio::test(start_paused = true)]
async fn one_side_approach_with_backlash_is_captured() {
    let text = "[motion]\napproach = \"up\"\n[sim]\nlight_backlash_deg = 0.25\nsensor_backlash_deg = 0.25";
    let file = RigFile::parse(text, "test.toml".as_ref()).unwrap();
    let mut scene = Scene::on(file, SHORT).await;
    let before = scene.bench.now();
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    let (taken, planned) = (
        (scene.bench.now() - before).as_secs_f64(),
        scene.journal.plan().seconds(),
    );
    println!("with overshoot: planned {planned:.2} s, taken {taken:.2} s");
    assert!(
        (taken / planned - 1.0).abs() < 0.08,
        "planned {planned} s, taken {taken} s"
    );
    assert_complete(&scene.journal);
}

#[tokio::test(start_paused = true)]
async fn events_tell_the_story_in_order() {
    let mut scene = Scene::new(SHORT, "").await;
    let mut told = Vec::new();
    scene
        .run(|event| {
            told.push(match event {
                Event::State { state } => format!("{state:?}"),
                Event::Step { .. } => "step".to_owned(),
                Event::Reading { .. } => "reading".to_owned(),
                Event::Repeat { .. } => "repeat".to_owned(),
                Event::Suspended { .. } => "suspended".to_owned(),
                Event::Safe => "Safe".to_owned(),
                Event::Fault { .. } => "fault".to_owned(),
                Event::Progress { .. } => "progress".to_owned(),
            });
        })
        .await
        .unwrap();
    let states: Vec<_> = told
        .iter()
        .filter(|what| what.chars().next().is_some_and(char::is_uppercase))
        .collect();
    assert_eq!(
        states,
        [
            "Identifying",
            "Engaging",
            "Running",
            "WarmingUp",
            "Running",
            "ShuttingDown",
            "Safe"
        ]
    );
    let count = |of: &str| told.iter().filter(|what| *what == of).count();
    let steps = scene.journal.plan().steps.len();
    assert_eq!(
        (count("step"), count("reading")),
        (steps, scene.journal.readings().len())
    );
    // At the start, after each step, and after the last look at the dark.
    assert_eq!(count("progress"), steps + 2);
}

/// The photometer's clock wraps after 168 s.
#[tokio::test(start_paused = true)]
async fn device_time_is_unwrapped() {
    let text = "[photometer]\nlamp_warm_up_ms = 400000";
    let file = RigFile::parse(text, "test.toml".as_ref()).unwrap();
    let mut scene = Scene::on(file, SHORT).await;
    let mut at = Vec::new();
    let bench = scene.bench.clone();
    let outcome = scene
        .run(|event| {
            // Dark readings are told of when their set is judged.
            if let Event::Reading { reading } = event
                && reading.lamp
            {
                at.push((reading.device_ticks as f64 * 1e-5, bench.now().as_secs_f64()));
            }
        })
        .await;
    assert_eq!(outcome.unwrap(), Outcome::Done);
    assert!(at.last().unwrap().1 > 400.0);
    for (device_s, bench_s) in at {
        assert!(
            (device_s - bench_s).abs() < 0.2,
            "device {device_s} s, truly {bench_s} s"
        );
    }
    assert_eq!(
        peek(
            &scene.bench,
            Device::Photometer,
            rig::dynamixel::register::common::BUS_WATCHDOG
        ),
        0
    );
}
