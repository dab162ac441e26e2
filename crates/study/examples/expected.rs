//! Fits the expected error of `pdv::Expectation` to what errors really are, and tries it.
//!
//! `cargo run --release -p study --example expected`: the fitted materials are captured on the simulated rig,
//! imperfections on, with fixed plans and by jobs that stop after a budget of rig time. Over every second material ln
//! MALE is fitted by least squares to the terms of `pdv::Signs`, a little ridge keeping terms apart that say the same.
//! Printed are every capture, the weights, and for either half how often the expected error is right within a factor of
//! 2, for all captures and for those that stopped by themselves.

use std::error::Error;
use std::sync::Arc;

use brdf::{Brdf, Fitted};
use nalgebra::{DMatrix, DVector};
use pdv::{Draw, Expectation, compare};
use rayon::prelude::*;
use rig::RigFile;
use study::{Measured, measure};
use sweep::Job;

/// Fixed plans that the fit sees: θ_r of the planes in degrees, readings of each, readings of the arc.
const PLANS: [(&[f64], usize, usize); 1] = [(&[30.0], 32, 16)];
/// Where jobs begin that stop by themselves, and their budgets, s.
const FIRST: (&[f64], usize, usize) = (&[20.0, 70.0], 16, 8);
const BUDGETS_S: [f64; 2] = [45.0, 90.0];
/// Share of the squares of the terms that is added to keep the weights small.
const RIDGE: f64 = 1e-3;

type Failed = Box<dyn Error + Send + Sync>;

/// What was expected of a capture, and what came of it.
struct Case {
    material: usize,
    terms: [f64; 8],
    expected: f64,
    male: f64,
    planes: usize,
    rig_s: f64,
    adapted: bool,
}

fn job(planes_deg: &[f64], readings: usize, arc: usize, rest: &str) -> Result<Job, Failed> {
    let plane = |deg: &f64| {
        format!("[[plane]]\ntheta_r_deg = {deg:?}\nreadings = {readings}\ndistribution = \"lobe\"\n")
    };
    let planes: String = planes_deg.iter().map(plane).collect();
    let text = format!("{planes}[arc]\nreadings = {arc}\n[reconstruction]\nmodel = \"planes\"\n{rest}");
    Ok(Job::parse(&text, "job.toml")?)
}

fn case(material: usize, brdf: &Fitted, job: &Job) -> Result<Case, Failed> {
    let mut rig = RigFile::parse(RigFile::BUILT_IN, "the built-in rig file".as_ref())?;
    rig.sim.insert("seed".to_owned(), i64::try_from(material)?.into());
    let Measured {
        planes,
        arc,
        rig_s,
        adapted,
        ..
    } = measure(job, &rig, Arc::new(*brdf))?;
    let expected = Expectation::new(&planes, &arc, None)?;
    let model = report::model(job.model, &planes, &arc)?;
    let draw = Draw {
        pairs: 10_000,
        ..Draw::default()
    };
    let estimate: &dyn Brdf = &model;
    let male = compare(brdf, &[estimate], &draw)[0]
        .overall
        .male
        .ok_or("no pair is valid")?;
    Ok(Case {
        material,
        terms: expected.signs.terms(planes.len()),
        expected: expected.male,
        male,
        planes: planes.len(),
        rig_s,
        adapted: adapted.is_some(),
    })
}

fn cases(jobs: &[Job]) -> Result<Vec<Case>, Failed> {
    let materials: Vec<Fitted> = Fitted::all().map(|(_, material)| material).collect();
    let of_material = |(n, material): (usize, &Fitted)| -> Result<Vec<Case>, Failed> {
        jobs.iter().map(|job| case(n, material, job)).collect()
    };
    let cases: Result<Vec<Vec<Case>>, Failed> = materials.par_iter().enumerate().map(of_material).collect();
    Ok(cases?.into_iter().flatten().collect())
}

/// Weights of the terms with the least squared error of ln MALE.
fn fit(cases: &[&Case]) -> Result<Vec<f64>, Failed> {
    let terms = DMatrix::from_fn(cases.len(), 8, |row, column| cases[row].terms[column]);
    let logs = DVector::from_fn(cases.len(), |row, _| cases[row].male.ln());
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
    let mut jobs = Vec::new();
    for (planes, readings, arc) in PLANS {
        jobs.push(job(planes, readings, arc, "")?);
    }
    let (planes, readings, arc) = FIRST;
    for budget_s in BUDGETS_S {
        jobs.push(job(
            planes,
            readings,
            arc,
            &format!("[sweep]\nbudget_s = {budget_s:?}\n"),
        )?);
    }
    let all = cases(&jobs)?;
    println!("material planes rig_s male expected terms");
    for Case {
        material,
        terms,
        expected,
        male,
        planes,
        rig_s,
        ..
    } in &all
    {
        println!("{material} {planes} {rig_s:.1} {male:.6} {expected:.6} {terms:.4?}");
    }
    let half = |odd: usize| -> Vec<&Case> { all.iter().filter(|case| case.material % 2 == odd).collect() };
    let weights = fit(&half(0))?;
    println!("weights {weights:.4?}");
    let fitted = |case: &Case| {
        case.terms
            .iter()
            .zip(&weights)
            .map(|(t, w)| t * w)
            .sum::<f64>()
            .exp()
    };
    for (name, cases) in [
        ("fitted on", half(0)),
        ("tried on", half(1)),
        ("both", all.iter().collect()),
    ] {
        let stopped: Vec<&Case> = cases.iter().copied().filter(|case| case.adapted).collect();
        for (which, cases) in [
            ("all captures", &cases),
            ("those that stopped by themselves", &stopped),
        ] {
            println!(
                "{name}, {which}: right within a factor of 2: {} with these weights, {} with the stored ones",
                right(cases, fitted),
                right(cases, |case| case.expected)
            );
        }
    }
    Ok(())
}
