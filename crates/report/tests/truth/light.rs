//! Light of the room: true where it is steady, told where it is not.

use capture::Record;
use report::{Verdict, judge, measurements};

use crate::bench::Laboratory;

const JOB: &str = "[[plane]]\ntheta_r_deg = 45\nreadings = 30\n[arc]\nreadings = 20";

struct Seen {
    /// Readings that are further from the truth than their expanded uncertainty, thrice.
    wrong: usize,
    readings: usize,
    dark: Verdict,
}

/// Measures a black rubber under a light of the room, which ends true or is told by the check of the dark level.
async fn measure(sim: &str) -> Seen {
    let laboratory = Laboratory::new(&format!("[sim]\n{sim}"));
    let specimen = brdf::specimen("black-soft-plastic").or_else(|_| brdf::specimen("blue-rubber"));
    let specimen = specimen.expect("a known specimen");
    let records: Vec<Record> = laboratory.measure(specimen.clone(), JOB).await;
    let all = measurements(&records, &laboratory.file);
    let lit: Vec<_> = all
        .iter()
        .filter(|m| m.reading.lamp && m.reading.accepted)
        .collect();
    let wrong = lit.iter().filter(|m| {
        let (Some(f), Some(u)) = (m.rgb(), m.u) else {
            return false;
        };
        let truth = specimen.eval(m.pose.incident(), m.pose.exitant());
        ((f - truth).abs() - 3.0 * u).max_element() > 0.0
    });
    let (_, checks) = judge(&records).expect("a sound journal");
    let dark = checks
        .iter()
        .find(|check| check.name == "dark level")
        .expect("there is such a check");
    println!("{sim}: {}", dark.text);
    Seen {
        wrong: wrong.count(),
        readings: lit.len(),
        dark: dark.verdict,
    }
}

#[tokio::test(start_paused = true)]
async fn a_steady_light_is_subtracted_and_a_dark_room_is_good() {
    for sim in [
        "",
        "room_light_per_sr = 0.0003",
        "room_light_per_sr = 0.003",
        "room_light_per_sr = 0.03",
    ] {
        let seen = measure(sim).await;
        assert_eq!(
            (seen.wrong, seen.dark),
            (0, Verdict::Good),
            "{sim}, of {}",
            seen.readings
        );
    }
}

#[tokio::test(start_paused = true)]
async fn a_light_that_comes_on_during_the_run_is_told() {
    let mut wrong = 0;
    for (at_s, per_sr, flicker_hz) in [
        (4.0, 0.001, 0.0),
        (6.0, 0.01, 0.0),
        (8.0, 0.1, 0.0),
        (6.0, 0.01, 100.0),
    ] {
        let seen = measure(&format!(
            "fault = [{{ device = \"photometer\", at_s = {at_s}, what = {{ room_light = {{ per_sr = {per_sr}, flicker_hz = {flicker_hz}, for_s = 1000 }} }} }}]"
        ))
        .await;
        wrong += seen.wrong;
        assert_eq!(seen.dark, Verdict::Bad, "at {at_s} s, {per_sr} sr⁻¹");
    }
    assert!(wrong > 0, "nothing was wrong: no test");
}
