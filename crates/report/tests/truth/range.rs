//! Seven decades of reflectance in one sweep.

use std::collections::BTreeMap;
use std::sync::Arc;

use brdf::Brdf;
use capture::{Flag, Record};
use firmware_sim::Imperfections;
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use report::measurements;
use sweep::Light;

use crate::bench::{FINE_SERVOS, Laboratory};

const JOB: &str = "[[plane]]\ntheta_r_deg = 45\nreadings = 160\ndistribution = \"uniform\"";
/// Rigs, each wrong in its own way.
const RIGS: u64 = 60;

/// A lobe about the mirror direction whose logarithm falls evenly with d_p, from 1.2e4 to 1e-3 sr⁻¹. Blue is 500 times
/// fainter than red at its top, and as bright as that where it ends.
///
/// No specimen is so bright so widely: it would send back more light than it gets. A real lobe has its decades within a
/// few degrees, where angles and apertures are what is unsure; here each is wide enough for what the photometer makes of
/// it to be seen.
struct Decades;

impl Decades {
    const TOP: DVec3 = DVec3::new(1.2e4, 6e3, 24.0);
    const END: f64 = 1e-3;
    /// d_p at the end of the sweep, where the arms come to stand side by side, and that over which the top is round.
    const REACH: f64 = 1.36;
    const ROUND: f64 = 0.1;
}

impl Brdf for Decades {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let fall = |d_p: f64| d_p.hypot(Self::ROUND) - Self::ROUND;
        let d_p = (incident + exitant).truncate().length();
        let share = fall(d_p) / fall(Self::REACH);
        Self::TOP * (share * (DVec3::splat(Self::END) / Self::TOP).map(f64::ln)).exp()
    }
}

/// What came of the readings within a factor of ten.
#[derive(Default)]
struct Decade {
    /// Intervals that hold the truth, of all.
    inside: u32,
    /// Expanded uncertainties relative to the truth.
    u_rel: Vec<f64>,
}

/// What came of the readings of all rigs.
#[derive(Default)]
struct Tally {
    decades: BTreeMap<i32, Decade>,
    /// Readings that count.
    readings: usize,
    /// Exposures before them, and those beside them for their faintest channel.
    before: usize,
    beside: usize,
}

#[tokio::test(start_paused = true)]
async fn seven_decades_in_one_sweep_are_told_within_their_uncertainty() {
    let mut tally = Tally::default();
    for seed in 0..RIGS {
        one(seed, &mut tally).await;
    }
    let (mut inside, mut all) = (0, 0);
    for (decade, of) in &mut tally.decades {
        of.u_rel.sort_by(f64::total_cmp);
        let n = of.u_rel.len();
        println!(
            "1e{decade} … sr⁻¹: {n} values, {:.1} % within their interval; expanded uncertainty (k = 2) {:.2} % in the middle, {:.1} % at most",
            100.0 * f64::from(of.inside) / n as f64,
            100.0 * of.u_rel[n / 2],
            100.0 * of.u_rel[n - 1]
        );
        inside += of.inside;
        all += n;
    }
    let share = f64::from(inside) / all as f64;
    println!(
        "{:.2} % of {all} intervals hold the truth; {} readings, {} exposures before and {} beside them",
        100.0 * share,
        tally.readings,
        tally.before,
        tally.beside
    );
    // Of two ways to tell how steep the lobe is the steeper one is believed.
    assert!((0.93..=0.98).contains(&share), "{share}");
    assert!((-3..=3).all(|decade| tally.decades.contains_key(&decade)));
    assert!(
        tally.before > 0 && tally.beside > 0,
        "nothing had to be exposed again"
    );
}

/// Captures the sweep with every imperfection, wrong by as much as the rig file admits.
async fn one(seed: u64, tally: &mut Tally) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let text = format!(
        "[uncertainty]\nresponsivity_percent = 0.2\ngain_percent = 0.1\nnonlinearity_percent = 0.1\n\
         crosstalk_percent = 0.0\nangle_deg = 0.01\nplay_deg = 0.02\nencoder_deg = 0.0\ntilt_deg = 0.0\n[sim]\n{FINE_SERVOS}seed = {}\nresponsivity_error = {}\nlight_zero_deg = {}\n\
         sensor_zero_deg = {}\nstray_per_sr = {}\ngain_error = {}\nnonlinearity = {}\n",
        1000 + seed,
        0.002 * normal(),
        0.02 * normal(),
        0.02 * normal(),
        Imperfections::DEFAULT.stray_per_sr * normal().abs(),
        0.001 * normal(),
        0.001 * normal().abs(),
    );
    let laboratory = Laboratory::new(&text);
    let records = laboratory.measure(Arc::new(Decades), JOB).await;
    // Step after the last one that has its reading.
    let mut next = 0;
    for m in measurements(&records, &laboratory.file) {
        let exposed_again = m.reading.lamp && !m.reading.accepted;
        match m.reading.step < next {
            true => tally.beside += usize::from(exposed_again),
            false => tally.before += usize::from(exposed_again),
        }
        if !m.reading.accepted || !m.reading.lamp {
            continue;
        }
        next = m.reading.step + 1;
        assert!(
            !m.reading.flags.contains(&Flag::Saturated) && !m.shadowed,
            "seed {seed}: {m:?}"
        );
        let (f, u) = (m.rgb().expect("not saturated"), m.u.expect("of a reflectance"));
        tally.readings += 1;
        let truth = Decades.eval(m.pose.incident(), m.pose.exitant());
        for c in 0..3 {
            let decade = tally.decades.entry(truth[c].log10().floor() as i32).or_default();
            decade.inside += u32::from((f[c] - truth[c]).abs() <= u[c]);
            decade.u_rel.push(u[c] / truth[c]);
        }
    }
    if seed == 0 {
        takes_the_time_that_was_planned(&records, &laboratory);
    }
}

fn takes_the_time_that_was_planned(records: &[Record], laboratory: &Laboratory) {
    let Some(Record::Header(header)) = records.first() else {
        panic!("a journal begins with its header");
    };
    let mechanics = capture::mechanics(&laboratory.file, None);
    let light = Light::new(&header.plan, &mechanics);
    let run = report::Run::new(header, records);
    // This rig has no wire.
    let planned_s = header.plan.seconds() - header.plan.steps.len() as f64 * mechanics.transaction_s;
    println!(
        "planned {planned_s:.1} s, {light:.2?}; taken {:.1} s, {:?}",
        run.seconds.total, run.seconds
    );
    assert!((run.seconds.total / planned_s - 1.0).abs() < 0.1);
    assert!(run.seconds.total < light.worst_s);
}
