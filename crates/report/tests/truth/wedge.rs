//! Whether what is read of a specimen on a wedge is true of its true directions.

use brdf::Brdf;
use pdv::{Draw, Placement, compare};
use report::{RunExport, measurements, readings_on_wedge, wedge_readings};

use crate::bench::Laboratory;

const FLAT: &str = "[[plane]]\ntheta_r_deg = 15\nreadings = 17\n[[plane]]\ntheta_r_deg = 60\nreadings = 17\n[arc]\nreadings = 6\n";
const ON_WEDGE: &str = "[[plane]]\ntheta_r_deg = 55\nreadings = 3\n[arc]\nreadings = 6\n";

fn on_wedge(tilt_deg: f64, azimuth_deg: f64) -> (String, Placement) {
    let text = format!("[sim]\nplace = {{ tilt_deg = {tilt_deg:?}, azimuth_deg = {azimuth_deg:?} }}\n");
    let place = Placement {
        azimuth: azimuth_deg.to_radians(),
        tilt: tilt_deg.to_radians(),
        axis: 0.0,
    };
    (text, place)
}

/// All imperfections on: a reading is as true on a wedge as it is flat, whatever fills the field of the sensor.
#[tokio::test(start_paused = true)]
async fn a_reading_on_a_wedge_is_true_of_its_true_directions() {
    for (name, filling) in [("white-fabric", "over"), ("blue-rubber", "under")] {
        let specimen = brdf::specimen(name).expect("a known specimen");
        for tilt_deg in [20.0, 45.0] {
            let (sim, place) = on_wedge(tilt_deg, 30.0);
            let rig = Laboratory::new(&format!("[calibration]\nfilling = \"{filling}\"\n{sim}"));
            let records = rig.measure(specimen.clone(), ON_WEDGE).await;
            let all = measurements(&records, &rig.file);
            let readings = wedge_readings(&all, &place, rig.file.calibration.filling);
            assert!(readings.len() >= 7, "{} readings of {name}", readings.len());
            for reading in &readings {
                let truth = specimen.eval(reading.incident, reading.exitant);
                let off = ((reading.rgb - truth) / truth).abs().max_element();
                // Towards grazing half a degree of play and zeros is a few percent of the cosine.
                let steep = reading.incident.z.min(reading.exitant.z);
                assert!(
                    off < 0.02 + 0.008 / steep,
                    "{name} on {tilt_deg}°: off by {off} at {reading:?}"
                );
            }
        }
    }
}

/// From the readings of three runs to a model that is nearer to the specimen, with all imperfections on.
#[tokio::test(start_paused = true)]
async fn a_model_is_nearer_to_a_specimen_that_also_lay_on_wedges() {
    let (mut before, mut after) = (0.0, 0.0);
    for name in ["white-fabric", "blue-rubber", "nylon", "gold-paint"] {
        let specimen = brdf::specimen(name).expect("a known specimen");
        let flat = Laboratory::new("");
        let records = flat.measure(specimen.clone(), FLAT).await;
        let mut readings = Vec::new();
        for tilt_deg in [20.0, 45.0] {
            let (sim, place) = on_wedge(tilt_deg, 0.0);
            let rig = Laboratory::new(&sim);
            let on_wedge = rig.measure(specimen.clone(), ON_WEDGE).await;
            readings.extend(readings_on_wedge(&on_wedge, &place).expect("a sound journal"));
        }
        let result = || RunExport::from_records(&records).expect("enough readings");
        let (plain, (corrected, check)) = (result(), result().corrected(&readings));
        let draw = Draw {
            pairs: 20_000,
            ..Draw::default()
        };
        let estimates: [&dyn Brdf; 2] = [plain.export().brdf, corrected.export().brdf];
        let found = compare(specimen.as_ref(), &estimates, &draw);
        let [plain, with] = [0, 1].map(|n| found[n].overall.male.expect("pairs were drawn"));
        println!("{name}: MALE {plain:.5}, with wedges {with:.5}; {check:?}");
        assert!(check.after < check.before, "{check:?}");
        before += plain;
        after += with;
    }
    assert!(after < before, "{after} instead of {before}");
}
