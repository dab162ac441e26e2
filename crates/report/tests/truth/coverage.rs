use std::sync::Arc;

use brdf::Brdf;
use firmware_sim::Imperfections;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use report::measurements;
use sweep::Sweep;

use crate::bench::Laboratory;

const JOB: &str = "[[plane]]\ntheta_r_deg = 50\nreadings = 40\n[arc]\nreadings = 20";
/// Rigs, each wrong in its own way.
const RIGS: u64 = 120;

/// Where tan θ and a specimen's rise towards grazing both count, rad.
const GRAZING: f64 = 1.22;

/// Rigs whose constants are wrong by as much as their rig files admit: of all intervals at k = 2, 93 … 97 % must hold
/// the truth.
#[tokio::test(start_paused = true)]
async fn the_stated_intervals_hold_the_truth_as_often_as_they_should() {
    for name in ["gold-paint", "blue-rubber", "lambert:0.5"] {
        let specimen = brdf::specimen(name).unwrap();
        let [mut whole, mut grazing] = [Tally::default(); 2];
        for seed in 0..RIGS {
            one(seed, specimen.clone(), &mut whole, &mut grazing).await;
        }
        let [share, at_grazing] = [whole, grazing].map(Tally::share);
        println!(
            "{name}: {:.2} % of {} intervals hold the truth, of {} of the arc near grazing {:.2} %",
            100.0 * share,
            whole.all,
            grazing.all,
            100.0 * at_grazing
        );
        assert!((0.93..=0.97).contains(&share), "{name}: {share}");
        // Errors of one rig go together, and these are five readings of each.
        assert!(
            (0.9..0.995).contains(&at_grazing),
            "{name}, near grazing: {at_grazing}"
        );
    }
}

/// Intervals, and how many of them hold the truth.
#[derive(Clone, Copy, Default)]
struct Tally {
    inside: u32,
    all: u32,
}

impl Tally {
    fn count(&mut self, inside: bool) {
        self.inside += u32::from(inside);
        self.all += 1;
    }

    fn share(self) -> f64 {
        f64::from(self.inside) / f64::from(self.all)
    }
}

/// Counts a run's intervals, and those of the arc beyond [`GRAZING`] apart as well.
async fn one(seed: u64, specimen: Arc<dyn Brdf>, whole: &mut Tally, grazing: &mut Tally) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    // The amounts of [uncertainty]; play and lobe-wide blur are systematic and have tests of their own.
    let text = format!(
        "[calibration]\nmonitor = 5.0\n[uncertainty]\nresponsivity_percent = 0.2\ngain_percent = 0.1\n\
         nonlinearity_percent = 0.1\ncrosstalk_percent = 0.2\nangle_deg = 0.0\nplay_deg = 0.0\nencoder_deg = 0.0\ntilt_deg = 0.0\nzero_deg = 0.02\n\
         source_aperture_deg = 0.0\ndetector_aperture_deg = 0.0\n\
         [sim]\nseed = {}\nresponsivity_error = {}\nlight_zero_deg = {}\nsensor_zero_deg = {}\nstray_per_sr = {}\n\
         gain_error = {}\nnonlinearity = {}\ncrosstalk = {}\n\
         light_backlash_deg = 0.0\nsensor_backlash_deg = 0.0\nsource_aperture_deg = 0.0\ndetector_aperture_deg = 0.0\n",
        1000 + seed,
        0.002 * normal(),
        0.02 * normal(),
        0.02 * normal(),
        Imperfections::DEFAULT.stray_per_sr * normal().abs(),
        0.001 * normal(),
        0.001 * normal().abs(),
        0.002 * normal().abs(),
    );
    let laboratory = Laboratory::new(&text);
    let records = laboratory.measure(specimen.clone(), JOB).await;
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
            whole.count(off[c] <= u[c]);
            if m.reading.sweep == Sweep::Arc && m.theta_r > GRAZING {
                grazing.count(off[c] <= u[c]);
            }
        }
    }
}
