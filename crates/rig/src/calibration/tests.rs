use arms::Pose;
use proptest::prelude::*;

use super::*;
use crate::{Counts, Exposure, RigFile};

const RESPONSIVITY: [f64; 3] = [1.0, 2.0, 0.5];
const MONITOR: f64 = 5.0;

fn file(more: &str) -> RigFile {
    let text = format!("[calibration]\nresponsivity = [1.0, 2.0, 0.5]\n{more}");
    RigFile::parse(&text, "test.toml".as_ref()).expect("a good rig file")
}

fn counts(rgb: [u32; 3], monitor: u32, gain: Gain) -> Counts {
    Counts {
        rgb,
        monitor,
        exposure: Exposure {
            integration_us: 10_000,
            gain,
        },
        saturated: false,
        sequence: 1,
        ticks: 0,
        temperature_c: 25,
    }
}

fn taken(pose: Pose, lamp: bool, counts: Counts) -> Taken {
    Taken {
        pose,
        time_s: 0.0,
        lamp,
        counts,
    }
}

/// Dark readings of nothing, at every gain.
fn nothing() -> Vec<Taken> {
    let dark = |gain| taken(Pose::default(), false, counts([0; 3], 0, gain));
    Gain::ALL.map(dark).to_vec()
}

fn reflectance(file: &RigFile, darks: &[Taken], pose: Pose, counts: Counts) -> Result<[f64; 3], Unusable> {
    let reduction = Reduction::new(file, None, darks, &[]);
    reduction
        .reflectance(&taken(pose, true, counts))
        .map(|reflectance| reflectance.rgb)
}

#[test]
fn a_known_signal_is_a_known_reflectance() {
    let over = file("");
    let reading = counts([5_000, 10_000, 2_500], 50_000, Gain::X1);
    let normal = Pose::from_deg(0.0, 60.0);
    assert_eq!(
        reflectance(&over, &nothing(), normal, reading),
        Ok([0.5, 0.5, 0.5])
    );
    let aslant = Pose::from_deg(-60.0, 0.0);
    let f = reflectance(&over, &nothing(), aslant, reading).unwrap();
    assert!((f[0] - 1.0).abs() < 1e-12, "overfilled divides by cos θ_i: {f:?}");
    let f = reflectance(&file("filling = \"under\""), &nothing(), normal, reading).unwrap();
    assert!(
        (f[0] - 1.0).abs() < 1e-12,
        "underfilled divides by cos θ_o: {f:?}"
    );
    let amplified = counts([5_000, 10_000, 2_500], 50_000, Gain::X16);
    let f = reflectance(&over, &nothing(), normal, amplified).unwrap();
    assert!((f[0] - 0.5 / 16.0).abs() < 1e-15);
}

#[test]
fn a_lamp_at_half_output_does_not_darken_the_specimen() {
    let pose = Pose::from_deg(-30.0, 40.0);
    let full = counts([8_000; 3], 50_000, Gain::X1);
    let half = counts([4_000; 3], 25_000, Gain::X1);
    let f = [full, half].map(|c| reflectance(&file(""), &nothing(), pose, c).unwrap());
    assert_eq!(f[0], f[1]);
}

#[test]
fn what_says_nothing_is_refused() {
    let rig = file("");
    let pose = Pose::from_deg(-30.0, 40.0);
    let good = counts([8_000; 3], 50_000, Gain::X1);
    let saturated = Counts {
        saturated: true,
        ..good
    };
    let at = |pose, counts| reflectance(&rig, &nothing(), pose, counts);
    assert_eq!(at(pose, saturated), Err(Unusable::Saturated));
    for light in [-90.0, 90.0, 89.95, f64::NAN] {
        let grazing = Pose::from_deg(light, 40.0);
        assert_eq!(at(grazing, good), Err(Unusable::Grazing), "{light}°");
    }
    assert!(at(Pose::from_deg(89.9, 40.0), good).is_ok());
    for monitor in [0, 499] {
        assert_eq!(
            at(pose, counts([8_000; 3], monitor, Gain::X1)),
            Err(Unusable::Lamp)
        );
    }
    assert_eq!(
        at(pose, counts([8_000; 3], rig.photometer.full_scale, Gain::X1)),
        Err(Unusable::Monitor)
    );
    let one_gain = [taken(pose, false, counts([10; 3], 10, Gain::X1))];
    let other = counts([8_000; 3], 50_000, Gain::X256);
    assert_eq!(
        reflectance(&rig, &one_gain, pose, other),
        Err(Unusable::Dark(Gain::X256))
    );
}

#[test]
fn a_black_specimen_may_come_out_negative() {
    let pose = Pose::from_deg(0.0, 40.0);
    let dark = [taken(pose, false, counts([100; 3], 10, Gain::X1))];
    let reading = counts([95, 100, 105], 50_010, Gain::X1);
    let f = reflectance(&file(""), &dark, pose, reading).unwrap();
    assert!(f[0] < 0.0 && f[1] == 0.0 && f[2] > 0.0, "{f:?}");
}

#[test]
fn without_a_monitor_the_lamp_is_followed_by_visits() {
    let rig = file("lamp = \"visits\"");
    let pose = Pose::from_deg(-45.0, 0.0);
    let at = |time_s, rgb| Taken {
        time_s,
        ..taken(pose, true, counts([rgb; 3], 0, Gain::X1))
    };
    let visits = [at(0.0, 10_000), at(100.0, 9_000), at(200.0, 9_000)];
    let mut readings = nothing();
    readings.extend(visits);
    let reduction = Reduction::new(&rig, None, &readings, &visits);
    // Half way the lamp is at 95 %, and so is what it lights.
    let [first, half] = [at(0.0, 8_000), at(50.0, 7_600)].map(|t| reduction.reflectance(&t).unwrap());
    assert!(
        (first.rgb[0] / half.rgb[0] - 1.0).abs() < 1e-12,
        "{first:?} {half:?}"
    );
    let quarter = 0.1 / 4.0 / 3f64.sqrt() / 0.95;
    let u = half.u.drift[0] / half.rgb[0];
    assert!(
        u > quarter && u < 1.1 * quarter,
        "{u}, the bend alone is {quarter}"
    );
    assert!(first.u.drift[0] < half.u.drift[0]);
}

#[test]
fn a_ladder_tells_gains_and_linearity() {
    let rig = file("");
    let (gains, k) = ([1.0, 15.8, 259.0], 0.01);
    let full = f64::from(rig.photometer.full_scale);
    let pose = Pose::from_deg(-45.0, 0.0);
    let ladder: Vec<Taken> = Gain::ALL
        .into_iter()
        .flat_map(|gain| (1..=9).map(move |i| (gain, f64::from(i) / 10.0)))
        .map(|(gain, share)| {
            // The green channel reaches the share.
            let integration_us = (share * full / (100.0 * gains[gain as usize])).round() as u32;
            let shown = |rate: f64| {
                let s = rate * gains[gain as usize] * f64::from(integration_us);
                (s * (1.0 - k * s / full)).round() as u32
            };
            let counts = Counts {
                rgb: [shown(50.0), shown(100.0), shown(25.0)],
                monitor: (MONITOR * f64::from(integration_us)).round() as u32,
                exposure: Exposure { integration_us, gain },
                ..counts([0; 3], 0, gain)
            };
            taken(pose, true, counts)
        })
        .collect();
    let mut readings = nothing();
    readings.extend(&ladder);
    let certified = Certified {
        pose,
        reflectance_factor: [0.98; 3],
    };
    let before = Certificate::default();
    let white = White::measure(
        &rig,
        &readings,
        &ladder,
        &[(certified, ladder.clone())],
        0.002,
        &before,
    )
    .unwrap();
    for (found, gain) in white.gains.into_iter().zip(gains) {
        assert!((found / gain - 1.0).abs() < 3e-4, "{:?}", white.gains);
    }
    assert!((white.nonlinearity - k).abs() < 3e-4, "{}", white.nonlinearity);
    let expected = 50.0 / (0.98 / std::f64::consts::PI * 45f64.to_radians().cos());
    assert!(
        (white.responsivity[0] / expected - 1.0).abs() < 1e-3,
        "{:?}",
        white.responsivity
    );
    assert!(white.u_responsivity[0] >= 0.002);
    assert!(White::measure(&rig, &readings, &ladder[..1], &[], 0.0, &Certificate::default()).is_err());
}

#[test]
fn a_mirror_tells_the_sum_of_the_zeros() {
    let rig = file("");
    let offset = 0.13f64.to_radians();
    let scan = |sensor_deg: f64| -> Vec<Taken> {
        (-20..=20)
            .map(|i| {
                let pose = Pose::from_deg(-sensor_deg + 0.1 * f64::from(i) + 0.003, sensor_deg);
                let sum = pose.light.rad() + pose.sensor.rad() + 2.0 * offset;
                let f = 1e6 * (-(sum / 0.01).powi(2)).exp() * pose.light.rad().cos();
                taken(pose, true, counts([f as u32; 3], 50_000, Gain::X1))
            })
            .collect()
    };
    let zero = Zero::measure(&rig, &nothing(), &[scan(30.0), scan(60.0)]).unwrap();
    assert!(
        (zero.offset_rad - offset).abs() < 1e-4,
        "{}°",
        zero.offset_rad.to_degrees()
    );
    let flat = taken(
        Pose::from_deg(-30.0, 30.0),
        true,
        counts([5; 3], 50_000, Gain::X1),
    );
    let error = Zero::measure(&rig, &nothing(), &[vec![flat; 3]])
        .unwrap_err()
        .to_string();
    assert!(error.contains("is it a mirror"), "{error}");
}

#[test]
fn a_colour_matrix_undoes_cross_talk() {
    let mixed = |[r, g, b]: [f64; 3]| {
        [
            0.9 * r + 0.1 * g,
            0.05 * r + 0.9 * g + 0.05 * b,
            0.2 * g + 0.8 * b,
        ]
    };
    let patches = [[0.8, 0.1, 0.1], [0.1, 0.7, 0.2], [0.1, 0.1, 0.6], [0.9, 0.9, 0.9]];
    let patches = patches.map(|rgb| Patch {
        name: String::new(),
        sensor: mixed(rgb),
        rgb,
    });
    let colour = Colour::measure(&patches).unwrap();
    assert!(colour.residual < 1e-12, "{colour:?}");
    let sensor = mixed([0.3, 0.5, 0.2]);
    let red: f64 = (0..3).map(|a| colour.matrix[0][a] * sensor[a]).sum();
    assert!((red - 0.3).abs() < 1e-12);
    assert!(
        Colour::measure(&[3, 3, 3].map(|i: usize| patches[i].clone())).is_err(),
        "one colour thrice"
    );
}

/// The counts of an exposure of a light that gives `rates` counts per µs at ×1; what is beyond full scale is cut off.
fn exposed(file: &RigFile, rates: [f64; 3], integration_us: u32, gain: Gain) -> Taken {
    let time_us = f64::from(integration_us);
    let full_scale = file.photometer.full_scale;
    let rgb = rates.map(|rate| ((rate * time_us * gain.factor()).round() as u32).min(full_scale));
    let counts = Counts {
        rgb,
        monitor: (MONITOR * time_us).round() as u32,
        exposure: Exposure { integration_us, gain },
        saturated: rgb.contains(&full_scale),
        ..counts([0; 3], 0, gain)
    };
    taken(Pose::from_deg(0.0, 40.0), true, counts)
}

#[test]
fn overlapping_exposures_are_averaged_by_inverse_variance() {
    let rig = file("");
    let reduction = Reduction::new(&rig, None, &nothing(), &[]);
    // The second one is a little lower, so that the weights show.
    let pair = [
        exposed(&rig, [0.2, 0.4, 0.1], 20_000, Gain::X1),
        exposed(&rig, [0.198, 0.396, 0.099], 50_000, Gain::X16),
    ];
    let [short, long] = pair.map(|one| reduction.reflectance(&one).unwrap());
    let both = reduction.combined(&pair).unwrap();
    assert_eq!((short.exposures, both.exposures), (1, 2));
    for c in 0..3 {
        let (a, b) = (short.u.counting[c], long.u.counting[c]);
        let u = a.recip().hypot(b.recip()).recip();
        assert!((both.u.counting[c] / u - 1.0).abs() < 0.01, "{both:?}, not {u}");
        let mean = u * u * (short.rgb[c] / (a * a) + long.rgb[c] / (b * b));
        let apart = short.rgb[c] - long.rgb[c];
        assert!((both.rgb[c] - mean).abs() < 0.02 * apart, "{both:?}, not {mean}");
        // The dark level and the reference are as wrong in one as in the other.
        let dark = [short.u.dark[c], long.u.dark[c]];
        assert!(both.u.dark[c] >= dark[1] && both.u.dark[c] <= dark[0], "{both:?}");
        let relative = |of: Reflectance| of.u.reference[c] / of.rgb[c];
        assert!((relative(both) / relative(short) - 1.0).abs() < 1e-12, "{both:?}");
        assert_eq!(both.u.stray[c], short.u.stray[c]);
    }
}

#[test]
fn a_channel_at_full_scale_is_taken_from_the_other_exposure_alone() {
    let rig = file("");
    let reduction = Reduction::new(&rig, None, &nothing(), &[]);
    let rates = [300.0, 300.0, 0.3];
    let short = exposed(&rig, rates, 1_000, Gain::X1);
    let long = exposed(&rig, rates, 100_000, Gain::X1);
    assert!(long.counts.saturated);
    assert_eq!(reduction.reflectance(&long), Err(Unusable::Saturated));
    let alone = reduction.reflectance(&short).unwrap();
    for order in [[short, long], [long, short]] {
        let both = reduction.combined(&order).unwrap();
        assert!((both.rgb[0] / alone.rgb[0] - 1.0).abs() < 1e-12, "{both:?}");
        assert!((both.u.counting[0] / alone.u.counting[0] - 1.0).abs() < 1e-12);
        assert!(
            (both.rgb[2] / (0.3 / RESPONSIVITY[2]) - 1.0).abs() < 1e-4,
            "{both:?}"
        );
        assert!(both.u.counting[2] < 0.1 * alone.u.counting[2], "{both:?}");
    }
    // What is full in every exposure stays unknown, and one that is all full says nothing of the others.
    assert_eq!(reduction.combined(&[long, long]), Err(Unusable::Saturated));
    let blind = exposed(&rig, [300.0; 3], 100_000, Gain::X1);
    assert_eq!(reduction.combined(&[blind, short]), Ok(alone));
    assert_eq!(reduction.combined(&[blind]), Err(Unusable::Saturated));
    // Full, and it does not say which channel.
    let unsure = Taken {
        counts: Counts {
            saturated: true,
            ..short.counts
        },
        ..short
    };
    assert_eq!(reduction.combined(&[unsure]), Err(Unusable::Saturated));
}

proptest! {
    /// Counts made of a reflectance by the formula, rounded, give it back within the rounding.
    #[test]
    fn prop_reflectance_inverts_the_signal(
        f in 1e-3f64..10.0, light in -85.0f64..85.0, gain in 0usize..3, time_us in 100u32..100_000,
        lamp in 0.5f64..1.5, offset in 0.0f64..200.0, rate in 0.0f64..0.01,
    ) {
        let gain = Gain::ALL[gain];
        let pose = Pose::from_deg(light, 0.0);
        let signal = |t: f64, c: usize, lit: f64| {
            let per_us = RESPONSIVITY[c] * gain.factor() * f * pose.light.rad().cos() * lamp * lit + rate;
            (offset + per_us * t).round() as u32
        };
        let take = |time_us: u32, lit: f64| {
            let t = f64::from(time_us);
            Counts {
                rgb: std::array::from_fn(|c| signal(t, c, lit)),
                monitor: (MONITOR * lamp * lit * t).round() as u32,
                exposure: Exposure { integration_us: time_us, gain },
                ..counts([0; 3], 0, gain)
            }
        };
        let darks = [take(100, 0.0), take(100_000, 0.0)].map(|dark| taken(pose, false, dark));
        let reading = take(time_us, 1.0);
        let rig = file("");
        let back = reflectance(&rig, &darks, pose, reading).unwrap();
        let dark = Darks::fit(&darks, rig.photometer.full_scale).counts(0.0, reading.exposure).unwrap().rgb;
        for (c, back) in back.into_iter().enumerate() {
            // Half a count in the reading, one in the dark line, half a monitor count.
            let net = f64::from(reading.rgb[c]) - dark[c];
            let bound = 2.0 / net.max(0.5) + 1.0 / f64::from(reading.monitor);
            prop_assert!((back / f - 1.0).abs() < bound * 1.5, "{back} for {f}, channel {c}");
        }
    }
}
