//! The Dynamixel implementation: register tables, the bus and its worker, the devices on it.

pub mod register;

pub use register::{BAUD_RATES, MODELS, PHOTOMETER_MODEL};
