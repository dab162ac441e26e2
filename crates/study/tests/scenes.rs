//! What a job saves whose scene does not look at everything, at the same error inside of it.

use std::sync::Arc;

use brdf::{Brdf, Fitted};
use pdv::{Draw, Model, Within, compare, compare_within};
use rig::RigFile;
use study::measure;
use sweep::Job;

const SCENE: &str = "[scene]\ntheta_i_deg = [0, 60]\ntheta_o_deg = [0, 60]\n";
/// A job that names no sweep.
const OPEN: &str = "[reconstruction]\nmodel = \"planes\"\n";

/// A rig with good arms, whose file knows how good they are, and the pairs over which errors are means.
fn bench() -> (RigFile, Draw) {
    let rig = RigFile::parse(
        "[motion]\nlate_ms = 0\n[uncertainty]\nplay_deg = 0.02\nencoder_deg = 0.0\ntilt_deg = 0.0\n[sim]\nlight_backlash_deg = 0.02\nsensor_backlash_deg = 0.02\n\
         following_lag_ms = 8\nstatic_error_counts = 0\njitter_counts = 0\n",
        "rig.toml".as_ref(),
    )
    .expect("a good rig file");
    let draw = Draw {
        pairs: 20_000,
        ..Draw::default()
    };
    (rig, draw)
}

fn job(planes_deg: &[f64], readings: usize, scene: &str) -> Job {
    let plane = |deg: &f64| format!("[[plane]]\ntheta_r_deg = {deg:?}\nreadings = {readings}\n");
    let planes: String = planes_deg.iter().map(plane).collect();
    let rest = "[arc]\nreadings = 32\n[reconstruction]\nmodel = \"planes\"\n";
    Job::parse(&format!("{planes}{rest}{scene}"), "job.toml").expect("a good job")
}

/// Rig seconds that a job takes on a material, and the model of what it reads.
fn captured(job: &Job, rig: &RigFile, material: Fitted) -> (f64, Box<dyn Model>) {
    let measured = measure(job, rig, Arc::new(material)).expect("the rig can do it");
    let model = report::model(job.model, &measured.planes, &measured.arc).expect("enough readings");
    (measured.rig_s, model)
}

/// Below 60° rig time is saved, warm-up and dark readings counted, and the error inside is what it was: over six
/// materials of all kinds, with noise and all imperfections.
#[test]
fn below_60_degrees_less_time_buys_the_same_error() {
    let (rig, draw) = bench();
    for planes_deg in [
        &[20.0, 45.0, 70.0][..],
        &[10.0, 22.0, 35.0, 48.0, 60.0, 70.0, 80.0],
    ] {
        let mut sums = [[0.0; 2]; 2];
        for name in [
            "gold-paint",
            "blue-rubber",
            "alum-bronze",
            "pink-fabric",
            "chrome",
            "white-marble",
        ] {
            let material = Fitted::named(name).expect("a fitted material");
            let found = ["", SCENE].map(|scene| {
                let job = job(planes_deg, 32, scene);
                captured(&job, &rig, material)
            });
            let inside = self::job(planes_deg, 32, SCENE).scene.expect("it has one");
            for (sum, (rig_s, model)) in sums.iter_mut().zip(found) {
                let model: Box<dyn Model> = Box::new(Within::new(model, inside.clone()));
                let male = compare(&material, &[&model], &draw)[0]
                    .overall
                    .male
                    .expect("pairs are left");
                sum[0] += rig_s;
                sum[1] += male;
            }
        }
        let [whole, scene] = sums;
        println!(
            "{planes_deg:?}: {:?} s, MALE {:?}",
            [whole[0], scene[0]],
            [whole[1], scene[1]].map(|sum| sum / 6.0)
        );
        assert!(scene[0] < 0.95 * whole[0], "{} s of {} s", scene[0], whole[0]);
        assert!(scene[1] < 1.05 * whole[1], "{} instead of {}", scene[1], whole[1]);
    }
}

/// A job that leaves its sweeps to the program comes to the error that was asked for in less time where the error counts
/// in a scene alone: a quarter of the time at least, over materials of all kinds.
#[test]
fn below_60_degrees_the_same_target_is_reached_sooner() {
    let (rig, draw) = bench();
    let names = [
        "gold-paint",
        "blue-rubber",
        "alum-bronze",
        "pink-fabric",
        "chrome",
        "white-marble",
        "nylon",
        "purple-paint",
    ];
    let found = [0.001, 0.0005].map(|target| {
        // Rig seconds, and the error that is found in the scene.
        let mut sums = [[0.0; 2]; 2];
        for name in names {
            let material = Fitted::named(name).expect("a fitted material");
            for (sum, scene) in sums.iter_mut().zip(["", SCENE]) {
                let rest = format!("[sweep]\ntarget_male = {target}\nbudget_s = 120\n{scene}");
                let job = Job::parse(&format!("{OPEN}{rest}"), "job.toml").expect("a good job");
                let (rig_s, model) = captured(&job, &rig, material);
                let inside = self::job(&[45.0], 1, SCENE).scene.expect("it has one");
                let found = compare_within(&inside, &material, &[&model as &dyn Brdf], &draw)[0].overall;
                let male = found.male.expect("pairs are left");
                println!("{name}, {target}, {scene:?}: {rig_s:.1} s, {male:.5}");
                sum[0] += rig_s / names.len() as f64;
                sum[1] += male / names.len() as f64;
            }
        }
        let [whole, scene] = sums;
        println!("{target}: everything {whole:.5?}, the scene {scene:.5?}");
        assert!(scene[0] < 0.75 * whole[0], "{} s of {} s", scene[0], whole[0]);
        assert!(scene[1] < target, "{} in the scene", scene[1]);
        sums
    });
    // At the same error in the scene less is saved: there the whole is better than asked for.
    let ([whole, _], [_, scene]) = (found[0], found[1]);
    assert!(scene[1] < whole[1], "{} instead of {}", scene[1], whole[1]);
    assert!(scene[0] < 0.9 * whole[0], "{} s of {} s", scene[0], whole[0]);
}
