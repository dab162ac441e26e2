use std::path::{Path, PathBuf};

use brdf::Brdf;
use capture::{FileJournal, Reading, Record, extended_plan};
use pdv::{Model, Observation, Separable};
use report::{Measurement, Sweeps, measurements};
use rig::RigFile;
use sweep::{Job, Sweep};

/// What a run left behind, read back through the libraries.
pub struct Captured {
    /// The run directory.
    pub directory: PathBuf,
    /// Its journal.
    pub records: Vec<Record>,
    /// What follows from the readings.
    pub measurements: Vec<Measurement>,
}

impl Captured {
    /// Reads a run directory.
    ///
    /// # Panics
    /// If there is none.
    pub fn read(directory: &Path) -> Self {
        let records = FileJournal::read(directory.join("journal")).expect("a run has a journal");
        let Some(Record::Header(header)) = records.first() else {
            panic!("the journal begins with a header");
        };
        let rig = RigFile::parse(&header.rig, Path::new("rig")).expect("the run's rig file is sound");
        Self {
            directory: directory.to_owned(),
            measurements: measurements(&records, &rig),
            records,
        }
    }

    /// Readings in the order in which they were taken.
    pub fn readings(&self) -> impl Iterator<Item = &Reading> {
        self.measurements.iter().map(|measurement| &measurement.reading)
    }

    /// How many accepted readings each step has, of the plan and of what a hold or an interruption has added to it.
    ///
    /// # Panics
    /// If a reading is of no step.
    pub fn accepted(&self) -> Vec<usize> {
        let plan = extended_plan(&self.records).expect("the journal begins with a header");
        let mut accepted = vec![0; plan.steps.len()];
        for reading in self.readings().filter(|reading| reading.accepted) {
            accepted[reading.step] += 1;
        }
        accepted
    }

    /// The model that the run's job asks for, of what was measured.
    ///
    /// # Panics
    /// If the readings make none.
    pub fn model(&self) -> Box<dyn Model> {
        let Some(Record::Header(header)) = self.records.first() else {
            panic!("the journal begins with a header");
        };
        let job = Job::parse(&header.job, "job").expect("the run's job is sound");
        let sweeps = Sweeps::new(&job, &self.measurements);
        sweeps.model(&job).expect("enough readings")
    }

    /// The separable model of a material sampled directly, without any instrument, at the run's measured angles.
    ///
    /// # Panics
    /// If the readings make none.
    pub fn direct(&self, material: &dyn Brdf) -> Separable {
        let [plane, arc] = [Sweep::Plane(0), Sweep::Arc].map(|sweep| {
            let of_sweep = self
                .measurements
                .iter()
                .filter(|m| m.reading.sweep == sweep && m.reading.accepted);
            let sampled: Vec<_> = of_sweep
                .map(|m| Observation {
                    theta_r: m.theta_r,
                    deviation: m.deviation,
                    rgb: material.eval(m.reading.measured.incident(), m.reading.measured.exitant()),
                })
                .collect();
            sampled
        });
        Separable::from_observations(&plane, &arc).expect("enough readings")
    }
}

/// Median and 99th percentile of |a − b| / b over all valid entries of two MERL files, read byte by byte.
///
/// # Panics
/// If a file cannot be read or differs from the other in what is valid.
pub fn difference(a: &Path, b: &Path) -> (f64, f64) {
    let [a, b] = [a, b].map(|path| {
        let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        entries(&bytes)
    });
    let mut differences: Vec<f64> = a
        .iter()
        .zip(&b)
        .inspect(|(a, b)| assert_eq!(**a < 0.0, **b < 0.0, "one entry is valid in one file only"))
        .filter(|(a, _)| **a >= 0.0)
        .map(|(a, b)| (a - b).abs() / b.abs().max(f64::MIN_POSITIVE))
        .collect();
    differences.sort_by(f64::total_cmp);
    let at = |share: f64| differences[((differences.len() - 1) as f64 * share) as usize];
    (at(0.5), at(0.99))
}

/// The float64 entries of a MERL file, planes red, green, blue.
///
/// # Panics
/// If there are fewer than twelve bytes.
pub fn entries(bytes: &[u8]) -> Vec<f64> {
    let words = bytes[12..].chunks_exact(8);
    words
        .map(|word| f64::from_le_bytes(word.try_into().expect("chunks of eight bytes")))
        .collect()
}
