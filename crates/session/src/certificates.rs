use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rig::{Certificate, RigFile, WallClock};

use crate::SessionError;

mod file;

/// The stored calibrations of a directory, one JSON file each, named for its id.
///
/// Their order is that of the numbers that they were given as they were stored; those of programs that gave none come
/// before, in the order of their ids. The wall clock orders nothing.
#[derive(Clone, Debug)]
pub struct Certificates(PathBuf);

/// A certificate with its file.
#[derive(Clone, Debug)]
struct Stored {
    path: PathBuf,
    certificate: Certificate,
    /// Whether the file has a digest, with which it agrees.
    sealed: bool,
}

impl Stored {
    fn refuse(&self, why: impl Into<String>) -> SessionError {
        file::refused(&self.path, why)
    }

    /// Checks that its values can be those of a rig.
    fn check(&self, rig: &RigFile) -> Result<(), SessionError> {
        self.certificate
            .check(rig)
            .map_err(|error| self.refuse(error.to_string()))
    }
}

impl Certificates {
    /// Those in a directory, which need not exist yet.
    pub fn at(directory: impl Into<PathBuf>) -> Self {
        Self(directory.into())
    }

    /// Where they are.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// The newest one for a rig file, however old, with what is worth a look in it; `None`: there is none.
    ///
    /// # Errors
    /// A directory or file that cannot be read, a file that is no certificate or was changed after it was written, two
    /// with one number, or a value in the newest one that no rig of this rig file can have.
    pub fn newest(&self, rig: &RigFile) -> Result<Option<Certificate>, SessionError> {
        let mut stored = self.all()?;
        stored.retain(|stored| stored.certificate.rig == rig.fingerprint);
        let Some(newest) = stored.pop() else {
            return Ok(None);
        };
        newest.check(rig)?;
        // One that is not believed is nothing to compare with.
        let before = stored.pop().filter(|before| before.check(rig).is_ok());
        if let Some(before) = &before
            && newest.certificate.number != 0
            && before.certificate.number == newest.certificate.number
        {
            return Err(newest.refuse(format!(
                "its number, {}, is also that of {}: nobody can tell which is newer",
                newest.certificate.number,
                before.path.display()
            )));
        }
        let mut certificate = newest.certificate;
        certificate.remarks = certificate.differences(before.as_ref().map(|before| &before.certificate), rig);
        if !newest.sealed {
            certificate.remarks.push(format!(
                "The calibration {} has no digest, since an older version of this program made it: nobody can tell \
                 whether it was edited or damaged. Calibrate anew.",
                certificate.id
            ));
        }
        Ok(Some(certificate))
    }

    /// The one that holds for a run that begins now: the newest for the rig file, with a white reference, and with no
    /// part older than the rig file allows.
    ///
    /// # Errors
    /// There is none, or it is too old; a clock that cannot be right, since no age can be told by it; as
    /// [`Certificates::newest`].
    pub fn valid(&self, rig: &RigFile, clock: WallClock) -> Result<Certificate, SessionError> {
        let refuse = |why: String| SessionError::Uncertified {
            directory: self.0.clone(),
            why,
        };
        if let Some(why) = clock.fault() {
            return Err(refuse(format!("no age of a calibration can be told: {why}")));
        }
        let Some(certificate) = self.newest(rig)? else {
            return Err(refuse(
                "there is none for this rig file; make one with `gonioctl calibrate white`".to_owned(),
            ));
        };
        if certificate.white.is_none() {
            return Err(refuse(format!(
                "{} has no white reference; add one with `gonioctl calibrate white`",
                certificate.id
            )));
        }
        for (part, conditions) in certificate.parts() {
            let made = humantime::parse_rfc3339(&conditions.made).map_err(|error| {
                refuse(format!(
                    "{} has a {part} part of {:?}, which is no time ({error}); make it again with `gonioctl calibrate {part}`",
                    certificate.id, conditions.made
                ))
            })?;
            if clock.is_before(made) {
                return Err(refuse(format!(
                    "its {part} part is of {}, and the clock of this computer says {}: one of them is wrong. Set the \
                     clock; if it is right, it was wrong when the part was made: make it again with `gonioctl calibrate {part}`",
                    conditions.made,
                    humantime::format_rfc3339_seconds(clock.now)
                )));
            }
            let max = rig.certificates.max_age;
            if age(made, clock.now) > max {
                return Err(refuse(format!(
                    "its {part} part is of {}, max_age_h allows {:.1} h; make it again with `gonioctl calibrate {part}`",
                    conditions.made,
                    max.as_secs_f64() / 3600.0
                )));
            }
        }
        Ok(certificate)
    }

    /// Stores a certificate, complete or not at all, as the newest of the directory; returns it with its number, and
    /// its file.
    ///
    /// # Errors
    /// The medium refused; a file in the directory that cannot be read, so that nobody knows the numbers.
    pub fn keep(&self, certificate: Certificate) -> Result<(Certificate, PathBuf), SessionError> {
        let numbers = self.all()?.into_iter().map(|stored| stored.certificate.number);
        let certificate = Certificate {
            number: numbers.max().unwrap_or_default() + 1,
            remarks: Vec::new(),
            ..certificate
        };
        let name = format!("{}.json", certificate.id);
        let directory = report::RunDirectory::at(&self.0);
        directory.write(&name, |out| file::write(&certificate, out))?;
        Ok((certificate, directory.file(&name)))
    }

    /// All of them, oldest first.
    fn all(&self) -> Result<Vec<Stored>, SessionError> {
        let failed = |source| SessionError::Read {
            what: "calibrations in",
            path: self.0.clone(),
            source,
        };
        let entries = match fs::read_dir(&self.0) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(failed(error)),
        };
        let mut paths: Vec<PathBuf> = entries
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<Result<_, _>>()
            .map_err(failed)?;
        paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
        let mut stored = paths
            .into_iter()
            .map(file::read)
            .collect::<Result<Vec<Stored>, _>>()?;
        stored.sort_by(|a, b| {
            let key = |stored: &Stored| stored.certificate.number;
            key(a)
                .cmp(&key(b))
                .then_with(|| a.certificate.id.cmp(&b.certificate.id))
        });
        Ok(stored)
    }
}

/// How long ago a time was; one that is still to come, by less than clocks differ, is no age.
fn age(made: SystemTime, now: SystemTime) -> Duration {
    now.duration_since(made).unwrap_or_default()
}

#[cfg(test)]
mod tests;
