use std::path::PathBuf;

/// Why a study could not be read or run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The medium refused.
    #[error("cannot {what} {path}")]
    Io {
        /// What was attempted.
        what: &'static str,
        /// On which file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The rows could not be written.
    #[error("cannot write the rows of the study")]
    Write(#[from] std::io::Error),
    /// The file is not TOML, a key is unknown or missing, or a value has the wrong type.
    #[error("{file}: {message}")]
    Syntax {
        /// Which file.
        file: String,
        /// What the parser says, with line and key.
        message: String,
    },
    /// A value is out of range.
    #[error("{file}: {key} is {value}, allowed is {allowed}")]
    Range {
        /// Which file.
        file: String,
        /// Which key.
        key: &'static str,
        /// What stands there.
        value: String,
        /// What may stand there.
        allowed: &'static str,
    },
    /// A material is not known.
    #[error("{file}: materials")]
    Material {
        /// Which file.
        file: String,
        /// Which material, and what is near it.
        source: brdf::Error,
    },
    /// A material could not be reconstructed.
    #[error("{material} at {theta_r_deg}° cannot be reconstructed")]
    Model {
        /// Which material.
        material: String,
        /// At which angle, degrees.
        theta_r_deg: f64,
        /// Why.
        source: pdv::Error,
    },
}
