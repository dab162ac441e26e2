use std::io::{self, Write};

use brdf::{Brdf, MerlTable};
use capture::{FileJournal, Record};
use glam::{BVec3, DVec3};
use pdv::{Comparison, Draw, Model, Scene, compare_within};
use rig::RigFile;
use serde::Serialize;
use sweep::{Job, LeftOut};

use crate::derive::{Sweeps, truth};
use crate::{
    Adapted, Check, MonteCarlo, Pace, ReportError, Run, RunDirectory, checks, measurements, outline, preview,
    slice, write_readings,
};

/// Azimuths at which the albedo of a model that is not constant along φ_p is taken.
const AZIMUTHS: usize = 16;

/// report.json: how far the result can be trusted.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// What was measured, in the technician's words.
    pub specimen: String,
    /// What was done; run.json says it in full.
    #[serde(skip)]
    pub run: Run,
    /// Consistency checks.
    pub checks: Vec<Check>,
    /// Errors against the truth, where the built-in simulator knows it.
    pub errors: Option<Comparison>,
    /// How a run that stops when good enough came to its end; what it expected stands beside `errors`.
    pub adapted: Option<Adapted>,
    /// Why there is no reconstruction, where there is none.
    pub no_model: Option<String>,
    /// How the reconstruction was made.
    pub model: Option<String>,
    /// What the plan left out and why.
    pub left_out: Vec<LeftOut>,
    /// How long it took beside the least that its readings take; `None` where there are none.
    pub pace: Option<Pace>,
}

/// Makes everything in a run directory again from its journal.
///
/// # Errors
/// No journal, or a damaged one; as [`write()`].
pub fn reconstruct(directory: &RunDirectory) -> Result<Report, ReportError> {
    write(directory, &FileJournal::read(directory.journal())?)
}

/// Writes everything that follows from the records of a journal into its run directory. A run that is not complete
/// gets no BRDF, only what can be said without one.
///
/// # Errors
/// Records without a header; a job or rig file that this version does not accept; a file that cannot be written.
pub fn write(directory: &RunDirectory, records: &[Record]) -> Result<Report, ReportError> {
    let Some(Record::Header(header)) = records.first() else {
        return Err(ReportError::NoHeader {
            path: directory.journal(),
        });
    };
    let job = Job::parse(&header.job, "job file").map_err(ReportError::Job)?;
    let job = capture::extended_plan(records).map_or(job.clone(), |plan| job.grown(&plan));
    let rig = RigFile::parse(&header.rig, "rig file".as_ref()).map_err(ReportError::Rig)?;
    let run = Run::new(header, records);
    let measurements = measurements(records, &rig);
    directory.write("run.json", |file| json(file, &run))?;
    directory.write("readings.csv", |file| write_readings(&measurements, file))?;

    let sweeps = Sweeps::new(&job, &measurements);
    let model = if run.complete() {
        sweeps.model(&job).map_err(|error| error.to_string())
    } else {
        Err("the run is not complete".to_owned())
    };
    let truth = truth(&rig);
    let (model, no_model) = match model {
        Ok(model) => (Some(model), None),
        Err(why) => (None, Some(why)),
    };
    let draws = model
        .as_ref()
        .map(|_| MonteCarlo::new(&job, &measurements, records, &rig));
    if let (Some(model), Some(draws)) = (&model, &draws) {
        write_model(directory, &job, model.as_ref(), draws)?;
    }
    let errors = model.as_ref().zip(truth.as_ref()).map(|(model, truth)| {
        let estimate: &dyn Brdf = model.as_ref();
        let scene = job.scene.clone().unwrap_or_else(Scene::whole);
        compare_within(&scene, truth, &[estimate], &Draw::default()).remove(0)
    });
    let report = Report {
        specimen: job.specimen.clone(),
        checks: check(&run, &job, &sweeps, model.as_deref()),
        errors,
        adapted: Adapted::new(records),
        no_model,
        model: model.as_ref().map(|model| model.about()),
        left_out: header.plan.left_out.clone(),
        pace: Pace::new(&run, records, &rig),
        run,
    };
    directory.write("report.json", |file| json(file, &report))?;
    let page = outline::page(
        &report,
        &job,
        &sweeps,
        model.as_deref(),
        truth.as_deref(),
        draws.as_ref(),
    );
    directory.write("report.html", |file| file.write_all(page.html().as_bytes()))?;
    Ok(report)
}

/// factors.csv, brdf.binary and its uncertainty, slice.exr, preview.exr and preview.png.
fn write_model(
    directory: &RunDirectory,
    job: &Job,
    model: &dyn Model,
    draws: &MonteCarlo,
) -> Result<(), ReportError> {
    directory.write("factors.csv", |file| write_factors(model, draws, file))?;
    let table = |of: &dyn Brdf| match &job.scene {
        Some(scene) => MerlTable::fill(&Asked { of, model, scene }),
        None => MerlTable::fill(of),
    };
    directory.write("brdf.binary", |file| table(model).write_to(file))?;
    directory.write("brdf.uncertainty.binary", |file| table(draws).write_to(file))?;
    directory.write("slice.exr", |file| slice::write(model, file))?;
    let sphere = preview::sphere(model);
    directory.write("preview.exr", |file| sphere.write_exr(file, &preview::ATTRIBUTES))?;
    directory.write("preview.png", |file| {
        file.write_all(&sphere.png(preview::EXPOSURE)?)
    })
}

/// What a table holds of a scene: −1, as MERL marks what is not valid, outside of it and in channels that nobody asked for.
struct Asked<'a> {
    of: &'a dyn Brdf,
    model: &'a dyn Model,
    scene: &'a Scene,
}

impl Brdf for Asked<'_> {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        if !self.model.valid(incident, exitant) {
            return DVec3::NEG_ONE;
        }
        let value = self.of.eval(incident, exitant);
        DVec3::select(BVec3::from_array(self.scene.channels), value, DVec3::NEG_ONE)
    }
}

/// One row a node: factor, its variable with the unit, the variable, red, green, blue, and their expanded
/// uncertainties, k = 2.
fn write_factors(model: &dyn Model, draws: &MonteCarlo, out: impl Write) -> io::Result<()> {
    let mut writer = csv::Writer::from_writer(out);
    writer.write_record(["factor", "variable", "value", "r", "g", "b", "u_r", "u_g", "u_b"])?;
    let tables = model.factors();
    let uncertainties = draws.factors(&tables);
    for (t, table) in tables.iter().enumerate() {
        for (r, (value, rgb)) in table.rows.iter().enumerate() {
            let u = uncertainties.as_ref().map(|u| u[t][r]);
            let u = [u.map(|u| u.x), u.map(|u| u.y), u.map(|u| u.z)];
            writer.serialize((table.name, table.variable, value, rgb.to_array(), u))?;
        }
    }
    writer.flush()
}

fn check(run: &Run, job: &Job, sweeps: &Sweeps, model: Option<&dyn Model>) -> Vec<Check> {
    let mut checks = vec![checks::bus(run)];
    for (plane, observations) in job.planes.iter().zip(&sweeps.planes) {
        if let Some(arc) = &job.arc {
            checks.push(checks::crossing(
                observations,
                &sweeps.arc,
                plane.theta_r,
                arc.offset,
            ));
        }
        checks.push(checks::sides(observations, plane.theta_r));
    }
    let planes: Vec<_> = job
        .planes
        .iter()
        .zip(&sweeps.planes)
        .map(|(plane, observations)| (observations.as_slice(), plane.theta_r))
        .collect();
    for pair in planes.windows(2) {
        checks.push(checks::helmholtz(pair[0], pair[1]));
    }
    if let Some(model) = model {
        checks.push(checks::coverage(model));
        checks.push(checks::energy(
            model,
            if model.phi_p_constant() { 1 } else { AZIMUTHS },
        ));
    }
    checks
}

fn json(mut file: impl Write, value: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut file, value)?;
    file.write_all(b"\n")
}
