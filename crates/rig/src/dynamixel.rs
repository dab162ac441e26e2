//! The Dynamixel implementation: register tables, the bus and its worker, the devices on it.
//!
//! Built on `dynamixel2` with defences; docs/adr/0001-dynamixel2-with-defences.md says which and why.

mod block;
mod braking;
mod buffer;
mod bus;
mod census;
mod line;
mod model;
mod node;
mod photometer;
mod port;
pub mod register;
mod rig;
mod servo;

pub use braking::Braking;
pub use census::{Census, Heard};
pub use model::{Indirect, MODELS, Model, Series};
pub use photometer::Photometer;
pub(crate) use port::open as open_port;
pub use port::{Adapter, Usb, ports};
pub use register::{BAUD_RATES, PHOTOMETER_MODEL};
pub use rig::Dynamixel;
pub use servo::Servo;
