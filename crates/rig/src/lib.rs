//! The two arms and the photometer: traits, the rig file, the Dynamixel bus and the calibration.
//!
//! [`Rig`] joins two [`Actuator`]s and a [`Detector`]. What must never differ between implementations (limits,
//! settling, approach, retries, timeouts) is written once above the traits. Nothing here knows of plans or journals.

mod actuator;
mod axis;
mod calibration;
pub mod conform;
mod detector;
pub mod doctor;
mod drive;
pub mod drivers;
pub mod dynamixel;
mod error;
mod fault;
mod file;
mod rig;
mod surroundings;
mod wall_clock;

pub use actuator::{Actuator, Identity, Location};
pub use axis::{Axis, ServoUnits};
pub use calibration::{
    Budget, Calibration, Certificate, Certified, Colour, Conditions, Dark, DarkCounts, DarkFault, Darks,
    Drift, Filling, Lamp, MIN_COSINE, Patch, Reduction, Reflectance, Taken, Trap, Unusable, White, Zero,
    ZeroUncertainty, check_dark_set,
};
pub use detector::{Counts, Detector, DetectorStatus, Exposure, Gain, Phase};
pub use drive::{Drive, DriveError, Hindrance, Rest};
pub use dynamixel::{Adapter, Dynamixel, Usb, ports};
pub use error::{Place, RigError};
pub use fault::{Device, Fault, FaultKind};
pub use file::{
    Abilities, About, Approach, ArmSettings, Band, BusSettings, Certificates, DetectorKind, DetectorSettings,
    Estop, LampControl, MotionSettings, PhotometerSettings, Port, RigFile, Suspend, Uncertainties, Visits,
};
pub use rig::{Observation, Rig, Snapshot};
pub use surroundings::Surroundings;
pub use wall_clock::WallClock;
