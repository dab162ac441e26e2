//! The other end of the wire: simulated servos, photometer, lamp and optics.
//!
//! One physics stands behind two doors: the device side of Dynamixel Protocol 2.0 on a pseudo-terminal, for any
//! client, and `in_process`, the same bench as a `rig::Rig` over tokio time. Neither door is simulated in
//! terms of the other.

mod device;

pub use device::{Device, Refusal};
