//! Light from outside, seen while the lamp is off.

use capture::{Event, Outcome, Record};
use rig::FaultKind;
use sweep::Sweep;

use crate::bench::{SHORT, Scene, assert_complete};

const FLY: &str = "[[plane]]\ntheta_r_deg = 60\nreadings = 12\n[arc]\nreadings = 8\n[sweep]\nmode = \"fly\"";

/// Brightest channel of the dark readings that count.
fn brightest_dark(scene: &Scene) -> u32 {
    let accepted = scene.journal.accepted();
    let dark = accepted.iter().filter(|reading| reading.sweep == Sweep::Dark);
    dark.flat_map(|reading| reading.counts.rgb)
        .max()
        .expect("there are dark readings")
}

#[tokio::test(start_paused = true)]
async fn dark_readings_that_disagree_are_taken_again_until_they_agree() {
    for job in [SHORT, FLY] {
        for (at_s, glare_s) in [(0.0, 0.3), (0.5, 0.02), (0.5, 1.5), (0.9, 3.0)] {
            let fault = format!(
                "fault = [{{ device = \"photometer\", at_s = {at_s}, what = {{ glare_s = {glare_s} }} }}]"
            );
            let mut scene = Scene::new(job, &fault).await;
            let outcome = scene.run(|_| ()).await.unwrap();
            assert_eq!(outcome, Outcome::Done, "{fault}");
            assert_complete(&scene.journal);
            assert!(
                brightest_dark(&scene) < 2_000,
                "{fault}: {}",
                brightest_dark(&scene)
            );
        }
    }
}

#[tokio::test(start_paused = true)]
async fn light_that_stays_at_full_scale_or_flickers_ends_the_run_with_a_fault_that_says_so() {
    let lights = [
        (
            "fault = [{ device = \"photometer\", what = { glare_s = 1e4 } }]",
            "full scale",
        ),
        ("room_light_per_sr = 7.0", "full scale"),
        ("room_light_per_sr = 0.05\nroom_flicker_hz = 100.0", "flickers"),
        ("room_light_per_sr = 0.02\nroom_flicker_hz = 100.0", "flickers"),
        ("room_light_per_sr = 0.05\nroom_flicker_hz = 120.0", "flickers"),
        ("room_light_per_sr = 0.2\nroom_flicker_hz = 100.0", "flickers"),
        ("room_light_per_sr = 0.5\nroom_flicker_hz = 120.0", "flickers"),
    ];
    for (sim, why) in lights {
        let mut scene = Scene::new(SHORT, sim).await;
        let mut kinds = Vec::new();
        let outcome = scene.run(|event| {
            if let Event::Fault { kind, .. } = event {
                kinds.push(kind);
            }
        });
        let outcome = outcome.await.unwrap();
        let Outcome::Failed { fault } = outcome else {
            panic!("{sim}: {outcome:?}");
        };
        assert!(
            fault.contains(why) && fault.contains("darken the room"),
            "{sim}: {fault}"
        );
        assert_eq!(kinds, [FaultKind::Light], "{sim}");
        assert!(scene.journal.accepted().is_empty(), "{sim}: nothing counts");
        scene.assert_safe();
    }
}

#[tokio::test(start_paused = true)]
async fn a_run_that_met_light_from_outside_goes_on_once_it_is_dark() {
    let mut scene = Scene::new(
        SHORT,
        "fault = [{ device = \"photometer\", what = { glare_s = 1e4 } }]",
    )
    .await;
    assert!(matches!(scene.run(|_| ()).await.unwrap(), Outcome::Failed { .. }));
    scene.bench.darken();
    assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
    assert_complete(&scene.journal);
    assert!(brightest_dark(&scene) < 2_000);
}

#[tokio::test(start_paused = true)]
async fn the_dark_is_looked_at_once_more_at_the_end() {
    for job in [SHORT, FLY] {
        let mut scene = Scene::new(job, "room_light_per_sr = 0.01").await;
        assert_eq!(scene.run(|_| ()).await.unwrap(), Outcome::Done);
        assert!(!scene.lamp_is_on());
        let records = &scene.journal.records;
        let closing: Vec<_> = records
            .iter()
            .filter_map(|record| match record {
                Record::Repeat { reading, .. } if !reading.lamp => Some(reading.counts.exposure.gain),
                _ => None,
            })
            .collect();
        let accepted = scene.journal.accepted();
        let lit = accepted.iter().filter(|reading| reading.lamp);
        let strongest = lit.map(|reading| reading.counts.exposure.gain).max().unwrap();
        assert_eq!(closing, [strongest], "the strongest gain that was used");
    }
}
