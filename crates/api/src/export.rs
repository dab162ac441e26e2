use serde::{Deserialize, Serialize};

/// A format in which the result of a run can be had.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct ExportView {
    /// Its name, which is the last part of the address of the file.
    pub format: String,
    /// The usual extension of its files, without the dot.
    pub extension: String,
    /// What it keeps and what it loses.
    pub about: String,
}
