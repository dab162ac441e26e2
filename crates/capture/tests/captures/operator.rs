use std::panic::AssertUnwindSafe;
use std::time::Duration;

use capture::{CaptureError, Command, Event, JournalError, Outcome, Record, State};
use rig::Device;
use rig::dynamixel::register::{common, servo};
use sweep::Sweep;

use crate::bench::{MemoryJournal, SERVOS, SHORT, Scene, assert_complete, peek};

/// Gives a command when so many readings are taken.
fn after(
    readings: usize,
    control: &tokio::sync::watch::Sender<Command>,
    command: Command,
) -> impl FnMut(Event) + Send + use<> {
    let control = control.clone();
    let mut taken = 0;
    move |event| {
        if matches!(event, Event::Reading { .. }) {
            taken += 1;
            if taken == readings {
                control.send_replace(command);
            }
        }
    }
}

/// What must be the same whether a run was stopped or not: all but what was taken again because of it.
fn essence(journal: &MemoryJournal) -> Vec<(usize, u32, [u32; 3], rig::Exposure, arms::Pose)> {
    let reading = |reading: &&capture::Reading| {
        (
            reading.step,
            reading.attempt,
            reading.counts.rgb,
            reading.counts.exposure,
            reading.measured,
        )
    };
    let planned = journal.plan().steps.len();
    let readings = journal.readings().into_iter();
    readings
        .filter(|reading| reading.step < planned)
        .map(|kept| reading(&kept))
        .collect()
}

/// What a hold adds between two readings of the plan: so many dark readings, and so many visits to the reference pose.
fn added(journal: &MemoryJournal) -> Vec<(usize, usize)> {
    let planned = journal.plan().steps.len();
    let readings = journal.readings();
    let sets = readings.chunk_by(|a, b| (a.step < planned) == (b.step < planned));
    let count = |set: &[&capture::Reading], sweep: Sweep| {
        let of = |reading: &&&capture::Reading| reading.sweep == sweep && reading.accepted;
        set.iter().filter(of).count()
    };
    sets.filter(|set| set[0].step >= planned)
        .map(|set| (count(set, Sweep::Dark), count(set, Sweep::Reference)))
        .collect()
}

/// Dark level and lamp drift while a run is held, however short; what follows must not rest on what was before.
#[tokio::test(start_paused = true)]
async fn whatever_held_a_run_it_goes_on_after_fresh_dark_and_reference_readings() {
    for (rig, visits) in [("", 0), ("[calibration]\nlamp = \"visits\"", 1)] {
        for command in [Command::Pause, Command::Finish, Command::Stop] {
            let file = rig::RigFile::parse(rig, "test.toml".as_ref()).unwrap();
            let mut scene = Scene::on(file, SHORT).await;
            let dark = scene
                .journal
                .plan()
                .steps
                .iter()
                .take_while(|step| !step.lamp)
                .count();
            let (control, mut hold) = (scene.control.clone(), after(35, &scene.control, command));
            let outcome = scene.run(|event| {
                if event == (Event::State { state: State::Paused }) {
                    control.send_replace(Command::Run);
                }
                hold(event);
            });
            if outcome.await.unwrap() == Outcome::Stopped {
                scene.control.send_replace(Command::Run);
                assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
            }
            assert_complete(&scene.journal);
            assert_eq!(added(&scene.journal), [(dark, visits)], "{rig:?}, {command:?}");
            scene.assert_safe();
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_run_that_is_held_before_any_light_takes_nothing_again() {
    let mut scene = Scene::new(SHORT, "").await;
    let stop = after(5, &scene.control, Command::Finish);
    assert_eq!(scene.run(stop).await.unwrap(), Outcome::Stopped);
    scene.control.send_replace(Command::Run);
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_eq!(added(&scene.journal), []);
}

#[tokio::test(start_paused = true)]
async fn stopped_anywhere_and_resumed_gives_the_readings_of_an_undisturbed_run() {
    let sim = "specimen = \"gold-paint\"\nimperfections = \"none\"";
    let mut undisturbed = Scene::new(SHORT, sim).await;
    undisturbed.run(|_| ()).await.unwrap();
    let whole = essence(&undisturbed.journal);
    for at in 1..whole.len() {
        let mut scene = Scene::new(SHORT, sim).await;
        let stop = after(at, &scene.control, Command::Finish);
        let outcome = scene.run(stop).await.unwrap();
        scene.assert_safe();
        if outcome == Outcome::Done {
            assert!(
                scene.journal.readings().len() - at < 2,
                "only the last step is finished in spite of a stop"
            );
            continue;
        }
        assert_eq!(outcome, Outcome::Stopped);
        let last = *scene.journal.readings().last().unwrap();
        assert!(last.accepted, "stopped at {at}: the reading in hand is finished");
        scene.control.send_replace(Command::Run);
        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        assert_complete(&scene.journal);
        assert_eq!(essence(&scene.journal), whole, "stopped after reading {at}");
        let ticks: Vec<u64> = scene
            .journal
            .readings()
            .iter()
            .map(|reading| reading.device_ticks)
            .collect();
        assert!(
            ticks.windows(2).all(|pair| pair[0] < pair[1]),
            "device time runs on"
        );
        scene.assert_safe();
    }
}

#[tokio::test(start_paused = true)]
async fn a_run_is_resumed_from_wherever_the_arms_are_then() {
    let mut scene = Scene::new(SHORT, "").await;
    let stop = after(30, &scene.control, Command::Finish);
    assert_eq!(scene.run(stop).await.unwrap(), Outcome::Stopped);
    scene.drive.engage_all().await.unwrap();
    scene
        .drive
        .travel(&[arms::Pose::from_deg(-80.0, 20.0)])
        .await
        .unwrap();
    scene.drive.disengage_all().await;
    scene.control.send_replace(Command::Run);
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
}

#[tokio::test(start_paused = true)]
async fn a_finished_run_has_nothing_left_to_measure() {
    let mut scene = Scene::new(SHORT, "").await;
    scene.run(|_| ()).await.unwrap();
    let readings = scene.journal.readings().len();
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_eq!(scene.journal.readings().len(), readings);
    scene.assert_safe();
}

#[tokio::test(start_paused = true)]
async fn other_devices_do_not_go_on_with_a_run() {
    let mut scene = Scene::new(SHORT, "").await;
    let stop = after(30, &scene.control, Command::Finish);
    scene.run(stop).await.unwrap();
    for record in &mut scene.journal.records {
        if let Record::Begin { identities, .. } = record {
            identities[1].firmware += 1;
        }
    }
    scene.control.send_replace(Command::Run);
    let (pose, readings) = (scene.bench.pose(), scene.journal.readings().len());
    let error = scene.run(|_| ()).await.unwrap_err();
    assert!(matches!(error, CaptureError::OtherDevices { .. }), "{error}");
    assert_eq!(
        (scene.bench.pose(), scene.journal.readings().len()),
        (pose, readings)
    );
    scene.assert_safe();
}

#[tokio::test(start_paused = true)]
async fn a_journal_without_header_runs_nothing() {
    let mut scene = Scene::new(SHORT, "").await;
    scene.journal.records.clear();
    assert!(matches!(scene.run(|_| ()).await, Err(CaptureError::NoHeader)));
}

#[tokio::test(start_paused = true)]
async fn a_pause_holds_everything_until_it_ends() {
    // A watchdog that is soon hungry.
    let file = rig::RigFile::parse("[motion]\nwatchdog_ms = 100", "test.toml".as_ref()).unwrap();
    let mut scene = Scene::on(file, SHORT).await;
    let control = scene.control.clone();
    let bench = scene.bench.clone();
    let mut pause = after(35, &scene.control, Command::Pause);
    let mut paused_at = None;
    let mut story = Vec::new();
    let outcome = scene.run(|event| {
        match &event {
            Event::State { state: State::Paused } => {
                paused_at = Some((bench.now(), bench.pose()));
                let control = control.clone();
                // Longer than every watchdog and than the photometer's clock counts.
                tokio::spawn(async move {
                    tokio::time::sleep(Duration::from_secs(300)).await;
                    control.send_replace(Command::Run);
                });
            }
            Event::State {
                state: State::Running,
            } if paused_at.is_some() => {
                // Once: the lamp, put out for fresh dark readings, warms up again after that.
                let (since, pose) = paused_at.take().expect("just asked");
                assert!(bench.now() - since >= Duration::from_secs(300));
                let now = bench.pose();
                let moved = [now.light - pose.light, now.sensor - pose.sensor];
                // They tremble by a count.
                assert!(
                    moved.iter().all(|by| by.abs().to_degrees() < 0.2),
                    "{pose:?}, {now:?}"
                );
                assert_eq!(
                    peek(
                        &bench,
                        Device::Photometer,
                        rig::dynamixel::register::photometer::LAMP_ENABLE
                    ),
                    1
                );
            }
            _ => {}
        }
        if let Event::State { state } = &event {
            story.push(*state);
        }
        pause(event);
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Done);
    assert!(story.contains(&State::Paused));
    assert_complete(&scene.journal);
    let last = scene.journal.readings().last().unwrap().device_ticks as f64 * 1e-5;
    assert!(last > 300.0, "device time includes the pause: {last} s");
    scene.assert_safe();
}

#[tokio::test(start_paused = true)]
async fn a_paused_run_can_be_stopped() {
    let mut scene = Scene::new(SHORT, "").await;
    let control = scene.control.clone();
    let mut pause = after(35, &scene.control, Command::Pause);
    let outcome = scene.run(|event| {
        if event == (Event::State { state: State::Paused }) {
            control.send_replace(Command::Finish);
        }
        pause(event);
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Stopped);
    scene.assert_safe();
}

#[tokio::test(start_paused = true)]
async fn a_stop_during_warm_up_does_not_wait_for_its_end() {
    let mut scene = Scene::new(SHORT, "").await;
    let control = scene.control.clone();
    let outcome = scene.run(|event| {
        if event
            == (Event::State {
                state: State::WarmingUp,
            })
        {
            control.send_replace(Command::Finish);
        }
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Stopped);
    scene.assert_safe();
    assert!(scene.journal.readings().iter().all(|reading| !reading.lamp));
}

#[tokio::test(start_paused = true)]
async fn an_emergency_stop_halts_arms_on_their_way_at_once() {
    let mut scene = Scene::new(SHORT, "").await;
    let (control, bench) = (scene.control.clone(), scene.bench.clone());
    let stopped_at = std::sync::Arc::new(std::sync::Mutex::new(None));
    let told = stopped_at.clone();
    let outcome = scene.run(move |event| {
        // The first step with the lamp on has a long way to go.
        if let Event::Step { sweep, .. } = event
            && sweep != sweep::Sweep::Dark
            && told.lock().unwrap().is_none()
        {
            let (control, bench, told) = (control.clone(), bench.clone(), told.clone());
            *told.lock().unwrap() = Some(Duration::ZERO);
            tokio::spawn(async move {
                tokio::time::sleep(Duration::from_millis(500)).await;
                assert_eq!(
                    peek(&bench, Device::Light, servo::MOVING),
                    1,
                    "stopped while it moves"
                );
                *told.lock().unwrap() = Some(bench.now());
                control.send_replace(Command::Estop);
            });
        }
    });
    let outcome = outcome.await.unwrap();
    assert_eq!(
        outcome,
        Outcome::Failed {
            fault: "emergency stop".to_owned()
        }
    );
    let took = scene.bench.now() - stopped_at.lock().unwrap().unwrap();
    assert!(
        took < Duration::from_millis(20),
        "{took:?} from the command to the end"
    );
    tokio::time::sleep(Duration::from_millis(100)).await;
    scene.assert_safe();
}

#[tokio::test(start_paused = true)]
async fn an_emergency_stop_while_it_shuts_down_is_one_all_the_same() {
    for before in [None, Some(Command::Finish), Some(Command::Stop)] {
        let mut scene = Scene::new(SHORT, "").await;
        let control = scene.control.clone();
        let mut ending = after(3, &scene.control, before.unwrap_or_default());
        let outcome = scene.run(move |event| {
            let shuts_down = Event::State {
                state: State::ShuttingDown,
            };
            if event == shuts_down {
                control.send_replace(Command::Estop);
            }
            ending(event);
        });
        let fault = "emergency stop".to_owned();
        assert_eq!(
            outcome.await.unwrap(),
            Outcome::Failed { fault },
            "after {before:?}"
        );
        assert!(
            matches!(
                scene.journal.records.last(),
                Some(Record::End {
                    outcome: Outcome::Failed { .. },
                    ..
                })
            ),
            "after {before:?}"
        );
        scene.assert_safe();
    }
}

#[tokio::test(start_paused = true)]
async fn a_stop_decelerates_on_the_profile_without_swinging_back() {
    let mut scene = Scene::new(SHORT, "imperfections = \"none\"").await;
    let (control, bench) = (scene.control.clone(), scene.bench.clone());
    let deceleration = scene
        .drive
        .file()
        .arm(arms::Arm::Light)
        .profile
        .acceleration_rad_s2;
    let (tell, mut watched) = tokio::sync::mpsc::unbounded_channel();
    let mut seen = false;
    let outcome = scene.run(move |event| {
        // The first step with the lamp on has a long way to go.
        if let Event::Step { sweep, .. } = event
            && sweep != sweep::Sweep::Dark
            && !std::mem::replace(&mut seen, true)
        {
            let (control, bench, tell) = (control.clone(), bench.clone(), tell.clone());
            tokio::spawn(async move {
                tokio::time::sleep(Duration::from_millis(500)).await;
                for ms in 0..1000 {
                    if ms == 20 {
                        control.send_replace(Command::Stop);
                    }
                    let _ = tell.send((bench.now(), bench.pose().light.rad()));
                    tokio::time::sleep(Duration::from_millis(1)).await;
                }
            });
        }
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Stopped);
    let mut way = Vec::new();
    let mut times = Vec::new();
    while let Some((at, rad)) = watched.recv().await {
        times.push(at.as_secs_f64());
        way.push(rad);
    }
    let velocity = (way[20] - way[10]) / (times[20] - times[10]);
    assert!(velocity.abs() > 0.5, "stopped while it moves: {velocity} rad/s");
    // Position and goal are whole counts, so the goal may be up to one nearer than where the arm can stop.
    let count = std::f64::consts::TAU / 4096.0;
    let ahead = |rad: &f64| rad * velocity.signum();
    let swing = way.iter().map(ahead).fold(f64::MIN, f64::max) - ahead(&way[999]);
    assert!(swing <= count, "it never swings back, here by {swing} rad");
    let braked = (way[999] - way[20]).abs();
    let ideal = velocity * velocity / (2.0 * deceleration);
    // Goals and velocities are whole registers; a few counts.
    assert!(
        (braked - ideal).abs() < 0.005,
        "{braked} rad instead of {ideal} rad"
    );
    scene.assert_safe();
    scene.control.send_replace(Command::Run);
    assert_eq!(
        scene.run(|_| ()).await.unwrap(),
        Outcome::Done,
        "it can be resumed"
    );
    assert_complete(&scene.journal);
}

#[tokio::test(start_paused = true)]
async fn a_resumed_run_tells_by_how_much_the_last_poses_differ_now() {
    let sim = "specimen = \"lambert:0.5\"\nimperfections = \"none\"";
    let mut scene = Scene::new(SHORT, sim).await;
    let stop = after(30, &scene.control, Command::Finish);
    assert_eq!(scene.run(stop).await.unwrap(), Outcome::Stopped);
    scene.control.send_replace(Command::Run);
    let mut told = Vec::new();
    let outcome = scene.run(|event| {
        if let Event::Repeat {
            reading,
            difference_rel,
        } = event
        {
            told.push((reading.step, reading.sweep, difference_rel));
        }
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Done);
    assert!((1..=10).contains(&told.len()), "{told:?}");
    let accepted = scene.journal.accepted();
    for &(step, sweep, difference_rel) in &told {
        assert_eq!((sweep, difference_rel), (sweep::Sweep::Repeat, 0.0));
        assert!(
            accepted
                .iter()
                .any(|reading| reading.step == step && reading.lamp)
        );
    }
    let repeats = scene
        .journal
        .records
        .iter()
        .filter(|record| matches!(record, Record::Repeat { reading, .. } if reading.lamp));
    assert_eq!(repeats.count(), told.len(), "and the journal has them");
    assert_complete(&scene.journal);
}

#[tokio::test(start_paused = true)]
async fn a_panic_of_whoever_watches_leaves_the_rig_safe() {
    let mut panic_at = 1;
    loop {
        let mut scene = Scene::new(SHORT, "").await;
        let mut seen = 0;
        let run = scene.run(|_| {
            seen += 1;
            assert!(seen != panic_at, "made to panic");
        });
        // The panic must come out of `run` itself, after it has put everything in order.
        let result = catch(run).await;
        scene.assert_safe();
        panic_at += 1;
        match result {
            Err(panic) => assert_eq!(panic.downcast_ref::<&str>(), Some(&"made to panic")),
            Ok(outcome) => {
                assert_eq!(outcome.unwrap(), Outcome::Done, "no event was left to panic at");
                break;
            }
        }
    }
    assert!(panic_at > 100, "panics at every event");
}

async fn catch<T>(future: impl Future<Output = T>) -> std::thread::Result<T> {
    let mut future = std::pin::pin!(future);
    std::future::poll_fn(|context| {
        match std::panic::catch_unwind(AssertUnwindSafe(|| future.as_mut().poll(context))) {
            Ok(poll) => poll.map(Ok),
            Err(panic) => std::task::Poll::Ready(Err(panic)),
        }
    })
    .await
}

/// Nothing can be awaited in a drop, so the watchdogs must do.
#[tokio::test(start_paused = true)]
async fn a_capture_that_is_dropped_falls_to_the_watchdogs() {
    let mut scene = Scene::new(SHORT, "").await;
    let bench = scene.bench.clone();
    let waiting = tokio::time::timeout(Duration::from_millis(2600), scene.run(|_| ())).await;
    assert!(waiting.is_err(), "still running");
    assert!(scene.lamp_is_on(), "dropped in the middle of it");
    tokio::time::sleep(Duration::from_millis(1500)).await;
    assert!(!scene.lamp_is_on());
    for device in SERVOS {
        assert_eq!(peek(&bench, device, servo::MOVING), 0, "{device}");
        assert_eq!(peek(&bench, device, common::BUS_WATCHDOG), 255, "{device}");
    }
    assert_eq!(
        scene.run(|_| ()).await.unwrap(),
        Outcome::Done,
        "and can be resumed"
    );
    assert_complete(&scene.journal);
    scene.assert_safe();
}

#[tokio::test(start_paused = true)]
async fn a_full_disk_ends_the_run_at_rest_and_loses_nothing() {
    for full_at in [1, 2, 10, 25, 26, 40] {
        let mut scene = Scene::new(SHORT, "").await;
        let mut appended = 0;
        scene.journal.at_append = Box::new(move |_| {
            appended += 1;
            if appended < full_at {
                return Ok(());
            }
            let source = std::io::ErrorKind::StorageFull.into();
            Err(JournalError::Io {
                what: "write",
                path: "journal".into(),
                source,
            })
        });
        let error = scene.run(|_| ()).await.unwrap_err();
        assert!(matches!(error, CaptureError::Journal(_)), "{error}");
        scene.assert_safe();
        assert_eq!(scene.journal.records.len(), full_at, "with the header");
        scene.journal.at_append = Box::new(|_| Ok(()));
        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        assert_complete(&scene.journal);
    }
}

#[tokio::test(start_paused = true)]
async fn a_capture_can_run_in_a_task_of_its_own() {
    let mut scene = Scene::new(SHORT, "").await;
    let task = tokio::spawn(async move { scene.run(|_| ()).await.unwrap() });
    assert_eq!(task.await.unwrap(), Outcome::Done);
}

/// The dark readings that follow a pause are interrupted in their turn: what is left of them is taken at the end of the run, from
/// wherever the arms are then.
#[tokio::test(start_paused = true)]
async fn dark_readings_after_a_pause_can_be_interrupted_too() {
    for at in [25, 30, 36, 42] {
        let mut scene = Scene::new(SHORT, "").await;
        let control = scene.control.clone();
        let mut pause = after(at, &scene.control, Command::Pause);
        let mut paused = false;
        let outcome = scene.run(|event| {
            match &event {
                Event::State { state: State::Paused } => {
                    paused = true;
                    control.send_replace(Command::Run);
                }
                Event::Step {
                    sweep: sweep::Sweep::Dark,
                    ..
                } if paused => {
                    control.send_replace(Command::Stop);
                }
                _ => {}
            }
            if !paused {
                pause(event);
            }
        });
        assert_eq!(outcome.await.unwrap(), Outcome::Stopped, "paused after {at}");
        scene.control.send_replace(Command::Run);
        assert_eq!(
            scene.run(|_| ()).await.unwrap(),
            Outcome::Done,
            "paused after {at}"
        );
        assert_complete(&scene.journal);
        scene.assert_safe();
    }
}
