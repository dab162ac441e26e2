use std::f64::consts::PI;
use std::sync::Arc;

use brdf::{Brdf, Lambert};
use capture::Record;
use glam::DVec3;
use report::{WhiteReference, measurements, model};
use rig::{Certified, RigFile};
use sweep::{Job, Sweep};

use crate::bench::{FINE_SERVOS, Laboratory};

/// The model takes the least for granted that a Lambertian specimen would not show: what is judged here is calibration.
const JOB: &str = "[reconstruction]\nmodel = \"separable\"\n[[plane]]\ntheta_r_deg = 45\nreadings = 60\ndistribution = \"uniform\"\n[arc]\nreadings = 40";
const ALBEDO: f64 = 0.5;
/// Time enough to collect light rather than amplify it: 0.02 % of noise at ×1, where ×256 has 0.28 %.
const PATIENT: &str = "[photometer]\nintegration_max_us = 10000000\n[uncertainty]\nplay_deg = 0.02\n\
                       [calibration]\nmonitor = 0.08\n";

/// A white reference that is none too white and no Lambertian, like sintered PTFE: darker the further both directions
/// are from the normal.
struct Ptfe;

impl Ptfe {
    fn factor(cos_i: f64, cos_o: f64) -> f64 {
        0.99 - 0.06 * (1.0 - cos_i) * (1.0 - cos_o) - 0.03 * ((1.0 - cos_i) + (1.0 - cos_o))
    }
}

impl Brdf for Ptfe {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        DVec3::splat(Self::factor(incident.z, exitant.z) / PI)
    }
}

/// Its certificate at some geometries, light and sensor in degrees.
fn certified(at: &[[f64; 2]]) -> WhiteReference {
    let geometry = |&[light, sensor]: &[f64; 2]| Certified {
        pose: arms::Pose::from_deg(light, sensor),
        reflectance_factor: [Ptfe::factor(light.to_radians().cos(), sensor.to_radians().cos()); 3],
    };
    WhiteReference {
        name: "PTFE".to_owned(),
        u: 0.002,
        certified: at.iter().map(geometry).collect(),
    }
}

/// Every imperfection there is of light and photometer, and with it what only a calibration finds.
const EVERYTHING: &str = "imperfections = \"default\"\nresponsivity_error = 0.07\ngain_error = 0.012\n\
     nonlinearity = 0.004\ncrosstalk = 0.05\nlamp_trend_per_h = -0.05\nlight_zero_deg = 0.12\n\
     sensor_zero_deg = 0.08\nstray_per_sr = 0.0005\n";

/// The largest relative error of the model of a Lambertian specimen over directions of 0 … 75°, in and out of plane.
fn worst(records: &[Record], file: &RigFile) -> f64 {
    let job = Job::parse(JOB, "job.toml").expect("the job above is sound");
    let all = measurements(records, file);
    let plane = report::observations(&all, Sweep::Plane(0));
    let arc = report::observations(&all, Sweep::Arc);
    let model = model(job.model, &[plane], &arc).expect("a captured plane and arc make a model");
    let truth = ALBEDO / PI;
    let at = |deg: f64, azimuth: f64| {
        let (sin, cos) = deg.to_radians().sin_cos();
        DVec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
    };
    let mut worst: f64 = 0.0;
    for i in 0..=15 {
        for o in 0..=15 {
            for azimuth in [0.0, 1.0, 2.0, PI] {
                let f = model.eval(at(5.0 * f64::from(i), azimuth), at(5.0 * f64::from(o), 0.0));
                worst = worst.max((f / truth - 1.0).abs().max_element());
            }
        }
    }
    worst
}

#[tokio::test(start_paused = true)]
async fn a_calibrated_rig_is_right_to_half_a_percent_with_every_imperfection() {
    for filling in ["over", "under"] {
        let text = format!("{PATIENT}filling = \"{filling}\"\n[sim]\n{FINE_SERVOS}{EVERYTHING}");
        let mut laboratory = Laboratory::new(&text);
        let specimen = || -> Arc<dyn Brdf> { Arc::new(Lambert::new(ALBEDO).unwrap()) };
        let before = worst(&laboratory.measure(specimen(), JOB).await, &laboratory.file);
        assert!(before > 0.05, "nothing to calibrate: {before}");
        let table = certified(&[[-45.0, 0.0], [-30.0, 30.0], [-60.0, 30.0], [-15.0, 60.0]]);
        laboratory.calibrate_all(&table, Arc::new(Ptfe)).await;
        let after = worst(&laboratory.measure(specimen(), JOB).await, &laboratory.file);
        println!(
            "{filling}: worst of 0 … 75° is off by {:.3} %, {:.1} % before",
            100.0 * after,
            100.0 * before
        );
        assert!(after < 0.005, "{filling}: {after}");
    }
}

#[tokio::test(start_paused = true)]
async fn one_certified_geometry_is_enough() {
    let mut laboratory = Laboratory::new(&format!("{PATIENT}[sim]\n{FINE_SERVOS}{EVERYTHING}"));
    laboratory
        .calibrate_all(&certified(&[[-45.0, 0.0]]), Arc::new(Ptfe))
        .await;
    let records = laboratory
        .measure(Arc::new(Lambert::new(ALBEDO).unwrap()), JOB)
        .await;
    let worst = worst(&records, &laboratory.file);
    assert!(worst < 0.005, "{worst}");
}

/// Slow arms, so that the run takes hours of rig time: a lamp that loses 5 % an hour, and a photometer that warms up so
/// much that its dark counts quadruple.
#[tokio::test(start_paused = true)]
async fn lamp_and_dark_drift_cost_less_than_a_percent() {
    // Without a monitor nothing sees what the lamp does faster than the visits come, nor between the calibration and the
    // run: the wobble about the trend is kept small there.
    let lamps = [("monitor", ""), ("visits", "lamp_drift = 0.001\n")];
    for (lamp, wobble) in lamps {
        let text = format!(
            "[motion]\nsettle_ms = 5000\ntimeout_ms = 10000\n{PATIENT}lamp = \"{lamp}\"\ndark_every_min = 3\n\
             reference_every_min = 1\n[sim]\n{FINE_SERVOS}{EVERYTHING}\ndark_counts_per_s = 2000\nself_heating_c = 16\n{wobble}"
        );
        let mut laboratory = Laboratory::new(&text);
        laboratory
            .calibrate_all(&certified(&[[-45.0, 0.0]]), Arc::new(Ptfe))
            .await;
        let records = laboratory
            .measure(Arc::new(Lambert::new(ALBEDO).unwrap()), JOB)
            .await;
        let all = measurements(&records, &laboratory.file);
        let hours = all.last().unwrap().time_s / 3600.0;
        let worst = worst(&records, &laboratory.file);
        println!(
            "{lamp}: worst of 0 … 75° is off by {:.3} % after {hours:.2} h",
            100.0 * worst
        );
        assert!(hours > 0.2, "{hours} h are no test of a drift");
        assert!(worst < 0.01, "{lamp}: {worst}");
    }
}
