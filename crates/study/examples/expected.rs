//! Fits the expected error of `pdv::Expectation` to what errors really are, and tries it.
//!
//! `cargo run --release -p study --example expected`: the fitted materials are captured on the simulated rig,
//! imperfections on, by jobs that decide on the way what to measure, of everything and of a scene below 60°, from two
//! planes and from one. Whenever something is to be decided, the signs of the readings so far are a case beside the error
//! that is found. Over every second material ln MALE is fitted by least squares to the terms of `pdv::Signs`, a little
//! ridge keeping terms apart that say the same. Printed are every case, the weights, and for either half how often the
//! expected error is right within a factor of 2.

use std::error::Error;
use std::sync::Arc;

use brdf::{Brdf, Fitted};
use capture::{Command, Extension, Header, MemoryJournal, Record, Thinking};
use firmware_sim::Bench;
use firmware_sim::in_process::InProcessRig;
use nalgebra::{DMatrix, DVector};
use pdv::{Draw, Expectation, Scene, compare_within};
use rayon::prelude::*;
use rig::{Drive, Rig, RigFile};
use sweep::{Job, Sweep};

/// Where jobs begin: θ_r of the planes in degrees, readings of each, readings of the arc.
const FIRST: [(&[f64], usize, usize); 2] = [(&[20.0, 70.0], 16, 8), (&[45.0], 16, 4)];
/// What is looked at.
const SCENES: [&str; 2] = ["", "[scene]\ntheta_i_deg = [0, 60]\ntheta_o_deg = [0, 60]\n"];
/// Rig seconds after which nothing more is added.
const UNTIL_S: f64 = 45.0;
/// How often a case of one plane counts: a run has only one, and many jobs end there.
const ONE_PLANE: f64 = 3.0;
/// Share of the squares of the terms that is added to keep the weights small.
const RIDGE: f64 = 1e-3;

type Failed = Box<dyn Error + Send + Sync>;

/// What was expected of the readings so far, and what comes of them.
struct Case {
    material: usize,
    scene: bool,
    terms: [f64; 8],
    expected: f64,
    male: f64,
    planes: usize,
    rig_s: f64,
    /// Whether its run ended with it.
    last: bool,
}

fn job((planes_deg, readings, arc): (&[f64], usize, usize), scene: &str) -> Result<Job, Failed> {
    let plane = |deg: &f64| {
        format!("[[plane]]\ntheta_r_deg = {deg:?}\nreadings = {readings}\ndistribution = \"lobe\"\n")
    };
    let planes: String = planes_deg.iter().map(plane).collect();
    // A target that is never reached: the fit must not depend on the weights that are to be fitted.
    let text = format!(
        "{planes}[arc]\nreadings = {arc}\n[reconstruction]\nmodel = \"planes\"\n[sweep]\ntarget_male = 1e-5\n{scene}"
    );
    Ok(Job::parse(&text, "job.toml")?)
}

/// The readings of a journal as a case.
fn case(
    material: usize,
    brdf: &Fitted,
    job: &Job,
    records: &[Record],
    rig: &RigFile,
) -> Result<Case, Failed> {
    let (Some(Record::Header(header)), Some(plan)) = (records.first(), capture::extended_plan(records))
    else {
        return Err("the journal has no header".into());
    };
    let measurements = report::measurements(records, rig);
    let planes: Vec<_> = (0..job.grown(&plan).planes.len())
        .map(|n| report::observations(&measurements, Sweep::Plane(n)))
        .collect();
    let arc = report::observations(&measurements, Sweep::Arc);
    let expected = Expectation::new(&planes, &arc, job.scene.as_ref())?;
    let model = report::model(job.model, &planes, &arc)?;
    let draw = Draw {
        pairs: 10_000,
        ..Draw::default()
    };
    let scene = job.scene.clone().unwrap_or_else(Scene::whole);
    let found = compare_within(&scene, brdf, &[&model as &dyn Brdf], &draw)[0].overall;
    Ok(Case {
        material,
        scene: job.scene.is_some(),
        terms: expected.signs.terms(planes.len()),
        expected: expected.male,
        male: found.male.ok_or("no pair is valid")?,
        planes: planes.len(),
        rig_s: report::Run::new(header, records).seconds.total,
        last: false,
    })
}

/// A case for each decision of a job's run.
async fn run(material: usize, brdf: &Fitted, job: &Job) -> Result<Vec<Case>, Failed> {
    let mut file = RigFile::parse(RigFile::BUILT_IN, "the built-in rig file".as_ref())?;
    file.sim
        .insert("seed".to_owned(), i64::try_from(material)?.into());
    let mut rig = InProcessRig::over(Bench::with_specimen(&file, Arc::new(*brdf))?, &file);
    let start = rig.snapshot().await?.pose();
    let header = Header {
        run: String::new(),
        version: String::new(),
        job: String::new(),
        rig: String::new(),
        certificate: None,
        plan: sweep::plan(job, &capture::mechanics(&file, Some(start)))?,
        started: String::new(),
    };
    let mut journal = MemoryJournal(vec![Record::Header(header)]);
    let mut drive = Drive::new(rig, file.clone());
    let (_sender, control) = tokio::sync::watch::channel(Command::Run);
    let mut cases = Vec::new();
    let mut ask = |records: &[Record]| -> Thinking {
        let found = case(material, brdf, job, records, &file);
        let over = found.as_ref().is_ok_and(|case| case.rig_s > UNTIL_S);
        let extension = match over || found.is_err() {
            true => Extension {
                steps: Vec::new(),
                why: "enough".to_owned(),
                expected_male: None,
            },
            false => report::extension(job, records, &file),
        };
        cases.push(found);
        Box::pin(std::future::ready(extension))
    };
    capture::run_and_ask(&mut drive, &mut journal, control, &mut |_| (), &mut ask).await?;
    let mut cases: Vec<Case> = cases.into_iter().collect::<Result<_, _>>()?;
    cases.last_mut().ok_or("nothing was decided")?.last = true;
    Ok(cases)
}

fn cases() -> Result<Vec<Case>, Failed> {
    let mut jobs = Vec::new();
    for first in FIRST {
        for scene in SCENES {
            jobs.push(job(first, scene)?);
        }
    }
    let materials: Vec<Fitted> = Fitted::all().map(|(_, material)| material).collect();
    let of_material = |(n, material): (usize, &Fitted)| -> Result<Vec<Case>, Failed> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .start_paused(true)
            .build()?;
        let runs: Result<Vec<_>, Failed> = jobs
            .iter()
            .map(|job| runtime.block_on(run(n, material, job)))
            .collect();
        Ok(runs?.into_iter().flatten().collect())
    };
    let cases: Result<Vec<Vec<Case>>, Failed> = materials.par_iter().enumerate().map(of_material).collect();
    Ok(cases?.into_iter().flatten().collect())
}

/// Weights of the terms with the least squared error of ln MALE.
fn fit(cases: &[&Case]) -> Result<Vec<f64>, Failed> {
    let counts = |case: &Case| if case.planes == 1 { ONE_PLANE.sqrt() } else { 1.0 };
    let terms = DMatrix::from_fn(cases.len(), 8, |row, column| {
        counts(cases[row]) * cases[row].terms[column]
    });
    let logs = DVector::from_fn(cases.len(), |row, _| counts(cases[row]) * cases[row].male.ln());
    let mut squares = terms.tr_mul(&terms);
    for n in 0..8 {
        squares[(n, n)] *= 1.0 + RIDGE;
    }
    let solved = squares
        .cholesky()
        .ok_or("the terms depend on each other")?
        .solve(&terms.tr_mul(&logs));
    Ok(solved.iter().copied().collect())
}

/// Share of cases in which some prediction is right within a factor of 2.
fn right(cases: &[&Case], expected: impl Fn(&Case) -> f64) -> String {
    let good = cases
        .iter()
        .filter(|case| (expected(case) / case.male).ln().abs() < 2.0_f64.ln())
        .count();
    format!("{good} of {}", cases.len())
}

fn main() -> Result<(), Failed> {
    let all = cases()?;
    println!("material scene planes rig_s male expected terms");
    for Case {
        material,
        scene,
        terms,
        expected,
        male,
        planes,
        rig_s,
        ..
    } in &all
    {
        println!("{material} {scene} {planes} {rig_s:.1} {male:.6} {expected:.6} {terms:.4?}");
    }
    let half = |odd: usize| -> Vec<&Case> { all.iter().filter(|case| case.material % 2 == odd).collect() };
    let weights = fit(&half(0))?;
    println!("weights {weights:.4?}");
    let fitted = |case: &Case| {
        let terms = case.terms.iter().zip(&weights);
        terms.map(|(term, weight)| term * weight).sum::<f64>().exp()
    };
    for (name, cases) in [("fitted on", half(0)), ("tried on", half(1))] {
        for (what, scene) in [("everything", false), ("the scene", true)] {
            let of: Vec<&Case> = cases.iter().copied().filter(|case| case.scene == scene).collect();
            let those = |which: fn(&Case) -> bool| -> Vec<&Case> {
                of.iter().copied().filter(|case| which(case)).collect()
            };
            for (which, cases) in [
                ("all", those(|_| true)),
                ("the last of each run", those(|case| case.last)),
                ("of one plane", those(|case| case.planes == 1)),
            ] {
                println!(
                    "{name}, {what}, {which}: right within a factor of 2: {} with these weights, {} with the stored ones",
                    right(&cases, fitted),
                    right(&cases, |case| case.expected)
                );
            }
        }
    }
    Ok(())
}
