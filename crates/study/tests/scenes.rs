//! What a job saves whose scene does not look at everything, at the same error inside of it.

use std::sync::Arc;

use brdf::Fitted;
use pdv::{Draw, Model, Within, compare};
use rig::RigFile;
use study::measure;
use sweep::Job;

const SCENE: &str = "[scene]\ntheta_i_deg = [0, 60]\ntheta_o_deg = [0, 60]\n";

fn job(planes_deg: &[f64], readings: usize, scene: &str) -> Job {
    let plane = |deg: &f64| format!("[[plane]]\ntheta_r_deg = {deg:?}\nreadings = {readings}\n");
    let planes: String = planes_deg.iter().map(plane).collect();
    let rest = "[arc]\nreadings = 32\n[reconstruction]\nmodel = \"planes\"\n";
    Job::parse(&format!("{planes}{rest}{scene}"), "job.toml").expect("a good job")
}

/// Below 60° rig time is saved, warm-up and dark readings counted, and the error inside is what it was: over six
/// materials of all kinds, with noise and all imperfections.
#[test]
fn below_60_degrees_less_time_buys_the_same_error() {
    let rig = RigFile::parse(RigFile::BUILT_IN, "built-in".as_ref()).expect("a good rig file");
    let draw = Draw {
        pairs: 20_000,
        ..Draw::default()
    };
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
                let measured = measure(&job, &rig, Arc::new(material)).expect("the rig can do it");
                let model =
                    report::model(job.model, &measured.planes, &measured.arc).expect("enough readings");
                (measured.rig_s, model)
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
