//! The wire: the device side of Dynamixel Protocol 2.0, from bytes to devices and back.
//!
//! Pure up to [`mod@line`]: bytes and times are arguments. [`server`] gives it a pseudo-terminal and a thread.

mod answer;
mod counters;
mod crc;
mod dispatch;
mod fast;
mod faults;
mod instruction;
mod line;
mod link;
#[cfg(test)]
mod memory;
mod packet;
mod parser;
mod server;
mod settings;
mod stuffing;
mod terminal;
mod written;

pub use counters::Counters;
pub use faults::WireFaults;
pub use line::{Line, Outgoing};
pub use server::Server;
pub(crate) use server::Shared;
pub use settings::WireSettings;
pub use written::Written;
