//! What is said of captures that were carried out and whose result must not be used.

use capture::{Flag, Reading, Record};
use report::{Check, Verdict, judge};
use sweep::Sweep;

use crate::bench::Laboratory;

const QUICKSTART: &str = include_str!("../../../../config/jobs/quickstart.toml");
const PAPER: &str = include_str!("../../../../config/jobs/paper.toml");
const FULL: u32 = 65_535;

async fn captured(specimen: &str, job: &str) -> Vec<Record> {
    let specimen = brdf::specimen(specimen).expect("a known specimen");
    Laboratory::new("").measure(specimen, job).await
}

/// The records with each lit reading of a sweep changed.
fn spoiled(records: &[Record], mut spoil: impl FnMut(&mut Reading)) -> Vec<Record> {
    let mut records = records.to_vec();
    for record in &mut records {
        if let Record::Reading(reading) = record
            && reading.lamp
        {
            spoil(reading);
        }
    }
    records
}

fn bad(checks: &[Check]) -> Vec<&str> {
    let bad = checks.iter().filter(|check| check.verdict == Verdict::Bad);
    bad.map(|check| check.name).collect()
}

#[tokio::test(start_paused = true)]
async fn a_result_that_is_none_is_called_bad() {
    let sound = captured("gold-paint", QUICKSTART).await;
    let (verdict, checks) = judge(&sound).unwrap();
    assert_eq!(bad(&checks), [""; 0], "{checks:#?}");
    assert!(verdict <= Verdict::Look, "{checks:#?}");
    let dark = sound.iter().find_map(|record| match record {
        Record::Reading(reading) if !reading.lamp => Some(reading.counts.rgb),
        _ => None,
    });
    let dark = dark.expect("there are dark readings");
    let saturate = |reading: &mut Reading| {
        reading.counts.rgb = [FULL; 3];
        reading.counts.saturated = true;
        reading.flags = vec![Flag::Saturated];
    };
    type Spoil<'a> = Box<dyn FnMut(&mut Reading) + 'a>;
    let mut noise = 0;
    let cases: [(&str, Spoil<'_>); 8] = [
        ("everything is saturated", Box::new(saturate)),
        (
            "one plane is saturated",
            Box::new(|reading| {
                if reading.sweep == Sweep::Plane(1) {
                    saturate(reading);
                }
            }),
        ),
        (
            "the arc is saturated",
            Box::new(|reading| {
                if reading.sweep == Sweep::Arc {
                    saturate(reading);
                }
            }),
        ),
        (
            "no light came back",
            Box::new(|reading| reading.counts.rgb = dark),
        ),
        (
            "no blue light came back",
            Box::new(|reading| reading.counts.rgb[2] = dark[2]),
        ),
        (
            "less came back than in the dark",
            Box::new(|reading| reading.counts.rgb = [0; 3]),
        ),
        (
            "the monitor saw no lamp",
            Box::new(|reading| reading.counts.monitor = 0),
        ),
        (
            "the photometer is stuck",
            Box::new(|reading| {
                noise = 9_000;
                reading.counts.rgb = [noise; 3];
            }),
        ),
    ];
    for (what, spoil) in cases {
        let (verdict, checks) = judge(&spoiled(&sound, spoil)).unwrap();
        println!("{what}: {:?}", bad(&checks));
        assert_eq!(verdict, Verdict::Bad, "{what}: {checks:#?}");
    }
}

/// The lamp fails before it was ever seen, on a rig that has no monitor to tell.
#[tokio::test(start_paused = true)]
async fn a_lamp_that_no_monitor_watches_and_that_never_shone_makes_a_bad_run() {
    let text = "[calibration]\nlamp = \"visits\"\n";
    let specimen = brdf::specimen("gold-paint").expect("a known specimen");
    let records = Laboratory::new(text).measure(specimen, QUICKSTART).await;
    assert!(judge(&records).unwrap().0 <= Verdict::Look);
    let dark = spoiled(&records, |reading| reading.counts.rgb = [60; 3]);
    assert_eq!(judge(&dark).unwrap().0, Verdict::Bad);
}

#[tokio::test(start_paused = true)]
async fn an_empty_stage_is_called_bad_whatever_model_was_named() {
    for job in [QUICKSTART, PAPER] {
        let (verdict, checks) = judge(&captured("black", job).await).unwrap();
        assert_eq!(verdict, Verdict::Bad, "{checks:#?}");
    }
}

#[tokio::test(start_paused = true)]
async fn no_honest_capture_is_called_bad() {
    let names = [
        "gold-paint",
        "chrome",
        "alum-bronze",
        "nickel",
        "blue-rubber",
        "lambert:0.9",
        "lambert:0.05",
        "mirror:0.9",
    ];
    for name in names {
        for job in [QUICKSTART, PAPER] {
            let (_, checks) = judge(&captured(name, job).await).unwrap();
            for check in checks.iter().filter(|check| check.verdict != Verdict::Good) {
                println!("{name}: {}: {}: {}", check.verdict.word(), check.name, check.text);
            }
            assert_eq!(bad(&checks), [""; 0], "{name}: {checks:#?}");
        }
    }
}

/// Who names the paper's model knows what it takes for granted.
#[tokio::test(start_paused = true)]
async fn a_model_that_was_named_on_purpose_is_at_worst_worth_a_look() {
    let (verdict, checks) = judge(&captured("gold-paint", PAPER).await).unwrap();
    assert_eq!(verdict, Verdict::Look, "{checks:#?}");
}

#[tokio::test(start_paused = true)]
async fn coverage_does_not_blame_the_arms_for_an_arc_that_nobody_asked_for() {
    let plane = "[[plane]]\ntheta_r_deg = 45\nreadings = 24\n";
    let coverage = |records: Vec<Record>| {
        let (_, checks) = judge(&records).unwrap();
        let check = checks.into_iter().find(|check| check.name == "coverage");
        check.expect("there is a model")
    };
    let with = coverage(captured("gold-paint", &format!("{plane}[arc]\nreadings = 16\n")).await);
    let without = coverage(captured("gold-paint", plane).await);
    assert!(without.text.contains("the job has none"), "{}", without.text);
    assert!(!with.text.contains("the job has none"), "{}", with.text);
    let hidden = |check: &Check| check.values["occluded"].as_f64().unwrap();
    // 5° about the retro-reflection of every direction are at most this share of all pairs below 80°.
    assert!(hidden(&without) < 0.02, "{}", without.text);
    assert_eq!(hidden(&with), hidden(&without), "the arms are the same");
}
