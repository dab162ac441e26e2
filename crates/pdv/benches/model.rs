//! Cost of the models in units of what they cannot do without, beside a trilinear lookup, and of filling a table.

use std::hint::black_box;
use std::time::Duration;

use brdf::{Brdf, Fitted, MerlTable, Spherical};
use criterion::{BenchmarkGroup, Criterion, measurement::WallTime};
use glam::DVec3;
use pdv::{Bivariate, Distribution, Observation, Planes, Sampler, Separable, spread};

fn model() -> Separable {
    let theta_r = 70.0_f64.to_radians();
    let range = theta_r.sin() - 85.0_f64.to_radians().sin()..=theta_r.sin() + 65.0_f64.to_radians().sin();
    let deviations = spread(Distribution::Capped, theta_r, &[range], 90, 1.5e-3).deviations;
    let arc: Vec<f64> = (0..90)
        .map(|n| (f64::from(n) * 85.0 / 89.0).to_radians())
        .collect();
    let gold = Fitted::named("gold-paint").expect("a fitted material");
    Separable::sample(&gold, theta_r, &deviations, &arc, 0.0).expect("poses exist")
}

/// Three planes and an arc.
fn sweeps() -> (Vec<Vec<Observation>>, Vec<Observation>) {
    let gold = Fitted::named("gold-paint").expect("a fitted material");
    let plane = |deg: f64| {
        let theta_r = deg.to_radians();
        let range = theta_r.sin() - 85.0_f64.to_radians().sin()..=theta_r.sin() + 85.0_f64.to_radians().sin();
        let spread = spread(Distribution::Lobe, theta_r, &[range], 30, 1.5e-3);
        let read = |&d: &f64| Observation::of(&gold, theta_r, d);
        spread.deviations.iter().filter_map(read).collect()
    };
    let arc = (0..30).filter_map(|n| Observation::of(&gold, f64::from(n) * 0.05, 0.0));
    ([20.0, 45.0, 70.0].map(plane).into(), arc.collect())
}

/// Pairs of directions, evenly in angle by a golden-ratio sequence.
fn pairs() -> Vec<(DVec3, DVec3)> {
    let fraction = |n: u32, ratio: f64| (f64::from(n) * ratio).fract();
    (0..1024)
        .map(|n| {
            let theta = fraction(n, 0.819_172_5) * 80.0_f64.to_radians();
            let phi = fraction(n, 0.671_043_6) * std::f64::consts::TAU;
            let exitant = fraction(n, 0.549_700_5) * 80.0_f64.to_radians();
            (
                Spherical { theta, phi }.direction(),
                Spherical {
                    theta: exitant,
                    phi: 0.0,
                }
                .direction(),
            )
        })
        .collect()
}

/// Runs a benchmark and gives the least of its seconds per iteration, the figure that other load disturbs least.
fn seconds(group: &mut BenchmarkGroup<'_, WallTime>, name: &str, mut run: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    group.bench_function(name, |bencher| {
        bencher.iter_custom(|iterations| {
            let start = std::time::Instant::now();
            for _ in 0..iterations {
                run();
            }
            let taken = start.elapsed();
            least = least.min(taken.as_secs_f64() / iterations as f64);
            taken
        });
    });
    least
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let model = model();
    let pairs = pairs();
    let logs: Vec<DVec3> = pairs
        .iter()
        .map(|&(incident, exitant)| model.eval(incident, exitant).map(f64::ln_1p))
        .collect();

    let mut group = criterion.benchmark_group("evaluation");
    let exponentials = seconds(&mut group, "three exp_m1, 1024 times", || {
        for log in &logs {
            let log = black_box(log);
            black_box(DVec3::new(log.x.exp_m1(), log.y.exp_m1(), log.z.exp_m1()));
        }
    });
    let evaluation = seconds(&mut group, "separable model, 1024 pairs", || {
        for pair in &pairs {
            let (incident, exitant) = black_box(pair);
            black_box(model.eval(*incident, *exitant));
        }
    });
    let (sides, arc) = sweeps();
    let bivariate = Bivariate::from_observations(&sides, &arc).expect("poses exist");
    let table = seconds(&mut group, "bivariate table, 1024 pairs", || {
        for pair in &pairs {
            let (incident, exitant) = black_box(pair);
            black_box(bivariate.eval(*incident, *exitant));
        }
    });
    let planes = Planes::from_observations(&sides, &arc).expect("poses exist");
    let reciprocal = seconds(&mut group, "model of planes, 1024 pairs", || {
        for pair in &pairs {
            let (incident, exitant) = black_box(pair);
            black_box(planes.eval(*incident, *exitant));
        }
    });
    let (lights, viewers): (Vec<[f64; 3]>, Vec<[f64; 3]>) = pairs
        .iter()
        .map(|(incident, exitant)| (incident.to_array(), exitant.to_array()))
        .unzip();
    let mut rgb = vec![[0.0; 3]; pairs.len()];
    let together = seconds(&mut group, "model of planes, 1024 pairs at once", || {
        planes.eval_all(black_box(&lights), black_box(&viewers), &mut rgb);
        black_box(&rgb);
    });
    let sampler = Sampler::new(&planes);
    let sampling = seconds(&mut group, "importance sample of planes, 1024 times", || {
        for (incident, exitant) in &pairs {
            // Two even numbers of what is at hand.
            let numbers = [0.5 + 0.5 * incident.x, 0.5 + 0.5 * incident.y].map(|n| n * 0.999);
            black_box(sampler.sample(black_box(*exitant), black_box(numbers)));
        }
    });
    let merl = MerlTable::fill(&planes);
    let lookup = seconds(&mut group, "trilinear MERL lookup, 1024 pairs", || {
        for pair in &pairs {
            let (incident, exitant) = black_box(pair);
            black_box(merl.eval(*incident, *exitant));
        }
    });
    group.finish();

    let mut group = criterion.benchmark_group("table");
    group.sample_size(10).measurement_time(Duration::from_secs(8));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut fill = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads can be had");
        seconds(&mut group, &format!("fill with {threads} threads"), || {
            black_box(pool.install(|| MerlTable::fill(&model)));
        })
    };
    let one = fill(1);
    // Where there is one processor, a second measurement would have the first one's name.
    let all = if threads == 1 { one } else { fill(threads) };
    group.finish();
    criterion.final_summary();

    for (what, seconds) in [
        ("three exp_m1", exponentials),
        ("separable", evaluation),
        ("planes (at most 60)", reciprocal),
        ("planes, all pairs at once (at most half of one by one)", together),
        ("bivariate (at most 60)", table),
        ("importance sample (at most 150)", sampling),
        ("MERL lookup", lookup),
    ] {
        println!("{what}: {:.1} ns", seconds / 1024.0 * 1e9);
    }
    if evaluation.is_finite() && exponentials.is_finite() {
        let (ns, ratio) = (evaluation / 1024.0 * 1e9, evaluation / exponentials);
        println!("one evaluation takes {ns:.1} ns, {ratio:.2} times three exp_m1 (at most 3)");
    }
    if one.is_finite() && all.is_finite() {
        let efficiency = one / all / threads as f64;
        println!(
            "filling a table with {threads} threads has an efficiency of {:.0} % (at least 80)",
            efficiency * 100.0
        );
    }
}
