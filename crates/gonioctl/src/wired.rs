use std::path::{Path, PathBuf};

use firmware_sim::Server;
use goniod::DaemonError;
use rig::{Port, RigFile};

/// A rig file and the port to open for it, behind which the built-in simulator may be.
pub(crate) struct Wired {
    pub(crate) file: RigFile,
    /// What messages call the rig file.
    pub(crate) name: PathBuf,
    pub(crate) port: PathBuf,
    /// Serves the other end of the wire as long as this lives.
    _simulator: Option<Server>,
}

impl Wired {
    /// Reads a rig file, and starts the simulator where it asks for that; opens nothing.
    ///
    /// # Errors
    /// The rig file is wrong.
    pub(crate) fn new(rig: Option<&Path>) -> Result<Self, DaemonError> {
        let (text, name) = goniod::rig_text(rig)?;
        let file = RigFile::parse(&text, &name)?;
        let (port, simulator) = match &file.bus.port {
            Port::Path(path) => (path.clone(), None),
            Port::Sim => {
                let server = Server::start(&file).map_err(|source| DaemonError::Sim {
                    file: name.display().to_string(),
                    source,
                })?;
                (server.path().to_owned(), Some(server))
            }
        };
        Ok(Self {
            file,
            name,
            port,
            _simulator: simulator,
        })
    }
}
