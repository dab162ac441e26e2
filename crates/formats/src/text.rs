//! What the readers of text formats share.

use glam::DVec3;

use crate::{Error, Place};

/// Largest reflectance that a file may hold, sr⁻¹: more than any instrument can resolve.
pub(crate) const LARGEST: f64 = 1e12;

/// Bytes as text.
///
/// # Errors
/// They are not UTF-8.
pub(crate) fn text(bytes: &[u8]) -> Result<&str, Error> {
    std::str::from_utf8(bytes).map_err(|error| {
        let at = Place::Byte(error.valid_up_to() as u64);
        Error::malformed(at, "a byte that is no UTF-8", "text in UTF-8")
    })
}

/// The lines of a text with their numbers from 1, without the blanks around them.
pub(crate) fn lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    (1..).zip(text.lines().map(str::trim))
}

/// A finite number.
///
/// # Errors
/// The word is none.
pub(crate) fn number(word: &str, line: u64) -> Result<f64, Error> {
    match word.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(Error::malformed(
            Place::Line(line),
            format!("\"{}\"", shortened(word)),
            "a finite number",
        )),
    }
}

/// The words of a line as numbers, at least one.
///
/// # Errors
/// A word is none, or there is no word.
pub(crate) fn numbers<'a>(words: impl Iterator<Item = &'a str>, line: u64) -> Result<Vec<f64>, Error> {
    let numbers: Vec<f64> = words.map(|word| number(word, line)).collect::<Result<_, _>>()?;
    match numbers.is_empty() {
        true => Err(Error::malformed(
            Place::Line(line),
            "no number",
            "at least one number",
        )),
        false => Ok(numbers),
    }
}

/// An angle in degrees within a range, in rad.
///
/// # Errors
/// It is outside of the range.
pub(crate) fn angle_deg(degrees: f64, [low, high]: [f64; 2], what: &str, line: u64) -> Result<f64, Error> {
    // A little more, for what was rounded.
    match (low - 1e-3..=high + 1e-3).contains(&degrees) {
        true => Ok(degrees.to_radians()),
        false => Err(Error::malformed(
            Place::Line(line),
            format!("{what} of {degrees}°"),
            format!("{low}° … {high}°"),
        )),
    }
}

/// A reflectance: negative values, which some programs write for "nothing", count as 0.
///
/// # Errors
/// It is larger than any instrument can tell.
pub(crate) fn reflectance(value: f64, line: u64) -> Result<f64, Error> {
    match value <= LARGEST {
        true => Ok(value.max(0.0)),
        false => Err(Error::malformed(
            Place::Line(line),
            format!("a reflectance of {value} 1/sr"),
            format!("at most {LARGEST:e} 1/sr"),
        )),
    }
}

/// A reflectance with seven digits.
pub(crate) fn written(value: f64) -> String {
    format!("{value:.6e}")
}

/// Red, green and blue with seven digits each.
pub(crate) fn written_rgb(rgb: DVec3, separator: &str) -> String {
    rgb.to_array().map(written).join(separator)
}

/// A word as messages show it, without what steers a terminal and not longer than 40 characters.
pub(crate) fn shortened(word: &str) -> String {
    word.chars().filter(|c| !c.is_control()).take(40).collect()
}
