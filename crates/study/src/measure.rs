use std::sync::Arc;

use brdf::Brdf;
use capture::{Command, Header, MemoryJournal, Outcome, Record};
use firmware_sim::Bench;
use firmware_sim::in_process::InProcessRig;
use pdv::Observation;
use rig::{Drive, Rig, RigFile};
use sweep::{Job, Sweep};
use tokio::sync::watch;

use crate::Error;

/// Seconds per tick of the photometer's clock.
const TICK_S: f64 = 1e-5;

/// What a capture on the simulated rig brought.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Readings of each plane of the job, in its order, of those that were added, and of each leg.
    pub planes: Vec<Vec<Observation>>,
    /// Readings of the arc.
    pub arc: Vec<Observation>,
    /// Readings that count for a sweep.
    pub readings: usize,
    /// Everything that was exposed, dark readings and repeated exposures too.
    pub exposures: usize,
    /// Seconds that the rig took: the photometer's clock from power-on to the end, and for each exposure at rest the time
    /// that its packets need on the bus, which the in-process rig does not have.
    pub rig_s: f64,
    /// What was added on the way, of a job that says when to stop.
    pub adapted: Option<report::Adapted>,
}

/// Captures a job on the in-process rig over a specimen, under a paused clock: planned and run as on any rig.
///
/// # Errors
/// The rig cannot do the job, or the capture failed.
pub fn measure(job: &Job, rig: &RigFile, specimen: Arc<dyn Brdf>) -> Result<Measured, Error> {
    let Capture { records, bus_s } = Capture::new(job, rig, specimen)?;
    let measurements = report::measurements(&records, rig);
    let plan = capture::extended_plan(&records);
    let grown = plan.map_or_else(|| job.clone(), |plan| job.grown(&plan));
    let planes: Vec<_> = grown
        .curves()
        .map(|curve| report::observations(&measurements, curve))
        .collect();
    let arc = report::observations(&measurements, Sweep::Arc);
    let ends = || {
        records.iter().filter_map(|record| match record {
            Record::Begin { device_ticks, .. } => Some(*device_ticks),
            Record::End { device_ticks, .. } => *device_ticks,
            _ => None,
        })
    };
    // In flight the packets pass while the arms move.
    let at_rest = measurements
        .iter()
        .filter(|m| m.reading.swept_rad.is_none())
        .count();
    let ticks = ends().max().unwrap_or_default() - ends().min().unwrap_or_default();
    Ok(Measured {
        readings: planes.iter().map(Vec::len).sum::<usize>() + arc.len(),
        exposures: measurements.len(),
        rig_s: ticks as f64 * TICK_S + at_rest as f64 * bus_s,
        planes,
        arc,
        adapted: report::Adapted::new(&records),
    })
}

/// A capture on the simulated rig as its journal has it.
#[derive(Clone, Debug)]
pub struct Capture {
    /// The journal's records.
    pub records: Vec<Record>,
    /// Seconds that an exposure needs on the bus.
    pub bus_s: f64,
}

impl Capture {
    /// Captures a job as [`measure`] does.
    ///
    /// # Errors
    /// As for [`measure`].
    pub fn new(job: &Job, rig: &RigFile, specimen: Arc<dyn Brdf>) -> Result<Self, Error> {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .start_paused(true)
            .build()?;
        let (records, bus_s) = runtime.block_on(records(job, rig, specimen))?;
        Ok(Self { records, bus_s })
    }
}

/// The records of a capture, and the seconds that an exposure needs on the bus.
async fn records(job: &Job, file: &RigFile, specimen: Arc<dyn Brdf>) -> Result<(Vec<Record>, f64), Error> {
    let bench = Bench::with_specimen(file, specimen).map_err(|source| Error::Sim { source })?;
    let mut rig = InProcessRig::over(bench, file);
    let failed = |why: String| Error::Capture {
        job: job.name.clone(),
        why,
    };
    let start = rig
        .snapshot()
        .await
        .map_err(|error| failed(error.to_string()))?
        .pose();
    let mechanics = capture::mechanics(file, Some(start));
    let header = Header {
        run: String::new(),
        version: String::new(),
        job: String::new(),
        rig: String::new(),
        certificate: None,
        plan: sweep::plan(job, &mechanics)?,
        started: String::new(),
    };
    let mut journal = MemoryJournal(vec![Record::Header(header)]);
    let mut drive = Drive::new(rig, file.clone());
    let (_sender, control) = watch::channel(Command::Run);
    let mut ask = |records: &[Record]| -> capture::Thinking {
        // The clock stands still meanwhile, so that nobody has to look after the rig.
        Box::pin(std::future::ready(report::extension(job, records, file)))
    };
    let outcome = capture::run_and_ask(&mut drive, &mut journal, control, &mut |_| (), &mut ask)
        .await
        .map_err(|error| failed(error.to_string()))?;
    match outcome {
        Outcome::Done => Ok((journal.0, mechanics.transaction_s)),
        Outcome::Stopped => Err(failed("it was stopped".to_owned())),
        Outcome::Failed { fault } => Err(failed(fault)),
    }
}
