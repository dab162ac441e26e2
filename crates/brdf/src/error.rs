use std::path::PathBuf;

/// Why a BRDF could not be had, or its file not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The medium refused.
    #[error("cannot {what} {path}")]
    Io {
        /// What was attempted.
        what: &'static str,
        /// On which file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The stream refused or ended.
    #[error("cannot {what} a MERL table")]
    Stream {
        /// What was attempted.
        what: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// A file has not the length of a MERL table.
    #[error("{path} has {bytes} bytes, a MERL file has {allowed}")]
    Length {
        /// Which file.
        path: PathBuf,
        /// Its length.
        bytes: u64,
        /// The only length allowed.
        allowed: u64,
    },
    /// The content of a file is no MERL table.
    #[error("{path} is no MERL table")]
    File {
        /// Which file.
        path: PathBuf,
        /// What is wrong in it.
        source: Box<Error>,
    },
    /// The first twelve bytes are not 90 × 90 × 180.
    #[error("bytes 0 … 11: dimensions {} × {} × {}, allowed is 90 × 90 × 180 (θ_h, θ_d, φ_d)", .found[0], .found[1], .found[2])]
    Header {
        /// The dimensions found, as int32 little-endian.
        found: [i32; 3],
    },
    /// The stream ends before the table does.
    #[error("the table ends after {bytes} bytes, {allowed} are needed")]
    Truncated {
        /// Where it ends.
        bytes: u64,
        /// Where it should end.
        allowed: u64,
    },
    /// The stream goes on behind the table.
    #[error("there are bytes behind the table's {allowed}")]
    Trailing {
        /// Where it should end.
        allowed: u64,
    },
    /// An entry is NaN or infinite.
    #[error("byte {byte}: {channel} at θ_h index {}, θ_d {}°, φ_d {}° is {value}, allowed are finite numbers (negative: invalid)", .index[0], .index[1], .index[2])]
    NotFinite {
        /// Offset of the entry in the stream.
        byte: u64,
        /// "red", "green" or "blue".
        channel: &'static str,
        /// Indices of θ_h, θ_d and φ_d.
        index: [usize; 3],
        /// What stands there.
        value: f64,
    },
    /// No material has that name.
    #[error("unknown specimen \"{name}\"{}; allowed are a fitted MERL material (the empty name \"\" lists all 100), \"black\", \"lambert:ALBEDO\", \"mirror:REFLECTANCE\" and the path of a .binary file", suggestion(.near))]
    UnknownSpecimen {
        /// What was asked for.
        name: String,
        /// Names that resemble it, the nearest first.
        near: Vec<&'static str>,
    },
    /// No specimen was named.
    #[error("no specimen is named; allowed are \"black\", \"lambert:ALBEDO\", \"mirror:REFLECTANCE\", the path of a .binary file and {}", .names.join(", "))]
    NoSpecimen {
        /// Every material.
        names: Vec<&'static str>,
    },
    /// The number behind the colon cannot be read.
    #[error("specimen \"{text}\": \"{number}\" is no number, allowed is 0 … 1")]
    Number {
        /// The specimen as given.
        text: String,
        /// The part that should be a number.
        number: String,
    },
    /// A parameter is out of range.
    #[error("{what} is {value}, allowed is {allowed}")]
    Parameter {
        /// Of what.
        what: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
}

fn suggestion(names: &[&'static str]) -> String {
    if names.is_empty() {
        String::new()
    } else {
        format!(", did you mean {}?", names.join(" or "))
    }
}
