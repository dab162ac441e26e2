//! Says how often the uncertainties that a run states hold the truth.
//!
//! `cargo run --release -p study --example held -- JOB… [--rig FILE] [--every N] --on PATH…`
//!
//! Every material (or every N-th) of the files and folders, BRDF files of any format and CSV files of scattered readings, is
//! captured by every job on the simulated rig, imperfections on. Looked at are entries of brdf.binary and
//! brdf.uncertainty.binary with both directions below 80°, 3000 drawn evenly from the table; of scattered readings, all that
//! are below 80°. Printed are by material, and by job and path over all of it: the share of entries, of those that are not
//! flagged, whose truth lies within f ± u, in the mean over the materials with the 10th and the 90th percentile; median
//! and 95th percentile of u/f; the share that is flagged; the median relative error; and the share of the readings whose
//! truth lies within their own f ± u. A simulated specimen of scattered readings is interpolated from those in the plane, so
//! that of its readings the last says nothing.

use std::path::PathBuf;

use brdf::{Brdf, MerlTable};
use glam::DVec3;
use pdv::metric::{quantile, relative_error};
use rayon::prelude::*;
use report::{ModelUncertainty, MonteCarlo, Sweeps, measurements};
use rig::RigFile;
use study::{Capture, Material};
use sweep::Job;

type Failed = Box<dyn std::error::Error + Send + Sync>;

/// Entries of a table that are looked at.
const ENTRIES: usize = 3000;
/// Cosine of the largest zenith angle, 80°.
const LEAST_COSINE: f64 = 0.173_648;

/// What was asked for.
struct Asked {
    jobs: Vec<PathBuf>,
    rig: String,
    every: usize,
    paths: Vec<PathBuf>,
}

impl Asked {
    fn new(mut args: impl Iterator<Item = String>) -> Result<Self, Failed> {
        let mut asked = Self {
            jobs: Vec::new(),
            rig: RigFile::BUILT_IN.to_owned(),
            every: 1,
            paths: Vec::new(),
        };
        let mut on = false;
        while let Some(arg) = args.next() {
            match arg.as_str() {
                "--on" => on = true,
                "--rig" => asked.rig = std::fs::read_to_string(args.next().ok_or("--rig needs a file")?)?,
                "--every" => asked.every = args.next().ok_or("--every needs a number")?.parse()?,
                _ if on => asked.paths.push(arg.into()),
                _ => asked.jobs.push(arg.into()),
            }
        }
        match asked.jobs.is_empty() || asked.paths.is_empty() || asked.every == 0 {
            true => Err("needed are job files, and files or folders of materials behind --on".into()),
            false => Ok(asked),
        }
    }
}

/// What was found over some entries and readings.
#[derive(Default)]
struct Tally {
    /// Share of the entries that hold the truth, of each material.
    held: Vec<f64>,
    inside: usize,
    flagged: usize,
    /// u/f of the others.
    relative: Vec<f64>,
    errors: Vec<f64>,
    readings_inside: usize,
    readings: usize,
}

impl Tally {
    fn entry(&mut self, truth: DVec3, f: DVec3, u: DVec3) {
        for c in 0..3 {
            if u[c] < 0.0 {
                self.flagged += 1;
                continue;
            }
            self.inside += usize::from((truth[c] - f[c]).abs() <= u[c]);
            self.relative.push(u[c] / f[c]);
            self.errors.push(relative_error(truth[c], f[c]));
        }
    }

    fn reading(&mut self, truth: DVec3, f: DVec3, u: DVec3) {
        self.readings += 3;
        self.readings_inside += (0..3).filter(|&c| (truth[c] - f[c]).abs() <= u[c]).count();
    }

    fn close(mut self) -> Self {
        self.held = vec![share(self.inside, self.relative.len())];
        self
    }

    fn add(&mut self, other: &Self) {
        self.held.extend(&other.held);
        self.flagged += other.flagged;
        self.relative.extend(&other.relative);
        self.errors.extend(&other.errors);
        self.readings_inside += other.readings_inside;
        self.readings += other.readings;
    }

    fn line(&mut self) -> String {
        let mean = self.held.iter().sum::<f64>() / self.held.len().max(1) as f64;
        let mut at = |list: fn(&mut Self) -> &mut Vec<f64>, q: f64| {
            quantile(list(self), q).map_or_else(|| "-".to_owned(), |value| format!("{value:.3}"))
        };
        let [low, high] = [0.1, 0.9].map(|q| at(|tally| &mut tally.held, q));
        let [median, p95] = [0.5, 0.95].map(|q| at(|tally| &mut tally.relative, q));
        let error = at(|tally| &mut tally.errors, 0.5);
        format!(
            "held {mean:.3} ({low} … {high}), u/f {median}, p95 {p95}, flagged {:.3}, error {error}, readings {:.3}",
            share(self.flagged, self.flagged + self.relative.len()),
            share(self.readings_inside, self.readings),
        )
    }
}

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole.max(1) as f64
}

/// Entries of a MERL table by a step that meets all of it evenly.
fn entries() -> impl Iterator<Item = (DVec3, DVec3)> {
    let step = (MerlTable::NODES as f64 * 0.618_034) as usize | 1;
    let [_, rows, columns] = MerlTable::SHAPE;
    (0..MerlTable::NODES)
        .map(move |n| n * step % MerlTable::NODES)
        .map(move |at| {
            MerlTable::coordinates([at / columns / rows, at / columns % rows, at % columns]).directions()
        })
        .filter(|(incident, exitant)| incident.z.min(exitant.z) > LEAST_COSINE)
        .take(ENTRIES)
}

/// A material by a job.
fn judge(job: &Job, rig: &str, material: &Material, seed: i64) -> Result<Tally, Failed> {
    let mut rig = RigFile::parse(rig, "the rig file".as_ref())?;
    rig.sim.insert("seed".to_owned(), seed.into());
    let records = Capture::new(job, &rig, material.brdf.clone())?.records;
    let job = capture::extended_plan(&records).map_or(job.clone(), |plan| job.grown(&plan));
    let measurements = measurements(&records, &rig);
    let sweeps = Sweeps::new(&job, &measurements);
    let model = sweeps.model(&job)?;
    let draws = MonteCarlo::new(&job, &measurements, &records, &rig);
    let uncertainty = ModelUncertainty::new(model.as_ref(), &sweeps, &draws);
    let mut tally = Tally::default();
    let mut entry = |truth: DVec3, incident: DVec3, exitant: DVec3| {
        if model.valid(incident, exitant) {
            let f = model.eval(incident, exitant);
            tally.entry(truth, f, uncertainty.eval(incident, exitant));
        }
    };
    match &material.known {
        Some(readings) => readings
            .iter()
            .map(|reading| (reading.rgb, reading.directions()))
            .filter(|(_, (incident, exitant))| incident.z.min(exitant.z) > LEAST_COSINE)
            .for_each(|(truth, (incident, exitant))| entry(truth, incident, exitant)),
        None => entries()
            .filter(|&(incident, exitant)| material.brdf.valid(incident, exitant))
            .for_each(|(incident, exitant)| {
                entry(material.brdf.eval(incident, exitant), incident, exitant);
            }),
    }
    for m in &measurements {
        if let (true, Some(f), Some(u)) = (m.reading.accepted && !m.shadowed, m.rgb(), m.u) {
            tally.reading(material.brdf.eval(m.pose.incident(), m.pose.exitant()), f, u);
        }
    }
    Ok(tally.close())
}

fn main() -> Result<(), Failed> {
    let asked = Asked::new(std::env::args().skip(1))?;
    for path in &asked.paths {
        let materials = Material::read_all(path)?;
        let materials: Vec<&Material> = materials.iter().step_by(asked.every).collect();
        for job in &asked.jobs {
            let name = job.display();
            let job = Job::parse(&std::fs::read_to_string(job)?, &name.to_string())?;
            let tallies = materials
                .par_iter()
                .enumerate()
                .map(|(n, material)| judge(&job, &asked.rig, material, n as i64 + 1))
                .collect::<Result<Vec<Tally>, Failed>>()?;
            let mut whole = Tally::default();
            for (material, mut tally) in materials.iter().zip(tallies) {
                whole.add(&tally);
                println!("{name}, {}: {}", material.name, tally.line());
            }
            println!("{name}, all of {}: {}", path.display(), whole.line());
        }
    }
    Ok(())
}
