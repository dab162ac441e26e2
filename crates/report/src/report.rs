use capture::{FileJournal, Record};
use rig::RigFile;
use serde::Serialize;
use sweep::{Job, LeftOut};

use crate::{Check, ReportError, Run, RunDirectory, checks, write_readings};

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
    /// What the plan left out and why.
    pub left_out: Vec<LeftOut>,
}

/// Makes everything in a run directory again from its journal.
///
/// # Errors
/// No journal, or a damaged one; as [`write()`].
pub fn reconstruct(directory: &RunDirectory) -> Result<Report, ReportError> {
    write(directory, &FileJournal::read(directory.journal())?)
}

/// Writes everything that follows from the records of a journal into its run directory. As long as there are too few
/// readings for a BRDF, only what can be said without one.
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
    let rig = RigFile::parse(&header.rig, "rig file".as_ref()).map_err(ReportError::Rig)?;
    let run = Run::new(header, records);
    let observations = crate::observe(records, &rig);
    directory.write("run.json", |file| Ok(serde_json::to_writer_pretty(file, &run)?))?;
    directory.write("readings.csv", |file| write_readings(&observations, file))?;
    let report = Report {
        specimen: job.specimen.clone(),
        checks: vec![checks::bus(&run)],
        left_out: header.plan.left_out.clone(),
        run,
    };
    directory.write("report.json", |file| {
        Ok(serde_json::to_writer_pretty(file, &report)?)
    })?;
    Ok(report)
}
