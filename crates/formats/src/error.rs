use std::fmt;
use std::path::PathBuf;

use crate::Fidelity;

/// Why a file could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The medium refused.
    #[error("cannot {what} {path}")]
    Io {
        /// What was attempted, as a verb.
        what: &'static str,
        /// On which file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The content of a file is not what its format prescribes.
    #[error("cannot read {path} as {format}")]
    File {
        /// Which file.
        path: PathBuf,
        /// Name of the format.
        format: &'static str,
        /// What is wrong in it, and where.
        source: Box<Error>,
    },
    /// A place in a file does not hold what its format prescribes.
    #[error("{place}: {found}; allowed is {allowed}")]
    Malformed {
        /// Where in the file.
        place: Place,
        /// What stands there.
        found: String,
        /// What may stand there.
        allowed: String,
    },
    /// No format recognises a file.
    #[error("{path} is in no format that goniod reads; it reads {}", .readable.join(", "))]
    Unrecognised {
        /// Which file.
        path: PathBuf,
        /// Names of the formats that can be read.
        readable: Vec<&'static str>,
    },
    /// No format has that name.
    #[error("there is no format \"{name}\"; there are {}", .known.join(", "))]
    UnknownFormat {
        /// What was asked for.
        name: String,
        /// Names of all formats.
        known: Vec<&'static str>,
    },
    /// What was written does not come back as it should.
    #[error(
        "{format} does not hold this specimen well enough: {figure} is {found:.5}, allowed is at most {allowed}; {fidelity}"
    )]
    Refused {
        /// Name of the format.
        format: &'static str,
        /// Which figure is too large.
        figure: &'static str,
        /// Its value.
        found: f64,
        /// The largest value allowed.
        allowed: f64,
        /// All figures.
        fidelity: Box<Fidelity>,
    },
    /// The BRDF gives a value that no format can hold.
    #[error(
        "the reflectance at θ_i {theta_i_deg:.3}°, θ_r {theta_r_deg:.3}° is {value}; allowed are finite numbers from 0"
    )]
    Value {
        /// Zenith angle of the light, degrees.
        theta_i_deg: f64,
        /// Zenith angle of the viewer, degrees.
        theta_r_deg: f64,
        /// What the BRDF gives there, sr⁻¹.
        value: f64,
    },
    /// A MERL table could not be read or written.
    #[error(transparent)]
    Merl(brdf::Error),
    /// A library that encodes or decodes a format refused.
    #[error("the {library} library refuses")]
    Library {
        /// Which library.
        library: &'static str,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl Error {
    /// Something in a file that is not as its format prescribes.
    pub(crate) fn malformed(place: Place, found: impl Into<String>, allowed: impl Into<String>) -> Self {
        Self::Malformed {
            place,
            found: found.into(),
            allowed: allowed.into(),
        }
    }
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Place {
    /// A byte, counted from 0.
    Byte(u64),
    /// A line of text, counted from 1.
    Line(u64),
    /// A part of the file by its name.
    Field(String),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(at) => write!(f, "byte {at}"),
            Self::Line(at) => write!(f, "line {at}"),
            Self::Field(name) => write!(f, "field \"{name}\""),
        }
    }
}
