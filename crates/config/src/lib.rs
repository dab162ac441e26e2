//! What every text file of ours is read with: its encoding, its keys, and what is said of those that are wrong.
//!
//! [`read_text`] says in which encoding a file seems to be that is not UTF-8. [`parse`] reads TOML into a type, and
//! finds every key that the type does not know rather than the first, with the known key that is most like it. What
//! values are allowed is the business of the crate whose file it is.

mod error;
mod keys;
mod text;

pub use error::{Flaw, Flaws, TextError};
pub use keys::{of_table, parse};
pub use text::{decode, read_text};
