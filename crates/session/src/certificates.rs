use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rig::{Certificate, RigFile};

use crate::SessionError;

/// The stored calibrations of a directory, one JSON file each, named for its id.
#[derive(Clone, Debug)]
pub struct Certificates(PathBuf);

impl Certificates {
    /// Those in a directory, which need not exist yet.
    pub fn at(directory: impl Into<PathBuf>) -> Self {
        Self(directory.into())
    }

    /// Where they are.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// The newest one for a rig file, however old; `None`: there is none.
    ///
    /// # Errors
    /// A directory or file that cannot be read, or is no certificate.
    pub fn newest(&self, rig: &RigFile) -> Result<Option<Certificate>, SessionError> {
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| SessionError::Read {
                what: "calibration",
                path,
                source,
            }
        };
        let entries = match fs::read_dir(&self.0) {
            Ok(entries) => entries,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(failed(&self.0)(error)),
        };
        let mut paths: Vec<PathBuf> = entries
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<Result<_, _>>()
            .map_err(failed(&self.0))?;
        paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
        // Names begin with ids, and ids with their time.
        paths.sort();
        for path in paths.iter().rev() {
            let text = fs::read_to_string(path).map_err(failed(path))?;
            let certificate: Certificate =
                serde_json::from_str(&text).map_err(|error| failed(path)(error.into()))?;
            if certificate.rig == rig.fingerprint {
                return Ok(Some(certificate));
            }
        }
        Ok(None)
    }

    /// The one that holds for a run that begins now: the newest for the rig file, with a white reference, and with no
    /// part older than the rig file allows.
    ///
    /// # Errors
    /// There is none, or it is too old; as [`Certificates::newest`].
    pub fn valid(&self, rig: &RigFile, now: SystemTime) -> Result<Certificate, SessionError> {
        let refuse = |why: String| SessionError::Uncertified {
            directory: self.0.clone(),
            why,
        };
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
            let age = age(&conditions.made, now);
            let max = rig.certificates.max_age;
            if age.is_none_or(|age| age > max) {
                return Err(refuse(format!(
                    "its {part} part is of {}, max_age_h allows {:.1} h; make it again with `gonioctl calibrate {part}`",
                    conditions.made,
                    max.as_secs_f64() / 3600.0
                )));
            }
        }
        Ok(certificate)
    }

    /// Stores a certificate, complete or not at all.
    ///
    /// # Errors
    /// The medium refused.
    pub fn keep(&self, certificate: &Certificate) -> Result<PathBuf, SessionError> {
        let name = format!("{}.json", certificate.id);
        let directory = report::RunDirectory::at(&self.0);
        directory.write(&name, |file| {
            serde_json::to_writer_pretty(file, certificate).map_err(Into::into)
        })?;
        Ok(directory.file(&name))
    }
}

/// How long ago a time was, RFC 3339; `None`: it is none. One that is still to come is no age.
fn age(made: &str, now: SystemTime) -> Option<Duration> {
    let made = humantime::parse_rfc3339(made).ok()?;
    Some(now.duration_since(made).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use rig::{Conditions, White};

    use super::*;

    fn certificate(rig: &RigFile, id: &str, made: &str) -> Certificate {
        let conditions = Conditions {
            made: made.to_owned(),
            ..Conditions::default()
        };
        Certificate {
            id: id.to_owned(),
            made: made.to_owned(),
            rig: rig.fingerprint.clone(),
            white: Some(White {
                conditions,
                ..White::nominal(rig)
            }),
            ..Certificate::default()
        }
    }

    #[test]
    fn a_run_gets_the_newest_certificate_of_its_rig_and_no_old_one() {
        let directory = tempfile::tempdir().unwrap();
        let certificates = Certificates::at(directory.path().join("calibrations"));
        let rig = RigFile::default();
        let now = humantime::parse_rfc3339("2026-03-01T00:00:00Z").unwrap();
        let refused = |rig: &RigFile| certificates.valid(rig, now).unwrap_err().to_string();
        assert!(
            refused(&rig).contains("there is none for this rig file"),
            "{}",
            refused(&rig)
        );

        fs::create_dir(certificates.path()).unwrap();
        certificates
            .keep(&certificate(&rig, "01A", "2026-01-01T00:00:00Z"))
            .unwrap();
        assert!(
            refused(&rig).contains("max_age_h allows 720.0 h"),
            "{}",
            refused(&rig)
        );
        certificates
            .keep(&certificate(&rig, "01B", "2026-02-20T00:00:00Z"))
            .unwrap();
        assert_eq!(certificates.valid(&rig, now).unwrap().id, "01B");

        let changed = RigFile::parse("[light]\nzero_deg = 181", "rig.toml".as_ref()).unwrap();
        assert!(
            refused(&changed).contains("there is none"),
            "{}",
            refused(&changed)
        );
        fs::write(certificates.path().join("02.json"), "{").unwrap();
        assert!(certificates.newest(&rig).is_err());
    }
}
