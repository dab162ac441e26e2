use std::sync::Arc;

use brdf::Brdf;
use firmware_sim::Imperfections;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use report::measurements;

use crate::bench::Laboratory;

const JOB: &str = "[[plane]]\ntheta_r_deg = 50\nreadings = 40\n[arc]\nreadings = 20";
/// Rigs, each wrong in its own way.
const RIGS: u64 = 120;

/// Rigs whose constants are wrong by as much as their rig files admit: of all intervals at k = 2, 93 … 97 % must hold
/// the truth.
#[tokio::test(start_paused = true)]
async fn the_stated_intervals_hold_the_truth_as_often_as_they_should() {
    for name in ["gold-paint", "blue-rubber", "lambert:0.5"] {
        let specimen = brdf::specimen(name).unwrap();
        let (mut inside, mut all) = (0, 0);
        for seed in 0..RIGS {
            let (hits, of) = one(seed, specimen.clone()).await;
            inside += hits;
            all += of;
        }
        let share = f64::from(inside) / f64::from(all);
        println!("{name}: {:.2} % of {all} intervals hold the truth", 100.0 * share);
        assert!((0.93..=0.97).contains(&share), "{name}: {share}");
    }
}

/// How many of a run's intervals hold the truth, of how many.
async fn one(seed: u64, specimen: Arc<dyn Brdf>) -> (u32, u32) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    // The amounts of [uncertainty]; play and lobe-wide blur are systematic and have tests of their own.
    let text = format!(
        "[calibration]\nmonitor = 5.0\n[uncertainty]\nresponsivity_percent = 0.2\nangle_deg = 0.0\nzero_deg = 0.02\n\
         source_aperture_deg = 0.0\ndetector_aperture_deg = 0.0\n\
         [sim]\nseed = {}\nresponsivity_error = {}\nlight_zero_deg = {}\nsensor_zero_deg = {}\nstray_per_sr = {}\n\
         light_backlash_deg = 0.0\nsensor_backlash_deg = 0.0\nsource_aperture_deg = 0.0\ndetector_aperture_deg = 0.0\n",
        1000 + seed,
        0.002 * normal(),
        0.02 * normal(),
        0.02 * normal(),
        Imperfections::DEFAULT.stray_per_sr * normal().abs(),
    );
    let laboratory = Laboratory::new(&text);
    let records = laboratory.measure(specimen.clone(), JOB).await;
    let (mut inside, mut all) = (0, 0);
    for m in measurements(&records, &laboratory.file) {
        let (Some(f), Some(u)) = (m.rgb(), m.u) else {
            continue;
        };
        if !m.reading.accepted || m.shadowed {
            continue;
        }
        let truth = specimen.eval(m.pose.incident(), m.pose.exitant());
        let off = (f - truth).abs();
        for c in 0..3 {
            inside += u32::from(off[c] <= u[c]);
            all += 1;
        }
    }
    (inside, all)
}
