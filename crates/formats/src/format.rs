use std::path::Path;

use brdf::Brdf;

use crate::{Error, Export, FORMATS, Fidelity};

/// A file format for BRDFs.
pub struct Format {
    /// The name by which the command line knows it.
    pub name: &'static str,
    /// The usual extension of its files, without the dot.
    pub extension: &'static str,
    /// What it keeps and what it loses, in one or two sentences.
    pub about: &'static str,
    /// How well a file must give back what was written into it.
    pub tolerance: Tolerance,
    /// Makes the bytes of a file.
    pub write: fn(&Export<'_>) -> Result<Vec<u8>, Error>,
    /// Tells whether bytes look like a file of this format, by what they begin with.
    pub recognises: fn(&[u8]) -> bool,
    /// Makes a BRDF of the bytes of a file.
    pub read: Reader,
}

/// Makes a BRDF of the bytes of a file.
///
/// # Errors
/// The bytes are not as the format prescribes.
pub type Reader = fn(&[u8]) -> Result<Box<dyn Brdf>, Error>;

/// The largest errors with which a file is written; see [`Fidelity`] for what each figure means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// Largest MALE.
    pub male: f64,
    /// Largest median of relative errors.
    pub median: f64,
    /// Largest 95th percentile of relative errors.
    pub p95: f64,
    /// Largest relative error of the directional albedo.
    pub albedo: f64,
    /// Largest relative error in the mirror direction.
    pub peak: f64,
}

impl Tolerance {
    /// Any error: for formats that keep one slice or a few parameters, whose loss is told and not judged.
    pub const ANY: Self = Self {
        male: f64::INFINITY,
        median: f64::INFINITY,
        p95: f64::INFINITY,
        albedo: f64::INFINITY,
        peak: f64::INFINITY,
    };
    /// What a table of samples must hold: 1 % in the median, 5 % in 95 of 100 pairs, 1 % of the albedo, 5 % in the mirror
    /// direction.
    pub const TABLE: Self = Self {
        male: f64::INFINITY,
        median: 0.01,
        p95: 0.05,
        albedo: 0.01,
        peak: 0.05,
    };

    /// Returns the first figure that is too large, with its value and the largest one allowed; `None` where all are within.
    pub fn exceeded(&self, fidelity: &Fidelity) -> Option<(&'static str, f64, f64)> {
        // Not a number is too large as well.
        self.figures(fidelity)
            .into_iter()
            .find(|(_, found, allowed)| found.is_nan() || found > allowed)
    }

    /// The largest figure as a share of what is allowed: at most 1 where all are within.
    pub(crate) fn share(&self, fidelity: &Fidelity) -> f64 {
        let shares = self.figures(fidelity).map(|(_, found, allowed)| found / allowed);
        shares.into_iter().fold(0.0, f64::max)
    }

    /// Every figure with its value and the largest one allowed.
    fn figures(&self, fidelity: &Fidelity) -> [(&'static str, f64, f64); 5] {
        [
            ("MALE", fidelity.male, self.male),
            ("the median relative error", fidelity.median, self.median),
            ("the 95th percentile of relative errors", fidelity.p95, self.p95),
            (
                "the relative error of the albedo",
                fidelity.albedo_error(),
                self.albedo,
            ),
            (
                "the relative error in the mirror direction",
                fidelity.peak_error(),
                self.peak,
            ),
        ]
    }
}

/// A file that was written and read back.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The bytes of the file.
    pub bytes: Vec<u8>,
    /// How well they give back what was written.
    pub fidelity: Fidelity,
}

impl Format {
    /// Finds the format of a name.
    ///
    /// # Errors
    /// There is none; the error lists all names.
    ///
    /// ```
    /// assert_eq!(formats::Format::named("merl").unwrap().extension, "binary");
    /// assert!(formats::Format::named("jpeg").is_err());
    /// ```
    pub fn named(name: &str) -> Result<&'static Self, Error> {
        FORMATS
            .iter()
            .find(|format| format.name == name)
            .ok_or_else(|| Error::UnknownFormat {
                name: name.to_owned(),
                known: FORMATS.iter().map(|format| format.name).collect(),
            })
    }

    /// Writes a BRDF into memory and reads it back with this crate's own reader.
    ///
    /// # Errors
    /// The BRDF gives a value that no file can hold, or what was read back is further from it than [`Format::tolerance`]
    /// allows; the error has the figures.
    ///
    /// ```
    /// use formats::{Export, Format};
    ///
    /// let grey = brdf::Lambert::new(0.5).unwrap();
    /// let file = Format::named("ssdd").unwrap().export(&Export::of(&grey, "grey card")).unwrap();
    /// assert!(file.bytes.starts_with(b"VERSION"));
    /// assert!(file.fidelity.median < 1e-6);
    /// ```
    pub fn export(&self, export: &Export<'_>) -> Result<Exported, Error> {
        check_values(export.brdf)?;
        let bytes = (self.write)(export)?;
        let fidelity = Fidelity::between(export.brdf, (self.read)(&bytes)?.as_ref());
        match self.tolerance.exceeded(&fidelity) {
            None => Ok(Exported { bytes, fidelity }),
            Some((figure, found, allowed)) => Err(Error::Refused {
                format: self.name,
                figure,
                found,
                allowed,
                fidelity: Box::new(fidelity),
            }),
        }
    }
}

/// Refuses a BRDF that gives negative values or ones that are no numbers, at some thousand pairs of directions.
fn check_values(brdf: &dyn Brdf) -> Result<(), Error> {
    for i in 0..18 {
        for r in 0..18 {
            for phi in 0..13 {
                let [theta_i_deg, theta_r_deg] = [i, r].map(|n| 5.0 * f64::from(n));
                let at = |theta_deg: f64, phi_deg: f64| brdf::Spherical {
                    theta: theta_deg.to_radians(),
                    phi: phi_deg.to_radians(),
                };
                let incident = at(theta_i_deg, 15.0 * f64::from(phi)).direction();
                let exitant = at(theta_r_deg, 0.0).direction();
                if !brdf.valid(incident, exitant) {
                    continue;
                }
                let bad = |value: &f64| !value.is_finite() || *value < 0.0;
                if let Some(value) = brdf.eval(incident, exitant).to_array().into_iter().find(bad) {
                    return Err(Error::Value {
                        theta_i_deg,
                        theta_r_deg,
                        value,
                    });
                }
            }
        }
    }
    Ok(())
}

/// Reads a BRDF from a file of any format, which is recognised by its content.
///
/// # Errors
/// The file cannot be read, no format recognises it, or it is not as its format prescribes.
pub fn read(path: &Path) -> Result<(&'static Format, Box<dyn Brdf>), Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io {
        what: "read",
        path: path.to_owned(),
        source,
    })?;
    let format = recognise(&bytes).ok_or_else(|| Error::Unrecognised {
        path: path.to_owned(),
        readable: FORMATS.iter().map(|format| format.name).collect(),
    })?;
    match (format.read)(&bytes) {
        Ok(brdf) => Ok((format, brdf)),
        Err(error) => Err(Error::File {
            path: path.to_owned(),
            format: format.name,
            source: Box::new(error),
        }),
    }
}

/// Finds the format of which bytes look like a file; `None` where there is none.
pub fn recognise(bytes: &[u8]) -> Option<&'static Format> {
    FORMATS.iter().find(|format| (format.recognises)(bytes))
}
