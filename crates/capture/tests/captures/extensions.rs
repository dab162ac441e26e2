//! Plans that grow while they run.

use std::sync::atomic::{AtomicUsize, Ordering};

use capture::{Command, Event, Extension, Outcome, Record, extended_plan};
use sweep::{Step, Sweep};

use crate::bench::{SHORT, Scene};

/// The last `n` poses of the plan once more.
fn repeats(records: &[Record], n: usize) -> Extension {
    let plan = extended_plan(records).expect("there is a header");
    let steps = plan.steps.iter().rev().take(n).enumerate().map(|(i, step)| Step {
        index: plan.steps.len() + i,
        sweep: Sweep::Repeat,
        path: vec![step.pose()],
        ..step.clone()
    });
    Extension {
        steps: steps.collect(),
        why: "to see".to_owned(),
        expected_male: Some(0.001),
    }
}

/// Runs what is left; what is added: three readings, then one, then nothing.
async fn run(scene: &mut Scene, asked: &AtomicUsize, stop_in_repeats: bool) -> Outcome {
    let control = scene.control.subscribe();
    let sender = scene.control.clone();
    sender.send_replace(Command::Run);
    let mut on_event = |event| match event {
        Event::Reading { reading } if stop_in_repeats && reading.sweep == Sweep::Repeat => {
            sender.send_replace(Command::Finish);
        }
        _ => {}
    };
    let mut ask = |records: &[Record]| -> capture::Thinking {
        let n = [3, 1, 0][asked.fetch_add(1, Ordering::Relaxed)];
        let answer = repeats(records, n);
        Box::pin(async move {
            // Longer than any watchdog waits.
            tokio::time::sleep(std::time::Duration::from_secs(20)).await;
            answer
        })
    };
    capture::run_and_ask(
        &mut scene.drive,
        &mut scene.journal,
        control,
        &mut on_event,
        &mut ask,
    )
    .await
    .expect("the journal can be written")
}

async fn open() -> Scene {
    let mut scene = Scene::new(SHORT, "specimen = \"lambert:0.5\"").await;
    let Some(Record::Header(header)) = scene.journal.records.first_mut() else {
        panic!("no header");
    };
    header.plan.open = true;
    scene
}

#[tokio::test(start_paused = true)]
async fn what_is_added_is_measured_until_nothing_is() {
    let mut scene = open().await;
    let planned = scene.journal.plan().steps.len();
    let asked = AtomicUsize::new(0);
    assert_eq!(run(&mut scene, &asked, false).await, Outcome::Done);
    let steps: Vec<usize> = scene.journal.accepted().iter().map(|r| r.step).collect();
    assert_eq!(steps, (0..planned + 4).collect::<Vec<_>>());
    assert_eq!(asked.load(Ordering::Relaxed), 3);
    assert!(capture::closed(&scene.journal.records));
    scene.assert_safe();
    // The last word was said.
    assert_eq!(run(&mut scene, &asked, false).await, Outcome::Done);
    assert_eq!(asked.load(Ordering::Relaxed), 3);
}

#[tokio::test(start_paused = true)]
async fn a_resumed_run_goes_on_with_what_was_added() {
    let mut scene = open().await;
    let planned = scene.journal.plan().steps.len();
    let asked = AtomicUsize::new(0);
    let taken = |scene: &Scene| {
        scene
            .journal
            .accepted()
            .iter()
            .map(|r| r.step)
            .collect::<Vec<_>>()
    };
    assert_eq!(run(&mut scene, &asked, true).await, Outcome::Stopped);
    assert_eq!(taken(&scene).len(), planned + 1);
    assert_eq!(asked.load(Ordering::Relaxed), 1);
    assert!(!capture::closed(&scene.journal.records));
    assert_eq!(run(&mut scene, &asked, false).await, Outcome::Done);
    // Four that were asked for, and the dark readings that a resumed run begins with.
    let mut all = taken(&scene);
    all.sort_unstable();
    assert_eq!(all, (0..scene.journal.step_count()).collect::<Vec<_>>());
    let asked_for = scene
        .journal
        .accepted()
        .iter()
        .filter(|r| r.sweep == Sweep::Repeat)
        .count();
    assert_eq!(asked_for, 4);
    scene.assert_safe();
}
