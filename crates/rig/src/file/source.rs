use std::fmt::Display;
use std::ops::{Range, RangeInclusive};
use std::path::Path;

use sha2::{Digest, Sha256};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::raw::RawFile;
use crate::RigError;
use crate::error::Place;

/// Characters of a text that stands in one line.
const LINE: usize = 200;

/// Span of values that come from the built-in file: no line of the user's file is to blame for them.
const BUILT_IN: Range<usize> = 0..0;

/// Keys that had another name once: table, old name, new name.
const RENAMED: [(&str, &str, &str); 1] = [("motion", "tolerance_deg", "near_deg")];

/// The text of a rig file with its name; turns spans into lines.
pub(super) struct Source<'a> {
    pub(super) text: &'a str,
    pub(super) name: &'a Path,
}

impl Source<'_> {
    /// Reads the text over the built-in one, key by key.
    pub(super) fn raw(&self, built_in: &str) -> Result<RawFile, RigError> {
        let mut base = DeTable::parse(built_in).map_err(|error| self.syntax(&error))?;
        unplace(base.get_mut());
        let mut own = DeTable::parse(self.text).map_err(|error| self.syntax(&error))?;
        self.rename(own.get_mut())?;
        overlay(base.get_mut(), own.into_inner());
        config::of_table(base).map_err(|flaws| RigError::Form {
            place: self.place(flaws.first().span.as_ref()),
            key: flaws.first().key.clone(),
            why: flaws.why(self.text),
        })
    }

    /// SHA-256 of what a calibration depends on, with the defaults filled in; see [`crate::RigFile::fingerprint`].
    pub(super) fn fingerprint(&self, built_in: &str) -> Result<String, RigError> {
        let table = |text: &str| text.parse::<toml::Table>().map_err(|error| self.syntax(&error));
        let mut all = table(built_in)?;
        merge(&mut all, table(self.text)?);
        // From which side an arm comes to a pose says to which side it leans: zeros hold for that alone. Certificates that
        // were made without an approach keep their fingerprint.
        let approach = all
            .get("motion")
            .and_then(|motion| motion.get("approach"))
            .cloned();
        // Certificates that were made with the node keep their fingerprint. Where an instrument is, is no part of what it is.
        let mut detector = all.remove("detector");
        let keys = detector.as_mut().and_then(toml::Value::as_table_mut);
        let node = keys.is_none_or(|keys| {
            for connection in ["address", "baud", "timeout_ms"] {
                keys.remove(connection);
            }
            keys.get("kind").and_then(toml::Value::as_str) == Some("node")
        });
        all.retain(|key, _| ["light", "sensor", "photometer", "calibration"].contains(&key));
        if let Some(detector) = detector.filter(|_| !node) {
            all.insert("detector".to_owned(), detector);
        }
        if let Some(approach) = approach.filter(|approach| approach.as_str() != Some("none")) {
            all.insert("approach".to_owned(), approach);
        }
        for (name, value) in &mut all {
            let Some(keys) = value.as_table_mut() else {
                continue;
            };
            keys.retain(|key, _| {
                name != "calibration" || ["filling", "monitor", "responsivity"].contains(&key)
            });
            // 60 and 60.0 say the same.
            for (_, value) in keys.iter_mut() {
                if let Some(whole) = value.as_integer() {
                    *value = toml::Value::Float(whole as f64);
                }
            }
        }
        let hash = Sha256::digest(all.to_string());
        Ok(hash.iter().map(|byte| format!("{byte:02x}")).collect())
    }

    /// Gives keys that had another name once the one that they have now.
    fn rename(&self, table: &mut DeTable<'_>) -> Result<(), RigError> {
        for (name, old, new) in RENAMED {
            let Some(DeValue::Table(keys)) = table.get_mut(name).map(Spanned::get_mut) else {
                continue;
            };
            let Some((key, value)) = keys.remove_entry(old) else {
                continue;
            };
            if keys.contains_key(new) {
                return Err(RigError::Form {
                    place: self.place(Some(&key.span())),
                    key: Some(format!("{name}.{old}")),
                    why: format!("it is the old name of {new}, which is given too: leave it out"),
                });
            }
            keys.insert(Spanned::new(key.span(), new.into()), value);
        }
        Ok(())
    }

    fn syntax(&self, error: &toml::de::Error) -> RigError {
        RigError::Form {
            place: self.place(error.span().as_ref()),
            key: None,
            why: error.message().to_owned(),
        }
    }

    fn place(&self, span: Option<&Range<usize>>) -> Place {
        let before = |span: &Range<usize>| self.text.get(..span.start);
        Place {
            file: self.name.to_owned(),
            line: span
                .and_then(before)
                .map(|text| text.bytes().filter(|&b| b == b'\n').count() + 1),
        }
    }

    /// What a key holds as one line of text: `text`, the value or what counts of it.
    pub(super) fn line(&self, key: &str, value: &Spanned<String>, text: &str) -> Result<String, RigError> {
        match text.chars().count() <= LINE && !text.chars().any(char::is_control) {
            true => Ok(text.to_owned()),
            false => {
                let allowed = format!("a line of at most {LINE} characters");
                Err(self.refuse(key, value, format!("{text:?}"), allowed))
            }
        }
    }

    /// The error of a value that is not allowed.
    pub(super) fn refuse<T>(
        &self,
        key: &str,
        value: &Spanned<T>,
        found: impl Display,
        allowed: impl Display,
    ) -> RigError {
        let span = Some(value.span()).filter(|span| *span != BUILT_IN);
        RigError::Value {
            place: self.place(span.as_ref()),
            key: key.to_owned(),
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }

    /// A value within a range; NaN is in none.
    pub(super) fn within<T: PartialOrd + Display + Copy>(
        &self,
        key: &str,
        value: &Spanned<T>,
        range: RangeInclusive<T>,
    ) -> Result<T, RigError> {
        let found = *value.get_ref();
        if range.contains(&found) {
            return Ok(found);
        }
        Err(self.refuse(key, value, found, format!("{} … {}", range.start(), range.end())))
    }

    /// One of a few words.
    pub(super) fn one_of<T: Copy>(
        &self,
        key: &str,
        value: &Spanned<String>,
        words: &[(&str, T)],
    ) -> Result<T, RigError> {
        let found = words.iter().find(|(word, _)| word == value.get_ref());
        found.map(|&(_, meaning)| meaning).ok_or_else(|| {
            let allowed: Vec<_> = words.iter().map(|(word, _)| format!("\"{word}\"")).collect();
            self.refuse(key, value, format!("\"{}\"", value.get_ref()), allowed.join(", "))
        })
    }
}

/// A number, whole or not, as TOML may spell either.
pub(super) fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or(value.as_integer().map(|whole| whole as f64))
}

/// Marks every value of the built-in file as such.
fn unplace(table: &mut DeTable<'_>) {
    for (_, value) in table.iter_mut() {
        let mut inner = std::mem::replace(value.get_mut(), DeValue::Boolean(false));
        if let DeValue::Table(table) = &mut inner {
            unplace(table);
        }
        *value = Spanned::new(BUILT_IN, inner);
    }
}

/// Puts every key of `top` over those of `base`, table by table.
fn overlay<'a>(base: &mut DeTable<'a>, top: DeTable<'a>) {
    for (key, value) in top {
        let span = value.span();
        match (base.get_mut(&key).map(Spanned::get_mut), value.into_inner()) {
            (Some(DeValue::Table(below)), DeValue::Table(above)) => overlay(below, above),
            (_, value) => {
                base.insert(key, Spanned::new(span, value));
            }
        }
    }
}

/// Puts every key of `top` over those of `base`, table by table.
fn merge(base: &mut toml::Table, top: toml::Table) {
    for (key, value) in top {
        match (base.get_mut(&key), value) {
            (Some(toml::Value::Table(below)), toml::Value::Table(above)) => merge(below, above),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}
