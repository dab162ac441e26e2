//! Whether what is stated of readings holds on servos as they are: rigs that are drawn from the imperfections of real ones.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use capture::Outcome;
use pdv::metric::quantile;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use report::measurements;
use sweep::Sweep;

use crate::bench::Laboratory;

const MATERIALS: [&str; 5] = ["gold-paint", "nickel", "blue-rubber", "alum-bronze", "chrome"];
const STEP: &str = "[[plane]]\ntheta_r_deg = 20\nreadings = 14\n[[plane]]\ntheta_r_deg = 45\nreadings = 14\n\
                    [[plane]]\ntheta_r_deg = 70\nreadings = 14\n[arc]\nreadings = 8\n";
const FLY: &str = "[[plane]]\ntheta_r_deg = 20\nreadings = 30\n[[plane]]\ntheta_r_deg = 45\nreadings = 30\n\
                   [[plane]]\ntheta_r_deg = 70\nreadings = 30\n[arc]\nreadings = 20\n[sweep]\nmode = \"fly\"\n";
/// Rigs of each material and mode.
const RIGS: u64 = 10;

/// A rig file whose simulated servos are decent ones of the X series, and in a sixth of the rigs each as bad as is found on
/// benches in one respect or another.
fn rig(random: &mut impl Rng) -> String {
    let mut sim = format!("[sim]\nseed = {}\n", random.random_range(1..1_000_000));
    let mut some = |key: &str, usual: &str, worse: &str| {
        let value = if random.random_bool(1.0 / 6.0) {
            worse
        } else {
            usual
        };
        writeln!(sim, "{key} = {value}").expect("a string takes all");
    };
    some("static_error_counts", "3.0", "5.0");
    some("stiction_counts", "0.0", "5.0");
    some(
        "hunting",
        "{ counts = 0.0, hz = 0.0 }",
        "{ counts = 2.0, hz = 10.0 }",
    );
    some("jitter_counts", "1.0", "2.0");
    some(
        "ring",
        "{ counts = 0.0, hz = 0.0, tau_s = 0.0 }",
        "{ counts = 20.0, hz = 6.0, tau_s = 0.4 }",
    );
    some("gravity_counts", "0.0", "8.0");
    some("following_lag_ms", "45.0", "150.0");
    some(
        "encoder_error",
        "{ amplitude_deg = 0.0, periods = 2.0 }",
        "{ amplitude_deg = 0.26, periods = 2.0 }",
    );
    let mut within = |most: f64| random.random_range(-most..most);
    let tilt_deg = within(0.3);
    for (key, value) in [
        ("light_backlash_deg", within(0.25).abs()),
        ("sensor_backlash_deg", within(0.25).abs()),
        ("light_zero_deg", tilt_deg),
        ("sensor_zero_deg", tilt_deg),
        // What [uncertainty] allows for, as standard uncertainties of rectangles.
        ("responsivity_error", within(0.0087)),
        ("gain_error", within(0.05)),
        ("nonlinearity", within(0.0087).abs()),
        ("crosstalk", within(0.12).abs()),
    ] {
        writeln!(sim, "{key} = {value}").expect("a string takes all");
    }
    let approach = ["none", "none", "up", "down"][random.random_range(0..4)];
    format!("[motion]\napproach = \"{approach}\"\n{sim}")
}

/// Share of errors that are within their expanded uncertainty.
fn share(of: &[f64]) -> f64 {
    of.iter().filter(|&&off| off <= 1.0).count() as f64 / of.len() as f64
}

/// Errors of readings in units of their expanded uncertainty, by material, mode and kind of sweep.
#[tokio::test(start_paused = true)]
async fn what_is_stated_of_readings_holds_on_a_hundred_rigs_with_servos_as_they_are() {
    let mut cells: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut refused = 0;
    for name in MATERIALS {
        let specimen = brdf::specimen(name).expect("a known specimen");
        for (mode, job) in [("step", STEP), ("fly", FLY)] {
            for seed in 0..RIGS {
                let laboratory = Laboratory::new(&rig(&mut ChaCha8Rng::seed_from_u64(seed)));
                let (outcome, records) = laboratory.attempt(specimen.clone(), job).await;
                if let Outcome::Failed { fault } = outcome {
                    println!("{name}, {mode}, seed {seed}: {fault}");
                    refused += 1;
                    continue;
                }
                let mut here: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
                for m in measurements(&records, &laboratory.file) {
                    let (Some(f), Some(u)) = (m.rgb(), m.u) else {
                        continue;
                    };
                    let kind = match m.reading.sweep {
                        Sweep::Plane(_) => "plane",
                        Sweep::Arc => "arc",
                        _ => continue,
                    };
                    if !m.reading.accepted || m.shadowed {
                        continue;
                    }
                    let truth = specimen.eval(m.pose.incident(), m.pose.exitant());
                    let off = ((f - truth) / u).abs();
                    let cell = cells.entry(format!("{name}, {mode}, {kind}")).or_default();
                    cell.extend(off.to_array());
                    here.entry(kind).or_default().extend(off.to_array());
                }
                for (kind, off) in here.iter().filter(|(_, off)| share(off) < 0.9) {
                    println!("{name}, {mode}, seed {seed}: {:.2} of the {kind}", share(off));
                }
            }
        }
    }
    let mut all: Vec<f64> = Vec::new();
    let mut worst = 1.0_f64;
    for (cell, off) in &cells {
        let held = share(off);
        let median = quantile(&mut off.clone(), 0.5).expect("readings");
        println!(
            "{cell}: {:.1} % of {}, median {median:.2} u",
            100.0 * held,
            off.len()
        );
        worst = worst.min(held);
        all.extend(off);
    }
    let held = share(&all);
    let median = quantile(&mut all.clone(), 0.5).expect("readings");
    println!("{refused} rigs were refused");
    println!(
        "all: {:.1} % of {}, median {median:.2} u",
        100.0 * held,
        all.len()
    );
    assert!(held >= 0.93, "{held} of all within k = 2");
    assert!(worst >= 0.9, "{worst} in the worst cell");
    assert!((0.15..=0.6).contains(&median), "median {median} u");
}
