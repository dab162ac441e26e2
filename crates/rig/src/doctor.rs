//! What may be wrong with a rig, found without a motion: port, adapter, who answers, how the devices are set up, how
//! fast they answer, whether they can be read as a run reads them, what would hold a run, dark level and lamp, disk.
//!
//! Each check is a function that tells its [`Finding`]s; whoever calls them chooses the order and stops where going
//! on makes no sense.

mod census;
mod clock;
mod devices;
mod disk;
mod finding;
mod host;
mod light;
mod round_trip;
mod suspend;

pub use census::census;
pub use clock::clock;
pub use devices::{answers, device, pose, together};
pub use disk::{disk, room};
pub use finding::{Bin, Finding, Verdict};
pub use host::Host;
pub use light::light;
pub use round_trip::round_trip;
pub use suspend::suspend;
