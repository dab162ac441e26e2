use std::ops::Range;

use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue, Deserializer};

use crate::{Flaw, Flaws};

/// Most flaws that are told of one text: finding each costs another reading of all of it.
const MOST: usize = 10;

/// Words that are less alike than this (Jaro and Winkler, 0 … 1) are different words rather than slips.
const ALIKE: f64 = 0.8;

/// Reads a TOML text into a type. Every key that the type does not know is told, with the known one most like it.
///
/// # Errors
/// No TOML, an unknown or missing key, a value of the wrong type.
pub fn parse<T: DeserializeOwned>(text: &str) -> Result<T, Flaws> {
    match DeTable::parse(text) {
        Ok(table) => of_table(table),
        Err(error) => Err(Flaws {
            first: flaw(&error, &DeTable::new()),
            others: Vec::new(),
            more: false,
        }),
    }
}

/// Reads a table that was parsed before into a type, as [`parse`] does.
///
/// # Errors
/// As [`parse`].
pub fn of_table<T: DeserializeOwned>(table: Spanned<DeTable<'_>>) -> Result<T, Flaws> {
    let mut error = match T::deserialize(Deserializer::from(table.clone())) {
        Ok(value) => return Ok(value),
        Err(error) => error,
    };
    let mut first = flaw(&error, table.get_ref());
    let mut others = Vec::new();
    // What is wrong is mended or taken out, and the rest read again, until nothing more is found.
    let mut left = table.clone();
    for _ in 0..3 * MOST {
        if others.len() == MOST || !mend(left.get_mut(), &error) {
            break;
        }
        error = match T::deserialize(Deserializer::from(left.clone())) {
            Ok(_) => break,
            Err(error) => error,
        };
        // What is missing may well be missing because its key is misspelt, or was taken out.
        if !error.message().starts_with("missing field") {
            others.push(flaw(&error, table.get_ref()));
        }
    }
    let start = |flaw: &Flaw| flaw.span.as_ref().map(|span| span.start);
    if let Some(earliest) = others.iter_mut().min_by_key(|flaw| start(flaw))
        && start(earliest) < start(&first)
    {
        std::mem::swap(earliest, &mut first);
    }
    others.sort_by_key(start);
    let more = others.len() == MOST;
    others.truncate(MOST - 1);
    Err(Flaws { first, others, more })
}

/// Takes what an error is about out of a table, or gives a misspelt key its name. Returns whether that was found.
fn mend(table: &mut DeTable<'_>, error: &toml::de::Error) -> bool {
    let Some(span) = error.span() else { return false };
    let slip =
        unknown(error.message()).is_some_and(|(name, _)| correct(table, name, best(error.message()), &span));
    slip || remove(table, span.start)
}

fn flaw(error: &toml::de::Error, table: &DeTable<'_>) -> Flaw {
    let message = error.message().lines().collect::<Vec<_>>().join(", ");
    let span = error.span();
    let key = span.as_ref().and_then(|span| {
        let stranger = unknown(error.message()).and_then(|(name, _)| path(table, name, span));
        stranger.or_else(|| {
            let mut entries = table.iter();
            entries.find_map(|(key, value)| path_at(key.get_ref(), value, span.start))
        })
    });
    let why = match best(&message).zip(message.split_once(", expected")) {
        Some((best, (what, allowed))) => format!("{what}, did you mean `{best}`? Expected{allowed}"),
        None => message,
    };
    Flaw { span, key, why }
}

/// The word of a message of serde that was not expected, and those that are known.
fn unknown(message: &str) -> Option<(&str, impl Iterator<Item = &str>)> {
    let of = |kind| message.strip_prefix(kind);
    let rest = of("unknown field `").or_else(|| of("unknown variant `"))?;
    let (name, rest) = rest.split_once('`')?;
    // Known words stand between every other pair of marks.
    Some((name, rest.split('`').skip(1).step_by(2)))
}

/// The known word that is most like the unknown one of a message, where one is like it.
fn best(message: &str) -> Option<&str> {
    let (name, known) = unknown(message)?;
    let score = |word: &str| strsim::jaro_winkler(&name.to_lowercase(), word);
    let best = known.max_by(|a, b| score(a).total_cmp(&score(b)))?;
    (score(best) >= ALIKE).then_some(best)
}

/// Path of the key of this name and span; `None`: it is no key.
fn path(table: &DeTable<'_>, name: &str, span: &Range<usize>) -> Option<String> {
    let is = |key: &Spanned<_>| key.get_ref() == name && key.span() == *span;
    if table.keys().any(is) {
        return Some(name.to_owned());
    }
    table
        .iter()
        .find_map(|(key, value)| path_below(key.get_ref(), value, name, span))
}

fn path_below(above: &str, value: &Spanned<DeValue<'_>>, name: &str, span: &Range<usize>) -> Option<String> {
    match value.get_ref() {
        DeValue::Table(table) => path(table, name, span).map(|below| format!("{above}.{below}")),
        DeValue::Array(array) => array
            .iter()
            .enumerate()
            .find_map(|(index, value)| path_below(&format!("{above}[{index}]"), value, name, span)),
        _ => None,
    }
}

/// Path of the innermost key whose value covers an offset; `above` is that of the value.
fn path_at(above: &str, value: &Spanned<DeValue<'_>>, offset: usize) -> Option<String> {
    let below = match value.get_ref() {
        DeValue::Table(table) => table
            .iter()
            .find_map(|(key, value)| path_at(&format!("{above}.{}", key.get_ref()), value, offset)),
        DeValue::Array(array) => array
            .iter()
            .enumerate()
            .find_map(|(index, value)| path_at(&format!("{above}[{index}]"), value, offset)),
        _ => None,
    };
    below.or_else(|| value.span().contains(&offset).then(|| above.to_owned()))
}

/// Gives the key of this name and span the name that was meant, or takes it out. Returns whether there is such a key.
fn correct(table: &mut DeTable<'_>, name: &str, meant: Option<&str>, span: &Range<usize>) -> bool {
    let is = |key: &Spanned<_>| key.get_ref() == name && key.span() == *span;
    if table.keys().any(is) {
        let value = table.remove(name);
        if let (Some(value), Some(meant)) = (value, meant)
            && !table.contains_key(meant)
        {
            table.insert(Spanned::new(span.clone(), meant.to_owned().into()), value);
        }
        return true;
    }
    table
        .iter_mut()
        .any(|(_, value)| correct_below(value.get_mut(), name, meant, span))
}

fn correct_below(value: &mut DeValue<'_>, name: &str, meant: Option<&str>, span: &Range<usize>) -> bool {
    match value {
        DeValue::Table(table) => correct(table, name, meant, span),
        DeValue::Array(array) => array
            .iter_mut()
            .any(|value| correct_below(value.get_mut(), name, meant, span)),
        _ => false,
    }
}

/// Takes out the innermost key or element whose value covers an offset. Returns whether there is one.
fn remove(table: &mut DeTable<'_>, offset: usize) -> bool {
    if table
        .iter_mut()
        .any(|(_, value)| remove_below(value.get_mut(), offset))
    {
        return true;
    }
    let covering = table.iter().find(|(_, value)| value.span().contains(&offset));
    let key = covering.map(|(key, _)| key.get_ref().clone());
    key.is_some_and(|key| table.remove(key.as_ref()).is_some())
}

fn remove_below(value: &mut DeValue<'_>, offset: usize) -> bool {
    match value {
        DeValue::Table(table) => remove(table, offset),
        DeValue::Array(array) => {
            if array
                .iter_mut()
                .any(|value| remove_below(value.get_mut(), offset))
            {
                return true;
            }
            let mut kept = DeArray::new();
            for element in array.iter().filter(|element| !element.span().contains(&offset)) {
                kept.push(element.clone());
            }
            let removed = kept.len() < array.len();
            *array = kept;
            removed
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "read, never looked at")]
    struct Job {
        specimen: Option<String>,
        #[serde(default)]
        plane: Vec<Plane>,
        model: Option<Model>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "read, never looked at")]
    struct Plane {
        theta_r_deg: f64,
        readings: u32,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Model {
        Planes,
        Separable,
    }

    fn told(text: &str) -> (Option<usize>, Option<String>, String) {
        let flaws = parse::<Job>(text).unwrap_err();
        (flaws.line(text), flaws.first().key.clone(), flaws.why(text))
    }

    #[test]
    fn every_unknown_key_is_told_with_the_one_that_was_meant() {
        let text = "speciment = \"x\"\n[[plane]]\ntheta_r_deg = 1\nreading = 3\n[[plane]]\nthetar_deg = 1\nreadings = 2\n[zzz]\n";
        let (line, key, why) = told(text);
        assert_eq!((line, key.as_deref()), (Some(1), Some("speciment")));
        for said in [
            "did you mean `specimen`?",
            "line 4: plane[0].reading: unknown field `reading`, did you mean `readings`?",
            "line 6: plane[1].thetar_deg: unknown field `thetar_deg`, did you mean `theta_r_deg`?",
            "line 8: zzz: unknown field `zzz`, expected one of",
        ] {
            assert!(why.contains(said), "\"{said}\" is missing in: {why}");
        }
        assert!(!why.contains("missing field"), "{why}");
    }

    #[test]
    fn an_unknown_word_is_told_with_the_one_that_was_meant() {
        let (line, key, why) = told("\nmodel = \"plane\"");
        assert_eq!((line, key.as_deref()), (Some(2), Some("model")));
        assert_eq!(
            why,
            "unknown variant `plane`, did you mean `planes`? Expected `planes` or `separable`"
        );
    }

    #[test]
    fn an_unknown_key_does_not_hide_a_wrong_type() {
        let (_, _, why) = told("spec = \"x\"\nzzz = 1\n[[plane]]\ntheta_r_deg = 1\nreadings = \"many\"\n");
        assert!(why.contains("unknown field `spec`"), "{why}");
        assert!(why.contains("line 2: zzz: unknown field `zzz`"), "{why}");
        assert!(why.contains("line 5: plane[0].readings: invalid type"), "{why}");
    }

    #[test]
    fn a_missing_key_is_told() {
        let (_, _, why) = told("[[plane]]\nreadings = 2");
        assert!(why.contains("missing field `theta_r_deg`"), "{why}");
    }

    #[test]
    fn so_many_flaws_are_told_and_no_more() {
        let text: String = (100..600).map(|n| format!("key_{n} = 1\n")).collect();
        let (_, _, why) = told(&text);
        assert_eq!(why.matches("unknown field").count(), MOST, "{why}");
        assert!(why.contains("key_109") && why.ends_with("; and more"), "{why}");
    }

    proptest! {
        /// Whatever keys are unknown, wherever they stand: each is named with its line.
        #[test]
        fn prop_each_unknown_key_is_named_with_its_line(
            keys in proptest::collection::btree_set("x[a-z]{3,12}", 1..6),
            in_plane in any::<bool>(),
        ) {
            let mut text = "specimen = \"a\"\n".to_owned();
            if in_plane {
                text += "[[plane]]\ntheta_r_deg = 1\nreadings = 2\n";
            }
            let before = text.lines().count();
            for key in &keys {
                text += &format!("{key} = 1\n");
            }
            let flaws = parse::<Job>(&text).unwrap_err();
            let all = std::iter::once(&flaws.first).chain(&flaws.others);
            let found: Vec<_> = all.map(|flaw| (flaw.key.clone().unwrap(), crate::error::line(&text, &flaw.span.clone().unwrap()))).collect();
            let path = |key: &String| if in_plane { format!("plane[0].{key}") } else { key.clone() };
            let expected: Vec<_> = keys.iter().zip(before + 1..).map(|(key, line)| (path(key), line)).collect();
            prop_assert_eq!(found, expected);
        }
    }
}
