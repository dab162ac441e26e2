//! The capture daemon as a library: an order (job and rig file) goes in, a captured and reported run comes out.
//!
//! It opens the rig, real or simulated, plans from where the arms stand, captures into a run directory of its own and
//! has everything else derived from the journal. Front ends send commands and watch events; none of them drives.

mod error;
mod order;
mod run;
mod station;
mod status;

pub use error::DaemonError;
pub use order::Order;
pub use run::{Ended, resume, run};
pub use status::Status;
