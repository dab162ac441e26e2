use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use capture::{Command, Event, FileJournal, Header, Journal, Outcome};
use report::{RunDirectory, Standard};
use rig::{Certificate, Port, RigFile, WallClock};
use tokio::sync::watch;
use ulid::Ulid;

use crate::run::unwritable;
use crate::{Certificates, OpenRig, SessionError, Status, prepare_output, rig_text, run_directory_name};

/// A calibration to be made: what lies on the stage of which rig.
#[derive(Clone, Debug)]
pub struct Calibration {
    rig: RigFile,
    rig_text: String,
    rig_name: String,
    standard: Standard,
    clock: fn() -> SystemTime,
}

/// How a calibration ended.
#[derive(Debug)]
pub struct Calibrated {
    /// How its capture ended.
    pub outcome: Outcome,
    /// Where its journal is.
    pub directory: PathBuf,
    /// The new certificate and its file, where the capture was completed.
    pub certificate: Option<(Certificate, PathBuf)>,
}

impl Calibrated {
    /// The exit status.
    pub fn status(&self) -> Status {
        Status::from(&self.outcome)
    }
}

impl Calibration {
    /// Reads the rig file: the one named, else config/rig.toml in the working directory, else the built-in one. On the
    /// built-in simulator `specimen` lies on the stage, or what stands for the standard.
    ///
    /// # Errors
    /// A rig file that cannot be read, or what is wrong in it.
    pub fn new(rig: Option<&Path>, standard: Standard, specimen: Option<&str>) -> Result<Self, SessionError> {
        let (rig_text, name) = rig_text(rig)?;
        let mut rig = RigFile::parse(&rig_text, &name)?;
        if rig.bus.port == Port::Sim
            && let Some(specimen) = specimen.map(str::to_owned).or_else(|| standard.simulated())
        {
            rig.sim.insert("specimen".to_owned(), specimen.into());
        }
        Ok(Self {
            rig,
            rig_text,
            rig_name: name.display().to_string(),
            standard,
            clock: SystemTime::now,
        })
    }

    /// The same by another wall clock than that of the system.
    #[must_use]
    pub fn with_clock(mut self, clock: fn() -> SystemTime) -> Self {
        self.clock = clock;
        self
    }

    /// Takes the readings of the standard, into a directory of their own beside the certificates, and makes a new
    /// certificate of them and of the other parts of the newest one for this rig file. The arms move.
    ///
    /// # Errors
    /// A clock that cannot be right, since the calibration would be dated wrongly; what is wrong with files, port and
    /// devices; readings that do not make a calibration; a medium that refuses.
    pub async fn carry_out(
        &self,
        control: watch::Receiver<Command>,
        on_event: &mut (dyn FnMut(Event) + Send),
    ) -> Result<Calibrated, SessionError> {
        let now = (self.clock)();
        if let Some(why) = WallClock::at(now).fault() {
            return Err(SessionError::Clock { why });
        }
        let certificates = Certificates::at(&self.rig.certificates.directory);
        let visits = self.standard.visits(&self.rig);
        let plan = |start| {
            sweep::visits(
                self.standard.name(),
                &visits,
                &capture::mechanics(&self.rig, start),
            )
        };
        plan(None)?;
        let before = certificates.newest(&self.rig)?.unwrap_or_default();
        prepare_output(certificates.path())?;
        let mut station = OpenRig::open(&self.rig, &self.rig_name)?;
        let start = station.start().await?;
        let id = Ulid::generate();
        let made = humantime::format_rfc3339_seconds(now).to_string();
        let header = Header {
            run: id.to_string(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            job: format!("# calibration with {}\n", self.standard.name()),
            rig: self.rig_text.clone(),
            plan: plan(Some(start))?,
            started: made.clone(),
            certificate: None,
        };
        let directory = RunDirectory::at(certificates.path().join(run_directory_name(now, &id)));
        fs::create_dir(directory.path()).map_err(unwritable(directory.path()))?;
        let mut journal = FileJournal::create(directory.journal(), header)?;
        let outcome = capture::run(&mut station.drive, &mut journal, control, on_event).await?;
        let certificate = match outcome {
            Outcome::Done => {
                let parts = self.standard.certify(&self.rig, journal.records(), &before)?;
                let remarks =
                    parts.differences(Some(&before).filter(|before| before.white.is_some()), &self.rig);
                let (certificate, path) = certificates.keep(Certificate {
                    id: id.to_string(),
                    made,
                    rig: self.rig.fingerprint.clone(),
                    ..parts
                })?;
                Some((
                    Certificate {
                        remarks,
                        ..certificate
                    },
                    path,
                ))
            }
            _ => None,
        };
        Ok(Calibrated {
            outcome,
            directory: directory.path().to_owned(),
            certificate,
        })
    }
}
