use std::path::{Path, PathBuf};

use firmware_sim::Server;
use rig::{Port, RigFile};

use crate::SessionError;

/// The port on which a rig is reached; the built-in simulator serves the other end where the rig file asks for it.
pub struct RigPort {
    path: PathBuf,
    /// Serves the other end of the wire as long as this lives.
    _simulator: Option<Server>,
}

impl RigPort {
    /// Finds the port of a rig file, which messages call `name`, and starts the simulator where the file asks for it.
    /// Opens nothing and sends nothing.
    ///
    /// # Errors
    /// A `[sim]` table or a specimen that is not allowed.
    pub fn new(file: &RigFile, name: &str) -> Result<Self, SessionError> {
        let (path, simulator) = match &file.bus.port {
            Port::Path(path) => (path.clone(), None),
            Port::Sim => {
                let server = Server::start(file).map_err(|source| SessionError::Sim {
                    file: name.to_owned(),
                    source,
                })?;
                (server.path().to_owned(), Some(server))
            }
        };
        Ok(Self {
            path,
            _simulator: simulator,
        })
    }

    /// The device file to open.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
