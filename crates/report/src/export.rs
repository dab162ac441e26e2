use std::f64::consts::PI;
use std::io::{self, Write};

use arms::ArmAngle;
use brdf::Brdf;
use capture::{FileJournal, Flag, Record};
use formats::{Export, Exported, FORMATS, Fidelity, Format, Metadata, Reading};
use pdv::{Check, Corrected, Model, WedgeReading};
use rig::RigFile;
use serde::Serialize;
use sweep::Job;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::report::Examined;
use crate::{Measurement, ReportError, Run, RunDirectory, flag_name, write_readings};

/// Longest part of a file's name that is of the specimen, characters.
const LONGEST: usize = 60;
/// Characters of an RFC 3339 time that are its date.
const DATE: usize = 10;

/// The model of a run with all that a file in some format can say of it.
pub struct RunExport {
    model: Box<dyn Model>,
    measurements: Vec<Measurement>,
    readings: Vec<Reading>,
    metadata: Metadata,
}

impl RunExport {
    /// Makes the model of a run again from its journal, as [`crate::reconstruct`] does; writes nothing.
    ///
    /// # Errors
    /// No journal, or a damaged one; as [`RunExport::from_records`].
    pub fn read(directory: &RunDirectory) -> Result<Self, ReportError> {
        Self::from_records(&FileJournal::read(directory.journal())?)
    }

    /// The same from the records of a journal.
    ///
    /// # Errors
    /// Records without a header, whose file is called the journal then; a job or rig file that this version does not
    /// accept; a run of which there is no model, because it is not complete or has too few usable readings.
    pub fn from_records(records: &[Record]) -> Result<Self, ReportError> {
        let Some(Record::Header(header)) = records.first() else {
            return Err(ReportError::NoHeader {
                path: "the journal".into(),
            });
        };
        let examined = Examined::new(header, records)?;
        let Some(model) = examined.model else {
            let why = examined.no_model.unwrap_or_default();
            return Err(ReportError::NoModel { why });
        };
        let Examined {
            job,
            rig,
            run,
            measurements,
            ..
        } = examined;
        Ok(Self {
            model,
            readings: readings(&measurements),
            metadata: metadata(&job, &rig, &run, &measurements),
            measurements,
        })
    }

    /// Corrects the model out of the arms' plane by readings of the same specimen on wedges, which also says how far it was
    /// from them. Without any it stays as it is.
    #[must_use]
    pub fn corrected(self, readings: &[WedgeReading]) -> (Self, Check) {
        let corrected = Corrected::new(self.model, readings);
        let check = corrected.check();
        let model: Box<dyn Model> = Box::new(corrected);
        (Self { model, ..self }, check)
    }

    /// What is written into a file.
    pub fn export(&self) -> Export<'_> {
        let brdf: &dyn Brdf = self.model.as_ref();
        Export {
            brdf,
            readings: &self.readings,
            metadata: self.metadata.clone(),
        }
    }

    /// The name of a file of a format: specimen, date, format and extension, of ASCII letters, digits, `.`, `_` and `-`.
    pub fn file_name(&self, format: &Format) -> String {
        file_name(&self.metadata, format.name, format.extension)
    }

    /// The name of something else of this run: specimen, date, what it is, and its extension.
    pub fn name_of(&self, what: &str, extension: &str) -> String {
        file_name(&self.metadata, what, extension)
    }
}

/// Where in an archive the figures of every format stand.
const FIGURES: &str = "formats.txt";

impl RunExport {
    /// Writes an archive (ZIP) of the readings and of the result in every format that holds it, with formats.txt, which has
    /// what was found of each when it was read back and why the others were refused.
    ///
    /// # Errors
    /// What `out` says.
    pub fn archive(&self, out: impl Write) -> io::Result<()> {
        let mut archive = ZipWriter::new_stream(out);
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        let mut figures = String::new();
        archive.start_file(self.name_of("readings", "csv"), options)?;
        write_readings(&self.measurements, &mut archive)?;
        for format in &FORMATS {
            let line = match format.export(&self.export()) {
                Err(why) => format!("{}: refused: {why}\n", format.name),
                Ok(exported) => {
                    let name = self.file_name(format);
                    archive.start_file(&name, options)?;
                    archive.write_all(&exported.bytes)?;
                    format!("{}: {name}: {}\n", format.name, exported.fidelity)
                }
            };
            figures += &line;
        }
        archive.start_file(FIGURES, options)?;
        archive.write_all(figures.as_bytes())?;
        archive.finish()?;
        Ok(())
    }
}

/// A file in a format that the job asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExportedFile {
    /// Name of the format.
    pub format: &'static str,
    /// Name of the file; `None` where it was refused.
    pub file: Option<String>,
    /// Its size.
    pub bytes: Option<usize>,
    /// Mean |ln(1 + f cos θ_i) − ln(1 + f̂ cos θ_i)| of what was read back.
    pub male: Option<f64>,
    /// Median relative error of what was read back.
    pub median_rel: Option<f64>,
    /// 95th percentile of the same.
    pub p95_rel: Option<f64>,
    /// What was found when it was read back, in words; why it was refused, where it was.
    pub text: String,
}

impl ExportedFile {
    fn new(format: &'static Format, file: String, exported: &Exported) -> Self {
        let Fidelity {
            male, median, p95, ..
        } = exported.fidelity;
        Self {
            format: format.name,
            file: Some(file),
            bytes: Some(exported.bytes.len()),
            male: Some(male),
            median_rel: Some(median),
            p95_rel: Some(p95),
            text: exported.fidelity.to_string(),
        }
    }

    fn refused(format: &'static Format, why: &formats::Error) -> Self {
        Self {
            format: format.name,
            file: None,
            bytes: None,
            male: None,
            median_rel: None,
            p95_rel: None,
            text: why.to_string(),
        }
    }
}

/// Writes the files for which a job asks into its run directory, with what was found of each when it was read back. A
/// format that does not hold the specimen is no reason to have no report.
pub(crate) fn write(
    directory: &RunDirectory,
    job: &Job,
    rig: &RigFile,
    run: &Run,
    model: &dyn Model,
    measurements: &[Measurement],
) -> Result<Vec<ExportedFile>, ReportError> {
    let of = |name: &&str| Format::named(name).expect("a test compares sweep::FORMATS with formats::FORMATS");
    let wanted: Vec<&'static Format> = job.formats.iter().map(of).collect();
    if wanted.is_empty() {
        return Ok(Vec::new());
    }
    let readings = readings(measurements);
    let brdf: &dyn Brdf = model;
    let export = Export {
        brdf,
        readings: &readings,
        metadata: metadata(job, rig, run, measurements),
    };
    let mut files = Vec::new();
    for format in wanted {
        files.push(match format.export(&export) {
            Err(why) => ExportedFile::refused(format, &why),
            Ok(exported) => {
                let name = file_name(&export.metadata, format.name, format.extension);
                directory.write(&name, |file| file.write_all(&exported.bytes))?;
                ExportedFile::new(format, name, &exported)
            }
        });
    }
    Ok(files)
}

/// Specimen, date, what it is and extension, of characters that every file system and URL takes.
fn file_name(metadata: &Metadata, what: &str, extension: &str) -> String {
    let lower = metadata.specimen.to_lowercase();
    let words = lower
        .split(|c: char| !c.is_ascii_alphanumeric())
        .filter(|word| !word.is_empty());
    let mut specimen = words.collect::<Vec<_>>().join("-");
    specimen.truncate(LONGEST);
    let specimen = match specimen.trim_end_matches('-') {
        "" => "specimen",
        specimen => specimen,
    };
    let date = metadata
        .date
        .get(..DATE)
        .filter(|date| date.bytes().all(|b| b.is_ascii_digit() || b == b'-'));
    let parts: Vec<&str> = [Some(specimen), date, Some(what)].into_iter().flatten().collect();
    format!("{}.{extension}", parts.join("-"))
}

fn metadata(job: &Job, rig: &RigFile, run: &Run, measurements: &[Measurement]) -> Metadata {
    let [light_rad, sensor_rad] = rig.uncertainty.apertures_rad;
    let half_angles = [light_rad, sensor_rad].map(|rad| (rad.to_degrees() * 1e6).round() / 1e6);
    Metadata {
        specimen: job.specimen.name.clone(),
        date: run.started.clone(),
        instrument: format!("goniod {}", run.version),
        run: run.id.clone(),
        apertures_deg: Some(half_angles),
        solid_angle_sr: (sensor_rad > 0.0).then(|| PI * sensor_rad.sin().powi(2)),
        uncertainty: uncertainty(measurements),
        record: run
            .record()
            .into_iter()
            .map(|(key, _, value)| (key, value))
            .collect(),
        ..Metadata::default()
    }
}

/// What is known of the uncertainty, in words: the median of what was worked out for the readings.
fn uncertainty(measurements: &[Measurement]) -> String {
    let relative = |m: &Measurement| {
        let (f, u) = (m.rgb()?, m.u?);
        (f.min_element() > 0.0).then(|| (u / f).element_sum() / 3.0)
    };
    let mut all: Vec<f64> = measurements
        .iter()
        .filter_map(relative)
        .filter(|u| u.is_finite())
        .collect();
    all.sort_unstable_by(f64::total_cmp);
    match all.get(all.len() / 2) {
        Some(median) => format!(
            "expanded, k = 2, of each reading; median {:.2} % of the reflectance",
            100.0 * median
        ),
        None => String::new(),
    }
}

fn readings(measurements: &[Measurement]) -> Vec<Reading> {
    measurements
        .iter()
        .enumerate()
        .map(|(index, m)| reading(index, m))
        .collect()
}

/// A measurement as formats have it: azimuth 0 towards +x of the arms' plane, π towards −x.
fn reading(index: usize, m: &Measurement) -> Reading {
    let azimuth = |angle: ArmAngle| if angle.rad() < 0.0 { PI } else { 0.0 };
    let mut flags: Vec<&str> = m.reading.flags.iter().map(|&flag| flag_name(flag)).collect();
    if !m.reading.accepted {
        flags.push("repeated");
    }
    // The arms may have been aligned since the reading was flagged.
    if m.shadowed && !m.reading.flags.contains(&Flag::Shadowed) {
        flags.push("shadowed");
    }
    Reading {
        index,
        theta_i_rad: m.pose.light.rad().abs(),
        phi_i_rad: azimuth(m.pose.light),
        theta_r_rad: m.pose.sensor.rad().abs(),
        phi_r_rad: azimuth(m.pose.sensor),
        f: m.rgb(),
        u: m.u,
        flags: flags.join("|"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_may_ask_for_every_format_and_for_no_other() {
        let known: Vec<&str> = formats::FORMATS.iter().map(|format| format.name).collect();
        assert_eq!(sweep::FORMATS.to_vec(), known);
    }

    #[test]
    fn a_name_has_specimen_and_date_and_nothing_that_a_file_system_or_a_header_refuses() {
        let name = |specimen: &str, date: &str| {
            let metadata = Metadata {
                specimen: specimen.to_owned(),
                date: date.to_owned(),
                ..Metadata::default()
            };
            file_name(&metadata, "astm", "astm")
        };
        assert_eq!(
            name("Gold paint, simulated", "2026-12-01T04:05:06Z"),
            "gold-paint-simulated-2026-12-01-astm.astm"
        );
        assert_eq!(name("", ""), "specimen-astm.astm");
        assert_eq!(name("../../\"\r\n\u{202e}", "2026"), "specimen-astm.astm");
        assert_eq!(name("Lack grün №5", "über"), "lack-gr-n-5-astm.astm");
        assert_eq!(name(&"x-".repeat(90), "").len(), "-astm.astm".len() + 59);
    }
}
