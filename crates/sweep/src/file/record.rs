use std::fmt;

use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use toml::Spanned;

use super::Source;
use crate::{Specimen, SweepError, line};

/// The key `specimen`: a name, or a table.
#[derive(Default)]
pub(super) struct RawSpecimen(RawTable);

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawTable {
    #[serde(default)]
    name: String,
    id: Option<Spanned<String>>,
    material: Option<Spanned<String>>,
    tags: Option<Spanned<Vec<String>>>,
    notes: Option<Spanned<String>>,
}

/// The `[run]` table: who measures, and what for.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawRun {
    operator: Option<Spanned<String>>,
    project: Option<Spanned<String>>,
}

impl<'de> Deserialize<'de> for RawSpecimen {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameOrTable;
        impl<'de> Visitor<'de> for NameOrTable {
            type Value = RawSpecimen;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("a name, or a table with name, id, material, tags and notes")
            }

            fn visit_str<E>(self, name: &str) -> Result<RawSpecimen, E> {
                Ok(RawSpecimen(RawTable {
                    name: name.to_owned(),
                    ..RawTable::default()
                }))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<RawSpecimen, A::Error> {
                RawTable::deserialize(MapAccessDeserializer::new(map)).map(RawSpecimen)
            }
        }
        deserializer.deserialize_any(NameOrTable)
    }
}

impl RawSpecimen {
    /// The checked specimen.
    ///
    /// # Errors
    /// A text that is too long or holds control characters; too many tags, or an empty one.
    pub(super) fn check(self, source: &Source<'_>) -> Result<Specimen, SweepError> {
        let Self(raw) = self;
        let span = |key: &str| match key {
            "id" => raw.id.as_ref().map(Spanned::span),
            "material" => raw.material.as_ref().map(Spanned::span),
            "notes" => raw.notes.as_ref().map(Spanned::span),
            _ => raw.tags.as_ref().map(Spanned::span),
        };
        let text =
            |text: &Option<Spanned<String>>| text.as_ref().map_or("", |text| text.get_ref()).to_owned();
        let specimen = Specimen {
            name: raw.name.clone(),
            id: text(&raw.id),
            material: text(&raw.material),
            tags: raw
                .tags
                .as_ref()
                .map(|tags| tags.get_ref().clone())
                .unwrap_or_default(),
            notes: text(&raw.notes),
        };
        specimen
            .checked()
            .map_err(|flaw| source.refuse(span(flaw.key), format!("specimen.{}", flaw.key), flaw.why))
    }
}

impl RawRun {
    /// Operator and project.
    ///
    /// # Errors
    /// A text that is too long or holds control characters.
    pub(super) fn check(&self, source: &Source<'_>) -> Result<(String, String), SweepError> {
        let line = |text: &Option<Spanned<String>>, key| match text {
            Some(text) => line(key, text.get_ref())
                .map_err(|flaw| source.refuse(Some(text.span()), format!("run.{}", flaw.key), flaw.why)),
            None => Ok(String::new()),
        };
        Ok((line(&self.operator, "operator")?, line(&self.project, "project")?))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Job;

    const PLANE: &str = "[[plane]]\ntheta_r_deg = 60\nreadings = 6\n";

    fn parse(record: &str) -> Result<Job, SweepError> {
        Job::parse(&format!("{record}\n{PLANE}"), "job.toml")
    }

    #[test]
    fn a_plain_name_is_a_specimen_and_a_table_says_more() {
        let plain = parse("specimen = \"blue paint\"").unwrap();
        assert_eq!(plain.specimen.name, "blue paint");
        assert_eq!((plain.operator.as_str(), plain.specimen.tags.len()), ("", 0));
        let table = "[specimen]\nname = \"blue paint\"\nid = \"L-42\"\nmaterial = \"acrylic\"\n\
                     tags = [\"paint\", \" paint \", \"reference\"]\nnotes = \"\"\"two\nlines\"\"\"\n\
                     [run]\noperator = \"A. Meier\"\nproject = \"P-17\"";
        let job = parse(table).unwrap();
        assert_eq!(
            job.specimen,
            Specimen {
                name: "blue paint".into(),
                id: "L-42".into(),
                material: "acrylic".into(),
                tags: vec!["paint".into(), "reference".into()],
                notes: "two\nlines".into(),
            }
        );
        assert_eq!(
            (job.operator.as_str(), job.project.as_str()),
            ("A. Meier", "P-17")
        );
        assert_eq!(parse("").unwrap().specimen, Specimen::default());
    }

    #[test]
    fn what_is_wrong_in_the_record_is_told_with_its_key_and_what_is_allowed() {
        let many = format!("specimen.tags = [{}]", "\"a\",".repeat(21));
        for (record, parts) in [
            ("specimen = 4", &["specimen", "a name, or a table"][..]),
            ("specimen.weight = 4", &["weight", "material"]),
            ("specimen.id = \"a\\nb\"", &["specimen.id", "line break"]),
            ("specimen.tags = [\"ok\", \"  \"]", &["specimen.tags", "1 … 50"]),
            (many.as_str(), &["specimen.tags", "21 tags", "20"]),
            ("[run]\noperater = \"x\"", &["operater", "operator"]),
        ] {
            let error = parse(record).unwrap_err().to_string();
            for part in parts.iter().chain(&["job.toml"]) {
                assert!(error.contains(part), "{record}: {error}");
            }
        }
    }

    proptest! {
        #[test]
        fn prop_any_record_is_read_as_written_or_refused(name in ".*", id in ".{0,300}", tag in ".{0,60}", notes in "(?s).{0,100}") {
            let mut specimen = toml::Table::new();
            specimen.insert("name".into(), name.clone().into());
            specimen.insert("id".into(), id.clone().into());
            specimen.insert("tags".into(), vec![tag.clone()].into());
            specimen.insert("notes".into(), notes.clone().into());
            let mut record = toml::Table::new();
            record.insert("specimen".into(), specimen.into());
            match parse(&toml::to_string(&record).unwrap()) {
                Ok(job) => {
                    prop_assert_eq!(job.specimen.name, name);
                    prop_assert_eq!(job.specimen.id, id.trim());
                    prop_assert_eq!(job.specimen.tags, vec![tag.trim().to_owned()]);
                    prop_assert_eq!(job.specimen.notes, notes);
                }
                Err(error) => prop_assert!(error.to_string().contains("specimen."), "{}", error),
            }
        }
    }
}
