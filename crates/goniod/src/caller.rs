/// A job to be queued.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Submission {
    /// Text of the job file, TOML.
    pub job: String,
    /// What messages call it.
    pub name: String,
    /// Whether the run directory gets all files, also the large ones that can be made when somebody asks for them.
    pub whole: bool,
}

/// Who asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caller {
    /// Name for the audit: a token's name, a user, an address.
    pub name: String,
}
