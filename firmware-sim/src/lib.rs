//! The other end of the wire: simulated servos, photometer, lamp and optics.
//!
//! One physics stands behind two doors: the device side of Dynamixel Protocol 2.0 on a pseudo-terminal, for any
//! client, and `in_process`, the same bench as a `rig::Rig` over tokio time. Neither door is simulated in
//! terms of the other.

mod amount;
mod baud;
mod bench;
mod device;
mod error;
mod fault;
mod imperfections;
pub mod in_process;
mod instrument;
mod lamp;
mod mechanics;
mod mishaps;
mod node;
mod optics;
mod orders;
mod photodiodes;
mod photometer;
mod program;
mod room;
mod servo;
mod settings;
mod table;
mod wire;

pub use amount::UpTo;
pub use bench::Bench;
pub use device::{Device, Refusal};
pub use error::SimError;
pub use fault::{Disturbance, Fault, RoomLight};
pub use imperfections::Imperfections;
pub use instrument::{Instrument, InstrumentFaults};
pub use mechanics::{Creep, EncoderError, Hunting, Mechanics, MechanicsKeys, Ring};
pub use mishaps::Mishap;
pub use orders::Order;
pub use program::main;
pub use settings::{Clock, Settings};
pub use wire::{Counters, Line, Outgoing, Server, WireFaults, WireSettings, Written};
