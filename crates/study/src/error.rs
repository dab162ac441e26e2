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
    /// A file of a material cannot be read.
    #[error("the material of {path} cannot be read")]
    File {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: Box<formats::Error>,
    },
    /// Scattered readings in the plane do not make a specimen for the simulated rig.
    #[error("{material}: the readings in the plane make no specimen")]
    Scattered {
        /// Which material.
        material: String,
        /// Why.
        source: pdv::Error,
    },
    /// A directory is in use for something else.
    #[error("{directory} holds another study; name another directory")]
    OtherStudy {
        /// Which directory.
        directory: PathBuf,
    },
    /// Somebody else is doing the same part of the study.
    #[error("{path} is being written by another program; wait until it has ended, or end it")]
    InUse {
        /// Which rows.
        path: PathBuf,
    },
    /// What a shard is called is none.
    #[error("a shard is K/N with 1 ≤ K ≤ N ≤ {most}, such as 3/16, and not {given:?}")]
    Shard {
        /// What was given.
        given: String,
        /// The most shards.
        most: u32,
    },
    /// Not all of a study has been done.
    #[error(
        "{missing} of {of} tasks of the study are not done in {directory}: run the shards again that have not ended, or the study \
         without --shard, which does the rest"
    )]
    Unfinished {
        /// Tasks that are missing.
        missing: usize,
        /// All tasks.
        of: usize,
        /// Of which directory.
        directory: PathBuf,
    },
    /// A plot could not be drawn.
    #[error("cannot draw \"{title}\": {why}")]
    Plot {
        /// Its title.
        title: String,
        /// What the drawing library says.
        why: String,
    },
    /// The rig file is wrong.
    #[error(transparent)]
    Rig(#[from] Box<rig::RigError>),
    /// The simulated rig of a rig file cannot be.
    #[error("the simulated rig")]
    Sim {
        /// Why.
        source: firmware_sim::SimError,
    },
    /// A job cannot be planned on the rig.
    #[error(transparent)]
    Plan(#[from] sweep::SweepError),
    /// A simulated capture did not reach its end.
    #[error("{job}: the simulated capture failed: {why}")]
    Capture {
        /// Which job.
        job: String,
        /// Why, in words.
        why: String,
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

impl From<rig::RigError> for Error {
    fn from(error: rig::RigError) -> Self {
        Self::Rig(Box::new(error))
    }
}
