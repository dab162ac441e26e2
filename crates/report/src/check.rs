use serde::Serialize;

/// What a consistency check says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// As it should be.
    Good,
    /// Worth a look before the result is used.
    Look,
    /// The readings do not allow the check.
    Unknown,
}

/// One consistency check, in words and as numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// What is checked, a short noun phrase.
    pub name: &'static str,
    /// What it says.
    pub verdict: Verdict,
    /// The finding in one or two sentences.
    pub text: String,
    /// The figures behind it.
    pub values: serde_json::Value,
}
