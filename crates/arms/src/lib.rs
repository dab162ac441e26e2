//! Arm angles, poses, motion profiles and the envelope that keeps the arms apart.
//!
//! Specimen frame: z is the specimen's normal, the arms move in the x–z plane. An arm angle is signed from the
//! normal, positive towards +x, so its direction is (sin α, 0, cos α). Everything here is pure arithmetic; nothing
//! knows of servos, time or files.

mod angle;
mod envelope;
mod pose;
mod profile;

pub use angle::ArmAngle;
pub use envelope::{Envelope, Limits, Violation};
pub use pose::{Arm, Pose};
pub use profile::{Profile, Trajectory};
