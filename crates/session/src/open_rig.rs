use arms::Pose;
use rig::dynamixel::Dynamixel;
use rig::{Drive, RigFile};

use crate::{RigPort, SessionError};

/// An opened rig, real or simulated.
pub struct OpenRig {
    /// The rig behind its drive.
    pub drive: Drive<Dynamixel>,
    /// Dropped after the drive, which uses it.
    _port: RigPort,
}

impl OpenRig {
    /// Opens and locks the port of a rig file, or starts the built-in simulator and opens that like any
    /// port. Sends nothing.
    ///
    /// # Errors
    /// A `[sim]` table or a specimen that is not allowed; a port that is missing, in use or not permitted.
    pub fn open(file: &RigFile, name: &str) -> Result<Self, SessionError> {
        let port = RigPort::new(file, name)?;
        let rig = Dynamixel::open(port.path(), file).map_err(|source| SessionError::Port {
            file: name.to_owned(),
            source: Box::new(source),
        })?;
        Ok(Self {
            drive: Drive::new(rig, file.clone()),
            _port: port,
        })
    }

    /// Asks every device who it is and where it stands; moves nothing.
    ///
    /// # Errors
    /// A device that is absent, silent, or not what the rig file says.
    pub async fn start(&mut self) -> Result<Pose, SessionError> {
        let not_ready = |error| SessionError::NotReady(Box::new(error));
        self.drive.identify_all().await.map_err(not_ready)?;
        let snapshot = self.drive.snapshot().await.map_err(not_ready)?;
        Ok(snapshot.pose())
    }
}
