use std::f64::consts::PI;

use anyhow::Context;
use arms::ArmAngle;
use brdf::Brdf;
use capture::{FileJournal, Flag, Record};
use formats::{Export, Metadata, Reading};
use pdv::Model;
use report::{Measurement, Run, RunDirectory, Sweeps, flag_name, measurements};
use rig::RigFile;
use sweep::Job;

/// The model of a run, rebuilt from the readings in its journal, with all that an export can say of it.
pub(crate) struct Rebuilt {
    model: Box<dyn Model>,
    readings: Vec<Reading>,
    metadata: Metadata,
}

impl Rebuilt {
    /// Reads the journal of a run directory and makes its model again, as `gonioctl reconstruct` does.
    ///
    /// # Errors
    /// There is no journal, or it is damaged; the run is not complete; its readings make no model.
    pub(crate) fn from_journal(directory: &RunDirectory) -> anyhow::Result<Self> {
        let records = FileJournal::read(directory.journal())?;
        let Some(Record::Header(header)) = records.first() else {
            anyhow::bail!("{} has no header, so no plan", directory.journal().display());
        };
        let job = Job::parse(&header.job, "job file").context("the job file in the journal")?;
        let job = capture::extended_plan(&records).map_or(job.clone(), |plan| job.grown(&plan));
        let rig = RigFile::parse(&header.rig, "rig file".as_ref()).context("the rig file in the journal")?;
        let run = Run::new(header, &records);
        anyhow::ensure!(
            run.complete(),
            "the run in {} is not complete, so there is no BRDF; `gonioctl run --resume` goes on with it",
            directory.path().display()
        );
        let measurements = measurements(&records, &rig);
        let detector_rad = rig.uncertainty.apertures_rad[1];
        Ok(Self {
            model: Sweeps::new(&job, &measurements).model(&job)?,
            readings: measurements
                .iter()
                .enumerate()
                .map(|(index, m)| reading(index, m))
                .collect(),
            metadata: Metadata {
                specimen: job.specimen,
                date: run.started,
                instrument: format!("goniod {}", run.version),
                run: run.id,
                solid_angle_sr: (detector_rad > 0.0).then(|| PI * detector_rad.sin().powi(2)),
                uncertainty: "expanded, k = 2, of each reading".to_owned(),
                ..Metadata::default()
            },
        })
    }

    /// What is written into a file.
    pub(crate) fn export(&self) -> Export<'_> {
        let brdf: &dyn Brdf = self.model.as_ref();
        Export {
            brdf,
            readings: &self.readings,
            metadata: self.metadata.clone(),
        }
    }
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
