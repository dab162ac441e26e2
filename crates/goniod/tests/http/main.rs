//! The HTTP interface through a real listener, over the simulated rig.

mod access;
mod documents;
mod limits;
mod service;
mod unix;
mod work;
