use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use arms::Pose;
use capture::Header;
use rig::{Certificate, RigFile, WallClock};
use sweep::{Job, Light, Plan};
use ulid::Ulid;

use crate::{Certificates, SessionError, job_text};

/// Where a rig file is looked for when none is named, seen from the working directory.
const RIG_HERE: &str = "config/rig.toml";

/// A job and the rig that is to do it, both read and checked; nothing was touched yet.
#[derive(Clone, Debug)]
pub struct RunRequest {
    /// What is to be measured.
    pub job: Job,
    /// The rig.
    pub rig: RigFile,
    /// The job file as given, with what it names written out.
    pub job_text: String,
    /// The rig file as given.
    pub rig_text: String,
    /// What messages call the rig file.
    pub rig_name: String,
}

impl RunRequest {
    /// Reads a job file, with the histogram that it may name, and a rig file: the one named, else config/rig.toml in the
    /// working directory if there is one, else the built-in one.
    ///
    /// # Errors
    /// A file that cannot be read, or what is wrong in it with its place.
    pub fn read(job: &Path, rig: Option<&Path>) -> Result<Self, SessionError> {
        let job_text = job_text(job)?;
        let (rig_text, rig_name) = rig_text(rig)?;
        Self::parse(job_text, &job.to_string_lossy(), rig_text, &rig_name)
    }

    /// The order of a run that was begun before, from its journal.
    ///
    /// # Errors
    /// Texts that this version does not accept any more.
    pub fn resumed(header: &Header) -> Result<Self, SessionError> {
        let (job, rig) = (header.job.clone(), header.rig.clone());
        Self::parse(job, "the run's job file", rig, Path::new("the run's rig file"))
    }

    /// The order of a run that was begun before, on the rig that a file describes now. Only where the rig is connected
    /// (`[bus]`) and the simulator (`[sim]`) may differ from the rig file with which the run began.
    ///
    /// # Errors
    /// Texts that this version does not accept any more; a rig file that cannot be read, is wrong, or describes
    /// another rig.
    pub fn resumed_on(header: &Header, rig: &Path) -> Result<Self, SessionError> {
        let (text, name) = rig_text(Some(rig))?;
        let file = RigFile::parse(&text, &name)?;
        same_rig(header, &file)?;
        Ok(Self {
            rig: file,
            rig_name: name.display().to_string(),
            ..Self::resumed(header)?
        })
    }

    /// Reads the texts of a job file and of a rig file; the names are what messages call them.
    ///
    /// # Errors
    /// What is wrong in them, with its place.
    pub fn parse(
        job_text: String,
        job_name: &str,
        rig_text: String,
        rig_name: &Path,
    ) -> Result<Self, SessionError> {
        Ok(Self {
            job: Job::parse(&job_text, job_name)?,
            rig: RigFile::parse(&rig_text, rig_name)?,
            job_text,
            rig_text,
            rig_name: rig_name.display().to_string(),
        })
    }

    /// First record of the journal of a run that begins now.
    ///
    /// # Errors
    /// The rig file asks for a stored calibration and there is no valid one.
    pub fn header(&self, plan: Plan, run: &Ulid, now: SystemTime) -> Result<Header, SessionError> {
        Ok(Header {
            run: run.to_string(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            job: self.job_text.clone(),
            rig: self.rig_text.clone(),
            plan,
            started: humantime::format_rfc3339_seconds(now).to_string(),
            certificate: self.certificate(now)?.map(Box::new),
        })
    }

    /// The stored calibration that holds for a run that begins now, where the rig file asks for one.
    ///
    /// # Errors
    /// There is no valid one.
    pub fn certificate(&self, now: SystemTime) -> Result<Option<Certificate>, SessionError> {
        let settings = &self.rig.certificates;
        let clock = WallClock::at(now);
        if !settings.required {
            if let Some(why) = clock.fault() {
                tracing::warn!("{why}");
            }
            return Ok(None);
        }
        let certificate = Certificates::at(&settings.directory).valid(&self.rig, clock)?;
        for remark in &certificate.remarks {
            tracing::warn!("calibration {}: {remark}", certificate.id);
        }
        Ok(Some(certificate))
    }

    /// What the order becomes on its rig, with the arms standing at `start`.
    ///
    /// # Errors
    /// What of the job this rig cannot do, or that the arms stand where no motion may begin.
    pub fn plan(&self, start: Option<Pose>) -> Result<Plan, SessionError> {
        Ok(sweep::plan(&self.job, &capture::mechanics(&self.rig, start))?)
    }

    /// What the choice of exposures may make of a plan's time on this rig.
    pub fn light(&self, plan: &Plan) -> Light {
        Light::new(plan, &capture::mechanics(&self.rig, None))
    }
}

/// Checks that a rig is the one with which a run began: only where it is connected, and the simulator, may differ.
///
/// # Errors
/// It is another one; the run's rig file is not accepted any more.
pub fn same_rig(header: &Header, rig: &RigFile) -> Result<(), SessionError> {
    let mut began = RigFile::parse(&header.rig, Path::new("the run's rig file"))?;
    began.bus = rig.bus.clone();
    began.sim = rig.sim.clone();
    // What it is called makes it no other rig.
    began.about = rig.about.clone();
    if began != *rig {
        return Err(SessionError::OtherRig {
            run: header.run.clone(),
        });
    }
    Ok(())
}

/// Text of a rig file and what messages call it: the file named, else config/rig.toml in the working directory if there
/// is one, else the built-in one.
///
/// # Errors
/// The file cannot be read.
pub fn rig_text(rig: Option<&Path>) -> Result<(String, PathBuf), SessionError> {
    match rig {
        Some(path) => Ok((read("rig file", path, config::read_text)?, path.to_owned())),
        None if Path::new(RIG_HERE).exists() => {
            let here = Path::new(RIG_HERE);
            Ok((read("rig file", here, config::read_text)?, here.to_owned()))
        }
        None => Ok((RigFile::BUILT_IN.to_owned(), PathBuf::from("built-in rig file"))),
    }
}

/// Reads and checks a rig file, chosen as [`rig_text`] says, and returns it with what messages call it.
///
/// # Errors
/// The file cannot be read, or what is wrong in it with its place.
pub fn rig_file(rig: Option<&Path>) -> Result<(RigFile, PathBuf), SessionError> {
    let (text, name) = rig_text(rig)?;
    Ok((RigFile::parse(&text, &name)?, name))
}

/// Reads a file of a request, which the error names.
pub(crate) fn read<T>(
    what: &'static str,
    path: &Path,
    how: impl Fn(&Path) -> io::Result<T>,
) -> Result<T, SessionError> {
    how(path).map_err(|source| SessionError::Read {
        what,
        path: path.to_owned(),
        source,
    })
}
