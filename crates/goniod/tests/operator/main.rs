//! Nothing moves after a stop but by what was asked for later: the law, judged by what the simulated devices were told.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

mod acknowledgement;
mod law;
mod pairs;
mod script;
mod sequences;
mod silence;
mod world;
