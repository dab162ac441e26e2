//! What may be wrong with a rig, found without a motion: port, adapter, who answers, how the devices are set up, how
//! fast they answer, dark level and lamp, disk.
//!
//! Each check is a function that tells its [`Finding`]s; whoever calls them chooses the order and stops where going
//! on makes no sense.

mod census;
mod devices;
mod disk;
mod finding;
mod host;
mod light;
mod round_trip;

pub use census::census;
pub use devices::{device, pose};
pub use disk::{disk, room};
pub use finding::{Bin, Finding, Verdict};
pub use host::Host;
pub use light::light;
pub use round_trip::round_trip;
