use std::path::{Path, PathBuf};

use firmware_sim::{Instrument, Server};
use rig::{Port, RigFile};

use crate::SessionError;

/// The port on which a rig is reached; the built-in simulator serves the other end where the rig file asks for it.
pub struct RigPort {
    path: PathBuf,
    /// The simulated instrument, and the rig file with its address.
    instrument: Option<(Instrument, RigFile)>,
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
        // Where the built-in simulator is asked for and the detector is an instrument, that is simulated as well, at a port of
        // its own on this computer.
        let instrument = match &simulator {
            Some(server) if !file.detector.on_bus() && file.detector.address == RigFile::SIMULATED => {
                let served = server
                    .instrument(file, "127.0.0.1:0")
                    .map_err(|source| SessionError::Sim {
                        file: name.to_owned(),
                        source,
                    })?;
                let mut named = file.clone();
                named.detector.address = format!("tcp:{}", served.address());
                Some((served, named))
            }
            _ => None,
        };
        Ok(Self {
            path,
            instrument,
            _simulator: simulator,
        })
    }

    /// The rig file with which the rig is to be opened: that of [`RigPort::new`], which must be `file`, with the address of the
    /// simulated instrument where there is one.
    pub fn file<'a>(&'a self, file: &'a RigFile) -> &'a RigFile {
        self.instrument.as_ref().map_or(file, |(_, named)| named)
    }

    /// The simulated instrument, where there is one.
    pub fn instrument(&self) -> Option<&Instrument> {
        self.instrument.as_ref().map(|(instrument, _)| instrument)
    }

    /// The device file to open.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
