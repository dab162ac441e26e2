use std::io::{self, Write};

use brdf::{Brdf, MerlTable};
use capture::{FileJournal, Header, Record};
use glam::{BVec3, DVec3};
use pdv::{Comparison, Draw, Model, Scene, compare_within};
use rig::RigFile;
use serde::Serialize;
use sweep::{Job, LeftOut, Sweep};

use crate::derive::{Sweeps, truth};
use crate::measurement::{Told, certificate, told};
use crate::{
    Adapted, Check, ExportedFile, Measurement, ModelUncertainty, MonteCarlo, Pace, ReportError, Run,
    RunDirectory, UncertaintySummary, Verdict, checks, export, measurements, outline, preview, slice,
    write_readings,
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
    /// What the checks say of the result as a whole.
    pub verdict: Verdict,
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
    /// The files in other formats for which the job asked.
    pub exports: Vec<ExportedFile>,
    /// How long it took beside the least that its readings take; `None` where there are none.
    pub pace: Option<Pace>,
}

/// Files of a run directory that take nearly all of its room, and that [`write_large`] makes again at any time.
pub const LARGE: [&str; 2] = ["brdf.binary", "brdf.uncertainty.binary"];
/// Bytes of each of them: a MERL table is of one size.
pub const LARGE_BYTES: u64 = 12 + 8 * 3 * 90 * 90 * 180;
/// The file that says what the reconstruction's uncertainty is; there is one where there is a reconstruction.
pub const UNCERTAINTY: &str = "brdf.uncertainty.json";

/// What of a run directory is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Volume {
    /// Everything.
    Whole,
    /// All but the files of [`LARGE`].
    WithoutLarge,
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
    write_volume(directory, records, Volume::Whole)
}

/// Makes one file of [`LARGE`] from the records of a journal; nothing where the run has no reconstruction.
///
/// # Errors
/// As [`write()`].
pub fn write_large(directory: &RunDirectory, records: &[Record], name: &str) -> Result<(), ReportError> {
    let Some(Record::Header(header)) = records.first() else {
        return Err(ReportError::NoHeader {
            path: directory.journal(),
        });
    };
    let examined = Examined::new(header, records)?;
    let Some(model) = examined.model.as_deref() else {
        return Ok(());
    };
    let (job, sweeps) = (&examined.job, &examined.sweeps);
    if name == LARGE[0] {
        let f = table(job, model, model);
        return directory.write(name, |file| f.write_to(file));
    }
    let draws = MonteCarlo::new(job, &examined.measurements, records, &examined.rig);
    let u = table(job, model, &ModelUncertainty::new(model, sweeps, &draws));
    directory.write(name, |file| u.write_to(file))
}

/// Writes what follows from the records of a journal into its run directory, as [`write()`], but for what is left out.
///
/// # Errors
/// As [`write()`].
pub fn write_volume(
    directory: &RunDirectory,
    records: &[Record],
    volume: Volume,
) -> Result<Report, ReportError> {
    let Some(Record::Header(header)) = records.first() else {
        return Err(ReportError::NoHeader {
            path: directory.journal(),
        });
    };
    let Examined {
        job,
        rig,
        run,
        measurements,
        sweeps,
        model,
        no_model,
        checks,
    } = Examined::new(header, records)?;
    directory.write("run.json", |file| json(file, &run))?;
    directory.write("readings.csv", |file| write_readings(&measurements, file))?;

    let truth = truth(&rig);
    let draws = model
        .as_ref()
        .map(|_| MonteCarlo::new(&job, &measurements, records, &rig));
    let made = model.as_deref().zip(draws.as_ref());
    let uncertainty = made.map(|(model, draws)| ModelUncertainty::new(model, &sweeps, draws));
    if let (Some((model, draws)), Some(u)) = (made, &uncertainty) {
        directory.write("factors.csv", |file| write_factors(model, draws, file))?;
        write_model(directory, &job, model, u, &measurements, volume)?;
    }
    let exports = match model.as_deref() {
        Some(model) => export::write(directory, &job, &rig, &run, model, &measurements)?,
        None => Vec::new(),
    };
    let errors = model.as_ref().zip(truth.as_ref()).map(|(model, truth)| {
        let estimate: &dyn Brdf = model.as_ref();
        let scene = job.scene.clone().unwrap_or_else(Scene::whole);
        compare_within(&scene, truth, &[estimate], &Draw::default()).remove(0)
    });
    let report = Report {
        specimen: job.specimen.name.clone(),
        verdict: run.verdict,
        checks,
        errors,
        adapted: Adapted::new(records),
        no_model,
        model: model.as_ref().map(|model| model.about()),
        left_out: header.plan.left_out.clone(),
        exports,
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
        uncertainty.as_ref(),
    );
    directory.write("report.html", |file| file.write_all(page.html().as_bytes()))?;
    Ok(report)
}

/// The checks of a run and what they say as a whole, by its journal alone; nothing is written.
///
/// # Errors
/// Records without a header, whose file is called the journal then; a job or rig file that this version does not accept.
pub fn judge(records: &[Record]) -> Result<(Verdict, Vec<Check>), ReportError> {
    let Some(Record::Header(header)) = records.first() else {
        return Err(ReportError::NoHeader {
            path: "the journal".into(),
        });
    };
    let examined = Examined::new(header, records)?;
    Ok((examined.run.verdict, examined.checks))
}

/// A run with all that follows from its journal before anything is written.
pub(crate) struct Examined {
    pub(crate) job: Job,
    pub(crate) rig: RigFile,
    pub(crate) run: Run,
    pub(crate) measurements: Vec<Measurement>,
    sweeps: Sweeps,
    pub(crate) model: Option<Box<dyn Model>>,
    pub(crate) no_model: Option<String>,
    checks: Vec<Check>,
}

impl Examined {
    pub(crate) fn new(header: &Header, records: &[Record]) -> Result<Self, ReportError> {
        let job = Job::parse(&header.job, "job file").map_err(ReportError::Job)?;
        let job = capture::extended_plan(records).map_or(job.clone(), |plan| job.grown(&plan));
        let rig = RigFile::parse(&header.rig, "rig file".as_ref()).map_err(ReportError::Rig)?;
        if let Some(certificate) = certificate(records) {
            certificate.check(&rig).map_err(ReportError::Certificate)?;
        }
        let mut run = Run::new(header, records);
        let measurements = measurements(records, &rig);
        let sweeps = Sweeps::new(&job, &measurements);
        let model = match run.complete() {
            true => sweeps.model(&job).map_err(|error| error.to_string()),
            false => Err("the run is not complete".to_owned()),
        };
        let (model, no_model) = match model {
            Ok(model) => (Some(model), None),
            Err(why) => (None, Some(why)),
        };
        let mut checks = vec![
            checks::reconstruction(model.as_deref(), no_model.as_deref(), run.complete()),
            checks::reflectance(&measurements, &job),
        ];
        checks.extend(inputs(&measurements, records, &rig));
        let planes = planes(&job, &measurements);
        checks.extend(check(&run, &job, &planes, &measurements));
        if let Some(model) = &model {
            checks.extend(check_model(model.as_ref(), &job, &planes, &rig));
        }
        run.judge(Verdict::overall(&checks, run.complete()));
        Ok(Self {
            job,
            rig,
            run,
            measurements,
            sweeps,
            model,
            no_model,
            checks,
        })
    }
}

/// brdf.binary, its uncertainty and what that holds, slice.exr, preview.exr and preview.png.
fn write_model(
    directory: &RunDirectory,
    job: &Job,
    model: &dyn Model,
    uncertainty: &ModelUncertainty<'_>,
    measurements: &[Measurement],
    volume: Volume,
) -> Result<(), ReportError> {
    let (f, u) = (table(job, model, model), table(job, model, uncertainty));
    if volume == Volume::Whole {
        for (name, table) in LARGE.into_iter().zip([&f, &u]) {
            directory.write(name, |file| table.write_to(file))?;
        }
    }
    let summary = UncertaintySummary::new(&f, &u, measurements);
    directory.write(UNCERTAINTY, |file| json(file, &summary))?;
    directory.write("slice.exr", |file| slice::write(model, file))?;
    let sphere = preview::sphere(model);
    directory.write("preview.exr", |file| sphere.write_exr(file, &preview::ATTRIBUTES))?;
    directory.write("preview.png", |file| {
        file.write_all(&sphere.png(preview::EXPOSURE)?)
    })
}

/// A model, or its uncertainty, as a table: of a job's scene where it has one.
fn table(job: &Job, model: &dyn Model, of: &dyn Brdf) -> MerlTable {
    match &job.scene {
        Some(scene) => MerlTable::fill(&Asked { of, model, scene }),
        None => MerlTable::fill(of),
    }
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

/// Checks of what the readings are worked out with: the dark level, and the certificate where one was used.
fn inputs(measurements: &[Measurement], records: &[Record], rig: &RigFile) -> Vec<Check> {
    let darkness = checks::darkness(measurements, records, rig);
    let calibration = checks::calibration(certificate(records));
    let visits = checks::visits(records, rig);
    std::iter::once(darkness)
        .chain(calibration)
        .chain(visits)
        .chain(checks::angles(measurements))
        .chain(checks::resumed(measurements, records))
        .collect()
}

/// What the readings say of the measurement, whatever is made of them.
fn check(run: &Run, job: &Job, planes: &[PlaneTold], measurements: &[Measurement]) -> Vec<Check> {
    let mut checks = vec![checks::bus(run)];
    if let Some(arc) = &job.arc {
        let of_arc = told(measurements, Sweep::Arc);
        let crossing = |(plane, theta_r): &PlaneTold| checks::crossing(plane, &of_arc, *theta_r, arc.offset);
        checks.extend(planes.iter().map(crossing));
    }
    let pairs = planes.windows(2).map(|pair| {
        let [first, second] = [0, 1].map(|i| (pair[i].0.as_slice(), pair[i].1));
        checks::helmholtz(first, second)
    });
    checks.extend(pairs);
    checks
}

/// What a plane tells, and its θ_r.
type PlaneTold = (Vec<Told>, f64);

/// What each plane of a job tells.
fn planes(job: &Job, measurements: &[Measurement]) -> Vec<PlaneTold> {
    let plane = |(i, plane): (usize, &sweep::Plane)| (told(measurements, Sweep::Plane(i)), plane.theta_r);
    job.planes.iter().enumerate().map(plane).collect()
}

/// What is to be said of a model. Who names another one than the usual on purpose knows what it takes for granted, and is
/// told at worst to look: its readings may be perfectly good.
fn check_model(model: &dyn Model, job: &Job, planes: &[PlaneTold], rig: &RigFile) -> Vec<Check> {
    let azimuths = if model.phi_p_constant() { 1 } else { AZIMUTHS };
    let sides = |(plane, theta_r): &PlaneTold| checks::sides(plane, *theta_r, model.phi_p_constant());
    let mut checks: Vec<Check> = planes.iter().map(sides).collect();
    checks.push(checks::coverage(model, &rig.envelope, job.arc.is_some()));
    checks.push(checks::energy(model, job.scene.as_ref(), azimuths));
    if job.model != sweep::Model::default() {
        for check in &mut checks {
            check.verdict = check.verdict.min(Verdict::Look);
        }
    }
    checks
}

fn json(mut file: impl Write, value: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut file, value)?;
    file.write_all(b"\n")
}
