//! What a calibration rests on is judged before a certificate is made of it.

use std::sync::Arc;

use brdf::{Brdf, Lambert};
use capture::{Reading, Record};
use report::{Standard, Verdict, WhiteReference, judge};
use rig::{Certificate, Certified};
use sweep::Sweep;

use crate::bench::Laboratory;

const WHITE: f64 = 0.98;
const GEOMETRIES: [[f64; 2]; 3] = [[-45.0, 0.0], [-30.0, 30.0], [-60.0, 30.0]];

/// A perfectly diffuse white reference, whose table says so but for a share at one geometry.
fn white(wrong_by: f64) -> Standard {
    let certified = |(i, [light, sensor]): (usize, [f64; 2])| Certified {
        pose: arms::Pose::from_deg(light, sensor),
        reflectance_factor: [WHITE * if i == 1 { 1.0 + wrong_by } else { 1.0 }; 3],
    };
    Standard::White(WhiteReference {
        name: "diffuse".to_owned(),
        u: 0.002,
        certified: GEOMETRIES.into_iter().enumerate().map(certified).collect(),
    })
}

/// The standard, and what lies on the stage for it.
fn standards() -> [(Standard, Arc<dyn Brdf>); 3] {
    let simulated = |standard: &Standard| {
        let name = standard.simulated().expect("a standard that can be simulated");
        brdf::specimen(&name).expect("a known specimen")
    };
    [
        (Standard::Mirror, simulated(&Standard::Mirror)),
        (Standard::Trap, simulated(&Standard::Trap)),
        (
            white(0.0),
            Arc::new(Lambert::new(WHITE).expect("an albedo below 1")),
        ),
    ]
}

fn certify(standard: &Standard, laboratory: &Laboratory, records: &[Record]) -> Result<Certificate, String> {
    let certified = standard.certify(&laboratory.file, records, &laboratory.certificate);
    certified.map_err(|error| {
        format!(
            "{error}: {:?}",
            std::error::Error::source(&error).map(ToString::to_string)
        )
    })
}

/// The records with the readings of some steps changed.
fn spoiled(records: &[Record], mut spoil: impl FnMut(usize, &mut Reading)) -> Vec<Record> {
    let mut records = records.to_vec();
    let mut lit = 0;
    for record in &mut records {
        if let Record::Reading(reading) = record
            && reading.lamp
        {
            spoil(lit, reading);
            lit += 1;
        }
    }
    records
}

fn scaled(reading: &mut Reading, share: f64) {
    reading.counts.rgb = reading
        .counts
        .rgb
        .map(|counts| (f64::from(counts) * share) as u32);
}

#[tokio::test(start_paused = true)]
async fn sound_readings_make_a_certificate() {
    let laboratory = Laboratory::new("");
    for (standard, specimen) in standards() {
        let records = laboratory.visit(&standard, specimen).await;
        certify(&standard, &laboratory, &records).unwrap();
    }
}

#[tokio::test(start_paused = true)]
async fn light_that_comes_on_during_a_calibration_makes_none() {
    for (standard, specimen) in standards() {
        let dark = Laboratory::new("").visit(&standard, specimen.clone()).await;
        let ticks = |record: &Record| match record {
            Record::Reading(reading) if reading.lamp => Some(reading.device_ticks as f64 * 1e-5),
            _ => None,
        };
        let lit: Vec<f64> = dark.iter().filter_map(ticks).collect();
        let at_s = lit[lit.len() / 2];
        for per_sr in [0.005, 0.1] {
            let laboratory = Laboratory::new(&format!(
                "[sim]\nfault = [{{ device = \"photometer\", at_s = {at_s}, what = {{ room_light = {{ per_sr = {per_sr}, for_s = 1000 }} }} }}]"
            ));
            let records = laboratory.visit(&standard, specimen.clone()).await;
            let refused = certify(&standard, &laboratory, &records);
            assert!(refused.is_err(), "{standard:?}, {per_sr} sr⁻¹: {refused:?}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_white_reference_whose_readings_or_geometries_disagree_makes_none() {
    let laboratory = Laboratory::new("");
    let diffuse = || -> Arc<dyn Brdf> { Arc::new(Lambert::new(WHITE).unwrap()) };
    let records = laboratory.visit(&white(0.0), diffuse()).await;
    let of = |records: &[Record]| certify(&white(0.0), &laboratory, records);
    of(&records).unwrap();
    let mut visits = 0;
    let one = spoiled(&records, |_, reading| {
        visits += usize::from(reading.sweep == Sweep::Reference);
        if reading.sweep == Sweep::Reference && visits == 2 {
            scaled(reading, 0.9);
        }
    });
    let refused = of(&one).unwrap_err();
    assert!(refused.contains("from their mean"), "{refused}");
    for wrong_by in [0.2, -0.2] {
        let refused = certify(&white(wrong_by), &laboratory, &records).unwrap_err();
        assert!(refused.contains("table"), "{wrong_by}: {refused}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_trap_that_gives_less_than_nothing_makes_none() {
    let laboratory = Laboratory::new("");
    let (standard, specimen) = standards()[1].clone();
    let records = laboratory.visit(&standard, specimen).await;
    let less = spoiled(&records, |lit, reading| {
        if lit == 3 {
            reading.counts.rgb = [0; 3];
        }
    });
    certify(&standard, &laboratory, &records).unwrap();
    let refused = certify(&standard, &laboratory, &less).unwrap_err();
    assert!(refused.contains("less than no light"), "{refused}");
}

#[tokio::test(start_paused = true)]
async fn a_mirror_that_moved_makes_no_certificate() {
    let laboratory = Laboratory::new("");
    let (standard, specimen) = standards()[0].clone();
    let records = laboratory.visit(&standard, specimen).await;
    let sensor = spoiled(&records, |_, _| ());
    certify(&standard, &laboratory, &sensor).unwrap();
    let mut first = None;
    let moved = spoiled(&records, |_, reading| {
        // All of the first scan, whose sensor stands still.
        let of_first = *first.get_or_insert(reading.goal.sensor) == reading.goal.sensor;
        if of_first {
            reading.measured.light = arms::ArmAngle::from_deg(reading.measured.light.deg() + 1.2);
        }
    });
    let refused = certify(&standard, &laboratory, &moved).unwrap_err();
    assert!(refused.contains("moved"), "{refused}");
}

#[tokio::test(start_paused = true)]
async fn visits_that_do_not_agree_are_told() {
    const JOB: &str = "[[plane]]\ntheta_r_deg = 45\nreadings = 12\n[arc]\nreadings = 6";
    let laboratory = Laboratory::new("[calibration]\nlamp = \"visits\"\n");
    let specimen: Arc<dyn Brdf> = Arc::new(Lambert::new(0.5).unwrap());
    let records = laboratory.measure(specimen, JOB).await;
    for (share, full, expected) in [
        (1.0, false, Verdict::Good),
        (0.9, false, Verdict::Look),
        (0.5, false, Verdict::Bad),
        (2.0, false, Verdict::Bad),
        (1.0, true, Verdict::Look),
    ] {
        let mut visits = 0;
        let other = spoiled(&records, |_, reading| {
            if reading.sweep == Sweep::Reference {
                visits += 1;
                // The first is what the others are compared with.
                if visits == 2 {
                    scaled(reading, share);
                    if full {
                        reading.counts.rgb = [laboratory.file.photometer.full_scale; 3];
                        reading.counts.saturated = true;
                    }
                }
            }
        });
        assert!(visits >= 2, "{visits} visits");
        let (_, checks) = judge(&other).unwrap();
        let check = checks
            .iter()
            .find(|check| check.name == "reference visits")
            .unwrap();
        assert_eq!(check.verdict, expected, "{share}, {full}: {}", check.text);
    }
}
