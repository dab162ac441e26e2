//! The HTTP interface: API, page, metrics. It carries out nothing itself; every request becomes a call of the
//! [`Daemon`](crate::Daemon) handle.

mod accept;
mod access;
mod body;
mod connections;
mod events;
mod job_file;
mod jobs;
mod listener;
mod metrics;
mod openapi;
mod page;
mod problem;
mod rig;
mod router;
mod runs;
mod serve;
mod session;
mod shared;
mod site;
mod tokens;
mod watched;

pub use access::Access;
pub use listener::{Address, Listener};
pub use openapi::openapi;
pub use serve::{Limits, serve};
pub use tokens::{Role, TokenError, Tokens};
