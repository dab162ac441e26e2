//! What a program says to people: lines on a terminal, and a log.
//!
//! Specimen names, paths, what devices and servers answer: much of what is printed was written by others. A terminal
//! obeys control characters in it, and shows text in another order or not at all where it holds certain invisible ones.
//! So everything passes through [`Printable`] before it reaches a terminal or the log.
//!
//! ```
//! use terminal::Printable;
//!
//! assert_eq!(Printable("gold \u{1b}[2J").to_string(), r"gold \u{1b}[2J");
//! assert_eq!(Printable("θ_r 45° grün 金").to_string(), "θ_r 45° grün 金");
//! ```
//!
//! This crate does not decide what is said, and does not touch files that a program writes.

mod arguments;
mod log;
mod print;
mod printable;

pub use arguments::arguments;
pub use log::{LogFormat, log, subscriber};
pub use print::{json, json_line, line, say};
pub use printable::{Printable, printable, printable_json};
pub use tracing_subscriber::filter::LevelFilter;
