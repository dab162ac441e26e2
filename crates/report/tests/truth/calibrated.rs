//! What a mirror may take off the uncertainty of the arms' zeros.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use report::{Standard, measurements};

use crate::bench::{FINE_SERVOS, Laboratory};

const JOB: &str = "[[plane]]\ntheta_r_deg = 40\nreadings = 20\n[arc]\nreadings = 20";
/// Rigs, each with zeros of its own.
const RIGS: u64 = 40;
/// Standard uncertainty of an arm's zero, degrees.
const ZERO_DEG: f64 = 0.1;

/// Share of readings within their expanded uncertainty, k = 2, over rigs whose zeros are off by as much as their rig files
/// admit, and the root mean square of the errors over the standard uncertainties.
async fn readings(specimen: &str, mirror: bool) -> (f64, f64) {
    let specimen = brdf::specimen(specimen).expect("known");
    let (mut inside, mut squares, mut all) = (0.0, 0.0, 0.0);
    for seed in 0..RIGS {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut zero = || -> f64 { ZERO_DEG * Distribution::<f64>::sample(&StandardNormal, &mut random) };
        let mut laboratory = Laboratory::new(&format!(
            "[uncertainty]\nzero_deg = {ZERO_DEG}\nangle_deg = 0.0\nplay_deg = 0.0\nencoder_deg = 0.0\ntilt_deg = 0.0\nresponsivity_percent = 0.0\ngain_percent = 0.0\n\
             nonlinearity_percent = 0.0\ncrosstalk_percent = 0.0\nsource_aperture_deg = 0.0\n\
             detector_aperture_deg = 0.0\n[sim]\nseed = {seed}\nlight_zero_deg = {}\nsensor_zero_deg = {}\n\
             light_backlash_deg = 0.0\nsensor_backlash_deg = 0.0\nsource_aperture_deg = 0.0\n\
             detector_aperture_deg = 0.0\n",
            zero(),
            zero(),
        ));
        if mirror {
            let stands_for = Standard::Mirror.simulated().expect("known");
            let on_stage = brdf::specimen(&stands_for).expect("known");
            laboratory.calibrate(&Standard::Mirror, on_stage).await;
        }
        let records = laboratory.measure(specimen.clone(), JOB).await;
        for m in measurements(&records, &laboratory.file) {
            let (Some(f), Some(u)) = (m.rgb(), m.u) else {
                continue;
            };
            if !m.reading.accepted || m.shadowed {
                continue;
            }
            // At the pose that it is said to be of.
            let off = (f - specimen.eval(m.pose.incident(), m.pose.exitant())).abs();
            for c in 0..3 {
                inside += f64::from(u8::from(off[c] <= u[c]));
                squares += (2.0 * off[c] / u[c]).powi(2);
                all += 1.0;
            }
        }
    }
    (inside / all, f64::sqrt(squares / all))
}

#[tokio::test(start_paused = true)]
async fn after_a_mirror_errors_are_as_large_as_stated_and_no_larger() {
    for specimen in ["gold-paint", "blue-rubber"] {
        for mirror in [false, true] {
            let (inside, rms) = readings(specimen, mirror).await;
            println!(
                "{specimen}, mirror {mirror}: {:.1} % inside, errors {rms:.2} of their standard uncertainty",
                100.0 * inside
            );
            // Two zeros a rig: the share is known to some 3 %, the size of the errors to some 11 %.
            assert!(
                (0.88..0.995).contains(&inside),
                "{specimen}, mirror {mirror}: {inside}"
            );
            assert!((0.6..1.35).contains(&rms), "{specimen}, mirror {mirror}: {rms}");
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_mirror_leaves_the_difference_of_the_zeros_as_unsure_as_it_was() {
    let rig = format!("[sim]\n{FINE_SERVOS}light_zero_deg = 0.1\nsensor_zero_deg = -0.1\n");
    let mut laboratory = Laboratory::new(&rig);
    let before = laboratory.certificate.u_zero(&laboratory.file);
    let on_stage = brdf::specimen(&Standard::Mirror.simulated().expect("known")).expect("known");
    laboratory.calibrate(&Standard::Mirror, on_stage).await;
    let after = laboratory.certificate.u_zero(&laboratory.file);
    assert!(after.half_sum_rad < before.half_sum_rad, "{after:?}");
    assert_eq!(after.half_difference_rad, before.half_difference_rad);
    let zero = laboratory.certificate.zero.expect("it was measured");
    assert!(
        zero.offset_rad.abs() < 3.0 * zero.u_rad,
        "zeros that cancel: {zero:?}"
    );
}
