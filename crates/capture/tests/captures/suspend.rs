use std::time::Duration;

use capture::{Command, Event, Outcome, Record, State};
use firmware_sim::{Disturbance, Fault};
use rig::{Device, RigFile};

use crate::bench::{SHORT, Scene, assert_complete};

async fn scene(text: &str) -> Scene {
    let file = RigFile::parse(text, "test.toml".as_ref()).expect("a good rig file");
    Scene::on(file, SHORT).await
}

fn schedule(scene: &Scene, device: Device, at: Duration, what: Disturbance) {
    scene.bench.schedule(Fault { device, at, what });
}

/// Why a run held, in the order of its journal, and how many times it went on.
fn held(scene: &Scene) -> (Vec<String>, usize) {
    let records = scene.journal.records.iter();
    let why = records.clone().filter_map(|record| match record {
        Record::Suspended { why, .. } => Some(why.clone()),
        _ => None,
    });
    let released = records.filter(|record| matches!(record, Record::Released { .. }));
    (why.collect(), released.count())
}

#[tokio::test(start_paused = true)]
async fn a_sagging_supply_holds_the_run_and_lets_it_go_on() {
    let mut scene = scene("").await;
    let sag = Disturbance::Sag(Duration::from_secs(60));
    schedule(&scene, Device::Sensor, Duration::from_secs(4), sag);
    let bench = scene.bench.clone();
    let mut times = Vec::new();
    let outcome = scene.run(|event| match event {
        Event::State { state } => {
            times.push((state, bench.now()));
        }
        Event::Suspended { why } => assert!(why.contains("sensor servo is 10.0 V"), "{why}"),
        _ => {}
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
    scene.assert_safe();
    let (why, released) = held(&scene);
    assert_eq!((why.len(), released), (1, 1), "{why:?}");
    let from = times
        .iter()
        .find(|(state, _)| *state == State::Suspended)
        .unwrap()
        .1;
    let to = times
        .iter()
        .find(|(state, at)| *state == State::Running && *at > from)
        .unwrap()
        .1;
    // Looked at every 2 s, and a reading takes less than one.
    let bounds = [(from, 4), (to, 64)];
    for (at, due) in bounds {
        let late = at.as_secs_f64() - f64::from(due);
        assert!((0.0..4.0).contains(&late), "{late} s after it was due");
    }
}

#[tokio::test(start_paused = true)]
async fn nothing_moves_before_the_start_while_the_door_is_open() {
    let mut scene = scene("[suspend]\ndoor = true").await;
    schedule(
        &scene,
        Device::Photometer,
        Duration::ZERO,
        Disturbance::Door(Duration::from_secs(30)),
    );
    let bench = scene.bench.clone();
    let start = bench.pose();
    let mut still = true;
    let outcome = scene.run(|event| {
        let open = bench.now() < Duration::from_secs(30);
        still &= !open || bench.pose() == start;
        assert!(
            !open || !matches!(event, Event::Reading { .. }),
            "a reading with the door open"
        );
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Done);
    assert!(still, "an arm moved");
    assert_eq!(held(&scene), (vec!["the door is open".to_owned()], 1));
}

#[tokio::test(start_paused = true)]
async fn a_door_that_nobody_asked_about_holds_nothing() {
    let mut scene = scene("").await;
    schedule(
        &scene,
        Device::Photometer,
        Duration::ZERO,
        Disturbance::Door(Duration::from_secs(600)),
    );
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_eq!(held(&scene), (vec![], 0));
}

#[tokio::test(start_paused = true)]
async fn warmth_is_looked_at_before_the_start_and_waiting_for_its_end_can_be_ended() {
    let mut scene = scene("[suspend]\ntemperature_c = [35.0, 30.0]\n[sim]\nambient_c = 40.0").await;
    let control = scene.control.clone();
    let outcome = scene.run(|event| {
        if let Event::Suspended { why } = event {
            assert!(why.contains("40 °C"), "{why}");
            control.send_replace(Command::Stop);
        }
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Stopped);
    assert!(scene.journal.readings().is_empty());
    assert!(!scene.lamp_is_on());
}

/// The lamp drifts by up to 30 %, in minutes, from another phase with each seed.
#[tokio::test(start_paused = true)]
async fn a_lamp_out_of_its_band_is_waited_for_without_readings() {
    let mut all = 0;
    for seed in 0..6 {
        let text = format!("[suspend]\nlamp_percent = [8.0, 4.0]\n[sim]\nlamp_drift = 0.3\nseed = {seed}");
        let mut scene = scene(&text).await;
        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        assert_complete(&scene.journal);
        let (why, released) = held(&scene);
        assert!(why.iter().all(|why| why.contains("the lamp is")), "{why:?}");
        all += released;
        let off = |reading: &&capture::Reading| {
            let nominal = 5.0 * f64::from(reading.counts.exposure.integration_us);
            reading.lamp && (f64::from(reading.counts.monitor) / nominal - 1.0).abs() > 0.1
        };
        // The first reading is the first look at the lamp.
        let off = scene.journal.accepted().into_iter().filter(off).count();
        assert!(
            off <= 1,
            "{off} readings with the lamp off its nominal output, seed {seed}"
        );
    }
    assert!(all > 0, "no seed's lamp went out of its band");
}

#[tokio::test(start_paused = true)]
async fn a_full_disk_is_waited_for() {
    let mut scene = scene("[suspend]\ndisk_mb = [100.0, 200.0]").await;
    scene.journal.room = Some(50_000_000);
    let control = scene.control.clone();
    let outcome = scene.run(|event| {
        if matches!(event, Event::Suspended { .. }) {
            control.send_replace(Command::Stop);
        }
    });
    assert_eq!(outcome.await.unwrap(), Outcome::Stopped);
    assert_eq!(held(&scene).0, ["the disk has room for 50 MB"]);
    scene.journal.room = Some(500_000_000);
    scene.control.send_replace(Command::Run);
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
}
