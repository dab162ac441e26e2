//! How far the models are from the materials they are made of: mean and worst MALE over a set of materials, noise-free.
//!
//! `cargo run --release -p pdv --example accuracy -- [FOLDER]`: FOLDER holds MERL files (`*.binary`); without one the
//! hundred fitted materials are taken. `--half 0` or `--half 1` takes every second of them, to choose with one half and
//! judge by the other.

use std::path::{Path, PathBuf};

use brdf::{Brdf, Fitted, MerlTable};
use glam::DVec3;
use pdv::{Bivariate, Distribution, Draw, Observation, Planes, Separable, compare, spread};

/// The arms come no closer and go no further, degrees.
const SEPARATION_DEG: f64 = 5.0;
const LIMIT_DEG: f64 = 85.0;
/// A count of the light's servo, rad.
const COUNT_RAD: f64 = std::f64::consts::TAU / 4096.0;

/// What is read.
struct Plan {
    planes_deg: &'static [f64],
    readings: usize,
    arc: usize,
}

const PLANS: [Plan; 3] = [
    Plan {
        planes_deg: &[30.0],
        readings: 90,
        arc: 90,
    },
    Plan {
        planes_deg: &[20.0, 45.0, 70.0],
        readings: 14,
        arc: 6,
    },
    Plan {
        planes_deg: &[10.0, 22.0, 35.0, 48.0, 60.0, 70.0, 80.0],
        readings: 90,
        arc: 90,
    },
];

impl Plan {
    fn planes(&self, brdf: &dyn Brdf, distribution: Distribution) -> Vec<Vec<Observation>> {
        let plane = |&deg: &f64| {
            let theta_r = deg.to_radians();
            let deviation = |deg: f64| deg.to_radians().sin() + theta_r.sin();
            let ranges = [
                deviation(-LIMIT_DEG)..=deviation(deg - SEPARATION_DEG),
                deviation((deg + SEPARATION_DEG).min(LIMIT_DEG))..=deviation(LIMIT_DEG),
            ];
            let spread = spread(distribution, theta_r, &ranges, self.readings, COUNT_RAD);
            let read = |&d: &f64| Observation::of(brdf, theta_r, d);
            spread.deviations.iter().filter_map(read).collect()
        };
        self.planes_deg.iter().map(plane).collect()
    }

    fn along(&self, brdf: &dyn Brdf) -> Vec<Observation> {
        let from = SEPARATION_DEG / 2.0;
        let step = (LIMIT_DEG - from) / (self.arc - 1) as f64;
        (0..self.arc)
            .filter_map(|n| Observation::of(brdf, (from + step * n as f64).to_radians(), 0.0))
            .collect()
    }
}

/// The model by its formula in f64.
struct Exact<'a>(&'a Planes);

impl Brdf for Exact<'_> {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        self.0.exact(incident, exitant)
    }
}

/// MALE and median relative error of one model for one material.
struct Row {
    plan: usize,
    model: &'static str,
    material: String,
    male: f64,
    median_rel: f64,
}

fn rows(name: &str, brdf: &dyn Brdf) -> Result<Vec<Row>, pdv::Error> {
    let draw = Draw {
        pairs: 50_000,
        ..Draw::default()
    };
    let mut rows = Vec::new();
    for (n, plan) in PLANS.iter().enumerate() {
        let (planes, along) = (plan.planes(brdf, Distribution::Lobe), plan.along(brdf));
        let model = Planes::from_observations(&planes, &along)?;
        let separable = Separable::from_observations(&planes[planes.len() - 1], &along)?;
        let bivariate = Bivariate::from_observations(&planes, &along)?;
        let models: [(&'static str, &dyn Brdf); 4] = [
            ("planes", &model),
            ("planes, in f64", &Exact(&model)),
            ("bivariate", &bivariate),
            ("separable", &separable),
        ];
        let found = compare(brdf, &models.map(|(_, model)| model), &draw);
        for ((model, _), found) in models.iter().zip(found) {
            rows.push(Row {
                plan: n,
                model,
                material: name.to_owned(),
                male: found.overall.male.unwrap_or(f64::NAN),
                median_rel: found.overall.median_rel.unwrap_or(f64::NAN),
            });
        }
    }
    Ok(rows)
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, std::io::Error> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "binary") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn print(rows: &[Row]) {
    println!(
        "planes                                     readings  model            MALE mean   median   worst    median rel. error"
    );
    for (n, plan) in PLANS.iter().enumerate() {
        for model in ["planes", "planes, in f64", "bivariate", "separable"] {
            let mut of: Vec<&Row> = rows.iter().filter(|r| r.plan == n && r.model == model).collect();
            of.sort_by(|a, b| a.male.total_cmp(&b.male));
            let Some(worst) = of.last() else { continue };
            let mean = |of: &dyn Fn(&Row) -> f64, rows: &[&Row]| {
                rows.iter().map(|row| of(row)).sum::<f64>() / rows.len() as f64
            };
            println!(
                "{:42} {:<9} {:16} {:.5}     {:.5}  {:.5}  {:.4}   worst {}",
                format!("{:?}", plan.planes_deg),
                plan.planes_deg.len() * plan.readings + plan.arc,
                model,
                mean(&|row| row.male, &of),
                of[of.len() / 2].male,
                worst.male,
                mean(&|row| row.median_rel, &of),
                worst.material,
            );
        }
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut folder = None;
    let mut half = None;
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--half" => half = Some(args.next().ok_or("--half needs 0 or 1")?.parse::<usize>()?),
            _ => folder = Some(PathBuf::from(arg)),
        }
    }
    let taken = |n: usize| half.is_none_or(|half| n % 2 == half);
    let mut all = Vec::new();
    if let Some(folder) = folder {
        for (_, file) in files(&folder)?.iter().enumerate().filter(|(n, _)| taken(*n)) {
            let name = file.file_stem().unwrap_or_default().to_string_lossy();
            all.extend(rows(&name, &MerlTable::read(file)?)?);
        }
    } else {
        for (_, (name, material)) in Fitted::all().enumerate().filter(|(n, _)| taken(*n)) {
            all.extend(rows(name, &material)?);
        }
    }
    print(&all);
    Ok(())
}
