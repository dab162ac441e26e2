use crate::Error;

/// Checks the values of a study file.
pub(crate) struct Check<'a> {
    /// What messages call the file.
    pub(crate) file: &'a str,
}

impl Check<'_> {
    /// The text as a table.
    pub(crate) fn parse<T: serde::de::DeserializeOwned>(&self, text: &str) -> Result<T, Error> {
        config::parse(text).map_err(|flaws| {
            let line = flaws.line(text).map(|line| format!("line {line}: "));
            let key = flaws.first().key.as_ref().map(|key| format!("{key}: "));
            Error::Syntax {
                file: self.file.to_owned(),
                message: [line, key, Some(flaws.why(text))].into_iter().flatten().collect(),
            }
        })
    }

    pub(crate) fn range(&self, key: &'static str, value: impl ToString, allowed: &'static str) -> Error {
        Error::Range {
            file: self.file.to_owned(),
            key,
            value: value.to_string(),
            allowed,
        }
    }

    /// A value that must be good.
    pub(crate) fn number(
        &self,
        key: &'static str,
        value: impl ToString,
        good: bool,
        allowed: &'static str,
    ) -> Result<(), Error> {
        if good {
            Ok(())
        } else {
            Err(self.range(key, value, allowed))
        }
    }

    /// A list that must hold something, and only what is good.
    pub(crate) fn list<T: ToString + Copy>(
        &self,
        key: &'static str,
        values: &[T],
        good: impl Fn(T) -> bool,
        allowed: &'static str,
    ) -> Result<(), Error> {
        if values.is_empty() {
            return Err(self.range(key, "empty", allowed));
        }
        match values.iter().find(|&&value| !good(value)) {
            Some(value) => Err(self.range(key, *value, allowed)),
            None => Ok(()),
        }
    }
}
