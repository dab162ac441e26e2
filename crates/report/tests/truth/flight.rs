//! What arms that do not stop measure, beside what arms that stop do.

use std::sync::Arc;

use arms::{ArmAngle, Pose};
use brdf::Brdf;
use capture::Record;
use pdv::{Draw, Observation, compare};
use report::{measurements, observations};
use sweep::Sweep;

use crate::bench::{FINE_SERVOS, Laboratory};

const PAPER: &str = include_str!("../../../../config/jobs/paper.toml");

/// What the readings of a flight may be off by in the mean, where those at rest are off by less.
const NOISY: f64 = 0.02;

/// A capture: seconds of rig time, root mean square and median of the relative errors of what was observed, MALE of the
/// reconstruction.
struct Score {
    seconds: f64,
    rms: f64,
    median: f64,
    male: f64,
}

async fn score(specimen: &Arc<dyn Brdf>, job: &str, servos: &str) -> Score {
    let laboratory = Laboratory::new(&format!("[sim]\n{servos}"));
    let records = laboratory.measure(specimen.clone(), job).await;
    let measured = measurements(&records, &laboratory.file);
    let plane = observations(&measured, Sweep::Plane(0));
    let arc = observations(&measured, Sweep::Arc);
    let mut errors: Vec<f64> = plane
        .iter()
        .chain(&arc)
        .map(|o| error(o, specimen.as_ref()))
        .collect();
    errors.sort_by(f64::total_cmp);
    let model = report::model(sweep::Model::Separable, &[plane], &arc).expect("enough readings");
    let draw = Draw {
        pairs: 100_000,
        ..Draw::default()
    };
    let estimate: &dyn Brdf = &*model;
    let male = compare(specimen.as_ref(), &[estimate], &draw)[0]
        .overall
        .male
        .expect("pairs");
    Score {
        seconds: seconds(&records),
        rms: (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt(),
        median: errors[errors.len() / 2],
        male,
    }
}

/// Relative error of the green reflectance at the pose that was observed.
fn error(observed: &Observation, specimen: &dyn Brdf) -> f64 {
    let pose = Pose {
        light: ArmAngle::from_rad((observed.deviation - observed.theta_r.sin()).asin()),
        sensor: ArmAngle::from_rad(observed.theta_r),
    };
    let truth = specimen.eval(pose.incident(), pose.exitant()).y;
    (observed.rgb.y / truth - 1.0).abs()
}

fn seconds(records: &[Record]) -> f64 {
    let ticks = |record: &Record| match record {
        Record::Begin { device_ticks, .. } => Some(*device_ticks),
        Record::End { device_ticks, .. } => *device_ticks,
        _ => None,
    };
    let times: Vec<u64> = records.iter().filter_map(ticks).collect();
    (times[times.len() - 1] - times[0]) as f64 * 1e-5
}

#[tokio::test(start_paused = true)]
async fn a_flight_is_as_true_as_stopping_in_a_third_of_the_time() {
    let fly = PAPER.replace("mode = \"step\"", "mode = \"fly\"");
    let materials = ["gold-paint", "chrome", "alum-bronze", "nickel"];
    // What play does to the angles, which no reading here tells, is another thing in step than there and back.
    let servos = [(FINE_SERVOS, 1.05), ("", 1.15)];
    let each = materials
        .iter()
        .flat_map(|name| servos.map(|servos| (name, servos)));
    for (name, (servos, worse)) in each {
        let specimen = brdf::specimen(name).unwrap();
        let [stepped, flown] = [
            score(&specimen, PAPER, servos).await,
            score(&specimen, &fly, servos).await,
        ];
        for (mode, s) in [("stepped", &stepped), ("flown", &flown)] {
            println!(
                "{name} {mode}: {:.1} s, errors rms {:.2} %, median {:.2} %, MALE {:.5}",
                s.seconds,
                100.0 * s.rms,
                100.0 * s.median,
                s.male
            );
        }
        assert!(
            flown.seconds * 3.0 < stepped.seconds && flown.seconds < 40.0,
            "{name}"
        );
        // A reading that is passed once has less light than one at rest, in the dark no more than anybody feels; what is made
        // of all of them is as true.
        assert!(flown.rms < (worse * stepped.rms).max(NOISY), "{name}");
        assert!(flown.male < worse * stepped.male, "{name}");
    }
}
