use std::path::PathBuf;

use arms::Pose;
use firmware_sim::Server;
use rig::dynamixel::Dynamixel;
use rig::{Drive, Port, RigFile};

use crate::DaemonError;

/// An opened rig, real or simulated.
pub(crate) struct Station {
    pub(crate) drive: Drive<Dynamixel>,
    /// Serves the other end of the wire as long as the rig is used; dropped after it.
    _simulator: Option<Server>,
}

impl Station {
    /// Opens and locks the port of a rig file, or starts the built-in simulator and opens that like any
    /// port. Sends nothing.
    ///
    /// # Errors
    /// A `[sim]` table or a specimen that is not allowed; a port that is missing, in use or not permitted.
    pub(crate) fn open(file: &RigFile, name: &str) -> Result<Self, DaemonError> {
        let (port, simulator) = match &file.bus.port {
            Port::Path(path) => (path.clone(), None),
            Port::Sim => simulate(file).map_err(|source| DaemonError::Sim {
                file: name.to_owned(),
                source,
            })?,
        };
        let rig = Dynamixel::open(&port, file).map_err(|source| DaemonError::Port {
            file: name.to_owned(),
            source: Box::new(source),
        })?;
        Ok(Self {
            drive: Drive::new(rig, file.clone()),
            _simulator: simulator,
        })
    }

    /// Asks every device who it is and where it stands; moves nothing.
    ///
    /// # Errors
    /// A device that is absent, silent, or not what the rig file says.
    pub(crate) async fn start(&mut self) -> Result<Pose, DaemonError> {
        let not_ready = |error| DaemonError::NotReady(Box::new(error));
        self.drive.identify_all().await.map_err(not_ready)?;
        let snapshot = self.drive.snapshot().await.map_err(not_ready)?;
        Ok(snapshot.pose())
    }
}

fn simulate(file: &RigFile) -> Result<(PathBuf, Option<Server>), firmware_sim::SimError> {
    let server = Server::start(file)?;
    Ok((server.path().to_owned(), Some(server)))
}
