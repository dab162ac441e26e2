use std::sync::LazyLock;

use super::*;
use crate::{Observation, Placement, Planes};
use brdf::{Fitted, Lambert, Spherical};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// What is corrected: two planes and an arc of gold paint.
static PLAIN: LazyLock<Planes> = LazyLock::new(|| {
    let gold = Fitted::named("gold-paint").unwrap();
    let read = |theta_r: f64, deviations: &[f64]| -> Vec<Observation> {
        let of = |&d: &f64| Observation::of(&gold, theta_r, d);
        deviations.iter().filter_map(of).collect()
    };
    let across = [-0.1, -0.03, 0.0, 0.03, 0.1, 0.3, 0.7];
    let arc = [0.1, 0.5, 0.9, 1.3].map(|theta| read(theta, &[0.0])).concat();
    Planes::from_observations(&[read(0.3, &across), read(1.0, &across)], &arc).unwrap()
});

fn corrected(readings: &[WedgeReading]) -> Corrected {
    Corrected::new(Box::new(PLAIN.clone()), readings)
}

fn direction() -> impl Strategy<Value = DVec3> {
    (0.0..1.55, 0.0..TAU).prop_map(|(theta, phi)| Spherical { theta, phi }.direction())
}

/// Readings on wedges of up to 60°, up to twenty times darker or brighter than the model, and some black or below.
fn readings() -> impl Strategy<Value = Vec<WedgeReading>> {
    let rgb = prop::array::uniform3(prop_oneof![8 => -3.0..3.0_f64, 1 => Just(f64::NEG_INFINITY)]);
    let one = (
        0.0..1.05,
        -1.0..1.0_f64,
        0.05..1.4_f64,
        rgb,
        prop::bool::weighted(0.05),
    );
    let reading = one.prop_filter_map("beyond 80°", |(tilt, m, delta, logs, below)| {
        let on = Placement {
            tilt,
            ..Placement::FLAT
        };
        let read = WedgeReading::of(&*PLAIN, &on, m - delta, m + delta)?;
        if read.incident.z.min(read.exitant.z) < LEAST_COSINE {
            return None;
        }
        let factor = DVec3::from_array(logs.map(f64::exp));
        let noise = if below { 1e-3 } else { 0.0 };
        Some(WedgeReading {
            rgb: read.rgb * factor - noise,
            ..read
        })
    });
    prop::collection::vec(reading, 0..12)
}

/// Sum over readings and channels of squared ln(f/f̂), as it is believed.
fn left(model: &dyn Brdf, readings: &[WedgeReading]) -> f64 {
    let miss = |reading: &WedgeReading| {
        let (found, plain) = (
            model.eval(reading.incident, reading.exitant),
            PLAIN.eval(reading.incident, reading.exitant),
        );
        let channel = |c: usize| {
            let asked = (reading.rgb[c].max(LEAST) / plain[c]).ln().clamp(-MOST, MOST);
            (asked - (found[c] / plain[c]).ln()).powi(2)
        };
        (0..3).map(channel).sum::<f64>()
    };
    readings.iter().map(miss).sum()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn prop_a_corrected_model_is_reciprocal_positive_and_within_its_bounds(
        readings in readings(), incident in direction(), exitant in direction(),
    ) {
        let model = corrected(&readings);
        let found = model.eval(incident, exitant);
        prop_assert_eq!(found, model.eval(exitant, incident));
        let plain = PLAIN.eval(incident, exitant);
        let log = (found / plain).map(f64::ln);
        prop_assert!(found.is_finite() && found.min_element() > 0.0, "{}", found);
        prop_assert!(log.abs().max_element() <= MOST + 1e-12, "{}", log);
        let mut all = [[0.0; 3]];
        model.eval_all(&[incident.to_array()], &[exitant.to_array()], &mut all);
        prop_assert_eq!(DVec3::from_array(all[0]), found);
    }

    #[test]
    fn prop_the_plane_stays_as_it_was_read(readings in readings(), light in -1.55..1.55_f64, sensor in -1.55..1.55_f64) {
        let (incident, exitant) = Placement::FLAT.pair(light, sensor).unwrap();
        let found = corrected(&readings).eval(incident, exitant);
        prop_assert_eq!(found, PLAIN.eval(incident, exitant));
    }

    /// All readings together are no farther from the corrected model, and what it says of itself is true.
    #[test]
    fn prop_the_readings_are_approached(readings in readings()) {
        let model = corrected(&readings);
        let (before, after) = (left(&*PLAIN, &readings), left(&model, &readings));
        prop_assert!(after <= before * (1.0 + 1e-9), "{} from {}", after, before);
        let check = model.check();
        prop_assert_eq!(check.readings + check.dropped, readings.len());
        prop_assert_eq!(check.before.is_some(), check.readings > 0);
        if let (Some(before), Some(after)) = (check.before, check.after) {
            prop_assert!(before <= MOST && after.is_finite());
        }
    }

    /// What the model says already changes nothing, and neither do readings in the plane.
    #[test]
    fn prop_nothing_new_changes_nothing(readings in readings(), incident in direction(), exitant in direction()) {
        let plain = PLAIN.eval(incident, exitant);
        let agreed = readings.iter().map(|reading| WedgeReading {
            rgb: PLAIN.eval(reading.incident, reading.exitant),
            ..*reading
        });
        let model = corrected(&agreed.collect::<Vec<_>>());
        prop_assert_eq!(model.eval(incident, exitant), plain);
        let flat = [0.2, 0.9].map(|delta| WedgeReading::of(&Lambert::new(0.9).unwrap(), &Placement::FLAT, -delta, 0.5));
        let model = corrected(&flat.map(Option::unwrap));
        prop_assert_eq!(model.eval(incident, exitant), plain);
        prop_assert_eq!(model.check(), Check { readings: 0, dropped: 2, before: None, foretold: None, after: None });
    }

    /// The order of the readings is nothing to it, and each channel is by itself.
    #[test]
    fn prop_channels_and_order_are_nothing_to_each_other(
        readings in readings(), incident in direction(), exitant in direction(),
    ) {
        let found = corrected(&readings).eval(incident, exitant);
        let reversed: Vec<_> = readings.iter().rev().copied().collect();
        let back = corrected(&reversed).eval(incident, exitant);
        prop_assert!((back / found - 1.0).abs().max_element() < 1e-9);
        let bluer = readings.iter().map(|reading| WedgeReading {
            rgb: reading.rgb * DVec3::new(1.0, 1.0, 2.0),
            ..*reading
        });
        let other = corrected(&bluer.collect::<Vec<_>>()).eval(incident, exitant);
        prop_assert_eq!((other.x, other.y), (found.x, found.y));
    }
}

/// A single reading is met by E² parts in E² + 0.01, as the formula has it.
#[test]
fn one_reading_is_met_as_far_as_it_is_believed() {
    let wedge = Placement {
        tilt: 45_f64.to_radians(),
        ..Placement::FLAT
    };
    let plain = WedgeReading::of(&*PLAIN, &wedge, -1.2, 1.2).unwrap();
    let brighter = WedgeReading {
        rgb: plain.rgb * 0.5_f64.exp(),
        ..plain
    };
    let model = corrected(&[brighter]);
    let out = (wedge.tilt.sin() * 1.2_f64.sin()).powi(2);
    let share = out * out / (out * out + 0.01);
    let found = (model.eval(plain.incident, plain.exitant) / plain.rgb).map(f64::ln);
    assert!(
        (found - 0.5 * share).abs().max_element() < 1e-9,
        "{found}, not {}",
        0.5 * share
    );
    let check = model.check();
    assert!((check.before.unwrap() - 0.5).abs() < 1e-9);
    assert!((check.after.unwrap() - 0.5 * (1.0 - share)).abs() < 1e-9);
    assert!((check.foretold.unwrap() - 0.5).abs() < 1e-9, "no other helps");
}

#[test]
fn what_cannot_be_used_is_dropped_and_a_black_model_stays_black() {
    let wedge = Placement {
        tilt: 0.5,
        ..Placement::FLAT
    };
    let good = WedgeReading::of(&*PLAIN, &wedge, -0.7, 0.7).unwrap();
    let bad = [
        WedgeReading {
            rgb: DVec3::new(1.0, f64::NAN, 1.0),
            ..good
        },
        WedgeReading {
            incident: DVec3::NAN,
            ..good
        },
        WedgeReading {
            exitant: -good.exitant,
            ..good
        },
        WedgeReading {
            rgb: 3.0 * good.rgb,
            ..WedgeReading::of(&*PLAIN, &wedge, 1.42, 0.0).unwrap()
        },
    ];
    let model = corrected(&bad);
    assert_eq!((model.check().readings, model.check().dropped), (0, 4));
    assert_eq!(model.eval(good.incident, good.exitant), good.rgb);
    let black = |deviation| Observation {
        theta_r: 0.5,
        deviation,
        rgb: DVec3::ZERO,
    };
    let black = Planes::from_observations(&[[-0.1, 0.0, 0.2].map(black).to_vec()], &[]).unwrap();
    let model = Corrected::new(Box::new(black), &[good]);
    assert_eq!(model.eval(good.incident, good.exitant), DVec3::ZERO);
    assert_eq!(model.check().before, None, "there is nothing to compare");
}
