/// A job to be queued.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Submission {
    /// Text of the job file, TOML.
    pub job: String,
    /// What messages call it.
    pub name: String,
}

/// Who asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caller {
    /// Name for the audit: a token's name, a user, an address.
    pub name: String,
}
