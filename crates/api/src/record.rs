use serde::{Deserialize, Serialize};

/// What is said of a run for the record, beside the name of its specimen. It is description: it may be edited afterwards,
/// which what was measured never is.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(default)]
pub struct RecordView {
    /// The specimen's number in whatever list it stands.
    pub specimen_id: String,
    /// What the specimen is made of.
    pub material: String,
    /// Words under which the run is to be found again.
    pub tags: Vec<String>,
    /// Anything else.
    pub notes: String,
    /// Who measured: as the job says, else who submitted it.
    pub operator: String,
    /// What it was measured for.
    pub project: String,
    /// When it was edited last, RFC 3339, UTC; `None` where it is as the job said.
    pub edited: Option<String>,
    /// Who edited it last.
    pub edited_by: Option<String>,
}

/// A change to the record of a run: what is named takes the place of what was there.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields, default)]
pub struct RecordEdit {
    /// The specimen's name, at most 200 characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specimen: Option<String>,
    /// The specimen's number, likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub specimen_id: Option<String>,
    /// What the specimen is made of, likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Words under which the run is to be found again: at most 20, of 1 … 50 characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tags: Option<Vec<String>>,
    /// Anything else, at most 10,000 characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub notes: Option<String>,
    /// Who measured, at most 200 characters.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<String>,
    /// What it was measured for, likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub project: Option<String>,
}
