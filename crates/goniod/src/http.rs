//! The HTTP interface: API, page, metrics. It carries out nothing itself; every request becomes a call of the
//! [`Daemon`](crate::Daemon) handle.

mod accept;
mod access;
mod address;
mod body;
mod connections;
mod credential;
mod download;
mod events;
mod exports;
mod job_file;
mod jobs;
mod keys;
mod listener;
mod metrics;
mod openapi;
mod page;
mod peer;
mod peer_groups;
mod problem;
mod refusals;
mod rig;
mod router;
mod runs;
mod serve;
mod session;
mod shared;
mod site;
mod socket_file;
mod tokens;
mod watched;

pub use access::Access;
pub use address::Address;
pub use listener::{ListenError, Listener};
pub use openapi::openapi;
pub use serve::{Limits, serve};
pub use socket_file::UnixSocket;
pub use tokens::{Role, TokenError, Tokens};
