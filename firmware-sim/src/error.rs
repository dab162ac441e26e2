/// Why the simulated bench cannot be built from a rig file, or put on a pseudo-terminal.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// The `[sim]` table has an unknown key, or a value of the wrong type.
    #[error("[sim]: {why}")]
    Form {
        /// What was found and expected.
        why: String,
    },
    /// A value of the `[sim]` table is not allowed.
    #[error("sim.{key} is {found}, allowed: {allowed}")]
    Value {
        /// The key.
        key: &'static str,
        /// What was found.
        found: String,
        /// What may stand there.
        allowed: String,
    },
    /// The arms may not stand where they are said to start.
    #[error("sim.start_light_deg, sim.start_sensor_deg: not a pose that the arms may take")]
    Start {
        /// What it would break.
        source: arms::Violation,
    },
    /// The specimen is not known, or its file is no good.
    #[error("sim.specimen: \"{name}\" cannot be put on the stage")]
    Specimen {
        /// As it was named.
        name: String,
        /// Why not.
        source: brdf::Error,
    },
    /// The rig file asks for a device that is not simulated.
    #[error("{what} {found} is not simulated, allowed: {allowed}")]
    Device {
        /// What about it.
        what: &'static str,
        /// What was asked for.
        found: String,
        /// What there is.
        allowed: String,
    },
    /// No pseudo-terminal to be had, or no thread to serve it.
    #[error("cannot {attempt} for the simulated bus")]
    Terminal {
        /// What was attempted.
        attempt: &'static str,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The simulated instrument cannot be served.
    #[error("cannot serve the simulated instrument at {address}")]
    Instrument {
        /// Where it was to listen.
        address: String,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The stable link to the pseudo-terminal cannot be made.
    #[error("cannot make the link {}", .path.display())]
    Link {
        /// The link.
        path: std::path::PathBuf,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The file cannot be written to which what the host writes is appended.
    #[error("cannot append what the host writes to {}", .path.display())]
    Trace {
        /// The file.
        path: std::path::PathBuf,
        /// Why it failed.
        source: std::io::Error,
    },
}
