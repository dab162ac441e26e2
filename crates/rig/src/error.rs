use std::path::PathBuf;

use crate::{Device, Fault, FaultKind};

/// A place in a file, for error texts: "rig.toml, line 12".
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file, as it was named.
    pub file: PathBuf,
    /// Line, from 1, where one is to blame.
    pub line: Option<usize>,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.file.display())?;
        self.line.map_or(Ok(()), |line| write!(f, ", line {line}"))
    }
}

/// What goes wrong with a rig file, its port or its devices.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RigError {
    /// The rig file cannot be read.
    #[error("cannot read the rig file {}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The rig file is no TOML, or has an unknown key, or a value of the wrong type.
    #[error("{place}: {}{why}", .key.as_ref().map(|key| format!("{key}: ")).unwrap_or_default())]
    Form {
        /// Where.
        place: Place,
        /// The key, where one is to blame.
        key: Option<String>,
        /// What was found and expected.
        why: String,
    },
    /// A value of the rig file is not allowed.
    #[error("{place}: {key} is {found}, allowed: {allowed}")]
    Value {
        /// Where.
        place: Place,
        /// The key, with its table.
        key: String,
        /// What was found.
        found: String,
        /// What may stand there.
        allowed: String,
    },
}

impl Fault for RigError {
    fn kind(&self) -> FaultKind {
        match self {
            Self::Read { .. } | Self::Form { .. } | Self::Value { .. } => FaultKind::Setup,
        }
    }

    fn device(&self) -> Option<Device> {
        None
    }
}
