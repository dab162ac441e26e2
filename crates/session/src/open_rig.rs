use arms::Pose;
use rig::dynamixel::Dynamixel;
use rig::{Drive, Fault, Rig, RigFile};

use crate::{RigPort, SessionError};

/// Where a rig is had from.
pub trait RigSource: Send + 'static {
    /// The rig.
    type Rig: Rig + 'static;

    /// Opens the rig of a rig file, which messages call `name`. Moves nothing.
    ///
    /// # Errors
    /// What keeps it from being used.
    fn open(&self, file: &RigFile, name: &str) -> Result<OpenRig<Self::Rig>, SessionError>;
}

/// The rig at the port that the rig file names, or the built-in simulator behind a port of its own.
#[derive(Clone, Copy, Debug)]
pub struct PortOfFile;

impl RigSource for PortOfFile {
    type Rig = Dynamixel;

    fn open(&self, file: &RigFile, name: &str) -> Result<OpenRig, SessionError> {
        OpenRig::open(file, name)
    }
}

/// An opened rig, real or simulated.
pub struct OpenRig<R: Rig = Dynamixel> {
    /// The rig behind its drive.
    pub drive: Drive<R>,
    /// Dropped after the drive, which uses it.
    _port: Option<RigPort>,
}

impl OpenRig {
    /// Opens and locks the port of a rig file, or starts the built-in simulator and opens that like any
    /// port. Sends nothing.
    ///
    /// # Errors
    /// A `[sim]` table or a specimen that is not allowed; a port that is missing, in use or not permitted.
    pub fn open(file: &RigFile, name: &str) -> Result<Self, SessionError> {
        let port = RigPort::new(file, name)?;
        let rig = Dynamixel::open(port.path(), port.file(file)).map_err(|source| SessionError::Port {
            file: name.to_owned(),
            source: Box::new(source),
        })?;
        Ok(Self {
            drive: Drive::new(rig, file.clone()),
            _port: Some(port),
        })
    }
}

impl<R: Rig> OpenRig<R> {
    /// A rig that needs no port of ours.
    pub fn without_port(drive: Drive<R>) -> Self {
        Self { drive, _port: None }
    }

    /// Asks every device who it is and where it stands; moves nothing.
    ///
    /// # Errors
    /// A device that is absent, silent, or not what the rig file says.
    pub async fn start(&mut self) -> Result<Pose, SessionError> {
        self.drive.identify_all().await.map_err(SessionError::not_ready)?;
        let snapshot = self.drive.snapshot().await.map_err(SessionError::not_ready)?;
        Ok(snapshot.pose())
    }
}

impl SessionError {
    /// What keeps a rig from being used, found before anything moved.
    pub fn not_ready<E: Fault>(error: rig::DriveError<E>) -> Self {
        Self::NotReady {
            kind: error.kind(),
            source: Box::new(error),
        }
    }
}
