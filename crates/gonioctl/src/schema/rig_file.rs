use std::collections::BTreeMap;

use rig::RigFile;
use serde_json::{Map, Value, json};

use self::place::Place;
use super::DIALECT;

mod place;

/// The schema of a rig file.
///
/// Which keys a table has is asked of the parser, by a key that it does not know; what a key may hold likewise, by values
/// that it refuses with what is allowed. What a key means, and its default, stand in the shipped file.
pub(super) fn schema() -> Value {
    let shipped = Shipped::read(RigFile::BUILT_IN);
    let properties: Map<String, Value> = Place::of("")
        .keys()
        .into_iter()
        .map(|table| {
            let schema = shipped.table(&table);
            (table, schema)
        })
        .collect();
    json!({
        "$schema": DIALECT,
        "$id": "urn:goniod:rig-file:1",
        "title": "Rig file of goniod",
        "description": "The two arms, the photometer and the lamp. Keys that are missing have their defaults.",
        "type": "object",
        "properties": properties,
        "additionalProperties": false,
    })
}

/// The shipped file: what it says of each key, and the default, by table.
struct Shipped {
    about: BTreeMap<String, String>,
    tables: BTreeMap<String, BTreeMap<String, (String, String)>>,
}

impl Shipped {
    fn read(text: &str) -> Self {
        let (mut table, mut comment) = (String::new(), String::new());
        let mut shipped = Self {
            about: BTreeMap::new(),
            tables: BTreeMap::new(),
        };
        // Whether the next line of comment begins another one.
        let mut ended = true;
        for line in text.lines() {
            let given = line.strip_prefix("# ").unwrap_or(line);
            if let Some((key, default)) = assignment(given) {
                let keys = shipped.tables.entry(table.clone()).or_default();
                keys.insert(key.to_owned(), (comment.clone(), default.to_owned()));
                ended = true;
            } else if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
                name.clone_into(&mut table);
                shipped.about.insert(table.clone(), std::mem::take(&mut comment));
            } else if let Some(said) = line.strip_prefix('#') {
                if std::mem::take(&mut ended) {
                    comment.clear();
                }
                comment += said;
            } else {
                comment.clear();
            }
        }
        shipped
    }

    /// The schema of a table, by its path.
    fn table(&self, path: &str) -> Value {
        let properties: Map<String, Value> = Place::of(path)
            .keys()
            .into_iter()
            .map(|key| {
                let schema = self.key(path, &key);
                (key, schema)
            })
            .collect();
        let mut schema = json!({ "type": "object", "properties": properties, "additionalProperties": false });
        if let Some(about) = self.about.get(path).filter(|about| !about.is_empty()) {
            schema["description"] = json!(about.trim());
        }
        schema
    }

    fn key(&self, table: &str, key: &str) -> Value {
        let path = format!("{table}.{key}");
        if self.about.contains_key(&path) || ["sim.light", "sim.sensor"].contains(&path.as_str()) {
            return self.table(&path);
        }
        // Both arms have the same keys, explained once; so has one arm's own table of the simulator.
        let beside = match table {
            "sensor" => "light",
            "sim.light" | "sim.sensor" => "sim",
            other => other,
        };
        let of = |table: &str| self.tables.get(table)?.get(key);
        let Some((about, default)) = of(table).or_else(|| of(beside)) else {
            return json!({ "deprecated": true, "description": "The old name of another key." });
        };
        let about = of(beside).map_or(about, |(about, _)| about);
        let about = match self.about.get(table) {
            Some(of_table) if about.is_empty() => of_table,
            _ => about,
        };
        let value: toml::Table = format!("x = {default}")
            .parse()
            .expect("a test reads the shipped file");
        let mut schema = Place::of(&path).schema(&value["x"], example(about).as_ref());
        schema["default"] = json!(value["x"]);
        if !about.is_empty() {
            schema["description"] = json!(about.trim());
        }
        schema
    }
}

/// A key and its value, where a line is that.
fn assignment(line: &str) -> Option<(&str, &str)> {
    let (key, value) = line.split_once(" = ")?;
    let is_key = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    (key.chars().all(is_key) && format!("x = {value}").parse::<toml::Table>().is_ok()).then_some((key, value))
}

/// The inline table that a comment gives as an example.
fn example(comment: &str) -> Option<toml::Value> {
    let start = comment.find("such as {")? + "such as ".len();
    let end = start + comment[start..].find('}')? + 1;
    let mut table: toml::Table = format!("x = {}", &comment[start..end]).parse().ok()?;
    table.remove("x")
}

#[cfg(test)]
mod tests {
    use super::place::refusal;
    use super::*;

    fn validator() -> jsonschema::Validator {
        jsonschema::draft202012::new(&schema()).unwrap()
    }

    fn json_of(text: &str) -> Value {
        serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap()
    }

    /// The shipped file with every default that stands behind a # given.
    fn every_key() -> String {
        let given = |line: &str| match line.strip_prefix("# ").map(assignment) {
            Some(Some((key, value))) => format!("{key} = {value}\n"),
            _ => format!("{line}\n"),
        };
        RigFile::BUILT_IN.lines().map(given).collect()
    }

    #[test]
    fn the_shipped_file_is_one_by_the_schema_with_every_key_given_too() {
        let schema = validator();
        for text in [RigFile::BUILT_IN, "", &every_key()] {
            assert_eq!(refusal(text), None);
            let found = json_of(text);
            let errors: Vec<_> = schema
                .iter_errors(&found)
                .map(|error| error.to_string())
                .collect();
            assert!(errors.is_empty(), "{errors:?}");
        }
    }

    #[test]
    fn rigs_that_are_not_as_the_shipped_one_are_ones_by_the_schema() {
        let schema = validator();
        for text in [
            "bus.port = \"/dev/ttyUSB0\"\n",
            "bus.baud = 57600\nlight.model = \"XC330-T288-T\"\n",
            "[light]\nmodel = \"PH54-200-S500-R\"\nzero_deg = -20.0\nvelocity_deg_s = 20.0\n",
            "[light]\nzero_deg = 90\n[sim]\nseed = 7\n",
            "suspend.supply_v = [10.5, 11.0]\n",
            "[sim]\nspecimen = \"./some.binary\"\nfault = [{ device = \"sensor\", at_s = 3.5, what = \"overload\" }]\n",
            "[sim.light]\ncreep = { counts = 1.0, counts_per_s = 5.0 }\n",
            "[uncertainty]\nangle_deg = 0.05\nplay_deg = 0\n",
            "[sim]\nfault = [{ device = \"light\", what = { stall_s = 0.2 } }]\n",
            "[[sim.fault]]\ndevice = \"light\"\nwhat = { mechanics = { stiction_counts = 3, creep = { counts = 1, counts_per_s = 5 } } }\n",
            "[[sim.fault]]\ndevice = \"photometer\"\nwhat = { room_light = { per_sr = 0.1, for_s = 3.0 } }\n",
            "[sim.wire]\nsilent = [{ id = 2, from_s = 3.0 }, { id = 3, from_s = 0.0 }]\n",
        ] {
            assert_eq!(refusal(text), None, "{text}");
            let found = json_of(text);
            assert!(
                schema.is_valid(&found),
                "{text}: {:?}",
                schema.iter_errors(&found).next()
            );
        }
    }

    #[test]
    fn what_is_no_rig_file_is_none_by_the_schema() {
        let schema = validator();
        for text in [
            "zzz = 1\n",
            "[motion]\nsettle = 20\n",
            "[bus]\nbuad = 57600\n",
            "[bus]\nbaud = \"fast\"\n",
            "[bus]\nbaud = 19200\n",
            "[bus]\nport = \"\"\n",
            "[light]\nmin_deg = -95.0\n",
            "[light]\nid = 253\n",
            "[light]\nid = 1.5\n",
            "[light]\nsign = 2\n",
            "[light]\nreturn_delay_us = 3\n",
            "[sensor]\nmodel = \"AX-12\"\n",
            "[motion]\nwatchdog_ms = 30\n",
            "[motion]\napproach = \"sideways\"\n",
            "[motion]\nestop = true\n",
            "[envelope]\nseparation_deg = 61.0\n",
            "[photometer]\naim = 0.95\n",
            "[calibration]\nresponsivity = [1.0, 0.0, 1.0]\n",
            "[calibration]\nresponsivity = [1.0, 1.0]\n",
            "[calibration]\nmonitor = 0.0\n",
            "[suspend]\nsupply_v = \"any\"\n",
            "[uncertainty]\nzero_deg = 11.0\n",
            "[sim]\nspeciment = \"gold-paint\"\n",
            "[sim]\nwire.noyse = 0.1\n",
            "[sim]\nclock = \"sun\"\n",
            "[sim.mishaps]\nsilense = 1.0\n",
            "[sim]\ncrosstalk = 0.6\n",
            "[sim]\nstiction_counts = 101.0\n",
            "[light]\nzero_deg = 361.0\n",
            "[sensor]\nvelocity_deg_s = 0.0\n",
            "[motion]\npark_light_deg = -91.0\n",
            "[photometer]\nenough = 16777216\n",
            "[photometer]\nintegration_max_us = 10000001\n",
            "[uncertainty]\nangle_deg = 11.0\n",
            "[uncertainty]\nplay_deg = \"both\"\n",
            "[sim]\nstart_light_deg = -91.0\n",
            "[sim]\ncreep = { counts = 101.0, counts_per_s = 0.0 }\n",
            "[sim]\ncreep = { counts = 1.0 }\n",
            "[sim.sensor]\nring = { counts = 1.0, hz = 51.0, tau_s = 1.0 }\n",
            "[sim]\nfault = [{ device = \"lamp\", what = \"overload\" }]\n",
            "[sim]\nfault = [{ device = \"light\", what = \"overlord\" }]\n",
            "[sim]\nfault = [{ device = \"light\", what = { stall_s = -1.0 } }]\n",
            "[sim]\nfault = [{ device = \"light\", what = { hardware_error = 256 } }]\n",
            "[sim]\nfault = [{ device = \"light\", what = { turn_deg = 181.0 } }]\n",
            "[sim]\nfault = [{ device = \"light\", what = { mechanics = { jitter_counts = 51.0 } } }]\n",
            "[sim]\nfault = [{ device = \"light\", at_s = -1.0, what = \"overload\" }]\n",
            "[sim]\nfault = [{ device = \"light\" }]\n",
            "[sim.wire]\nsilent = [{ id = 253, from_s = 3.0 }]\n",
            "[sim.wire]\nsilent = [{ id = 2 }]\n",
        ] {
            assert!(refusal(text).is_some(), "{text}");
            assert!(!schema.is_valid(&json_of(text)), "{text}");
        }
    }

    /// Every key that has no table of its own, with its schema.
    fn leaves() -> Vec<(String, Value)> {
        fn walk(schema: &Value, path: &str, found: &mut Vec<(String, Value)>) {
            for (key, schema) in schema["properties"].as_object().unwrap() {
                let path = format!("{path}{key}");
                // Inline tables have a default, tables with a header have none.
                match schema["properties"].is_object() && schema["default"].is_null() {
                    true => walk(schema, &format!("{path}."), found),
                    false => found.push((path, schema.clone())),
                }
            }
        }
        let mut found = Vec::new();
        walk(&schema(), "", &mut found);
        assert!(found.len() > 150, "only {} keys", found.len());
        found
    }

    /// Whether a schema, or one within it, is of numbers without a range and without a reason why there is none.
    fn has_boundless(schema: &Value) -> bool {
        match schema {
            Value::Array(all) => all.iter().any(has_boundless),
            Value::Object(all) => {
                let is_number = all
                    .get("type")
                    .is_some_and(|kind| kind == "number" || kind == "integer");
                let is_bounded = ["minimum", "maximum"]
                    .iter()
                    .all(|bound| all.contains_key(*bound));
                let is_said = is_bounded || all.contains_key("enum") || all.contains_key("$comment");
                (is_number && !is_said) || all.values().any(has_boundless)
            }
            _ => false,
        }
    }

    #[test]
    fn every_key_has_a_meaning_and_every_number_its_range_or_why_it_has_none() {
        let mut tried = 0;
        for (path, schema) in leaves() {
            assert!(schema["description"].is_string(), "{path} is not explained");
            assert!(!has_boundless(&schema), "{path} has no range: {schema}");
            for (bound, by) in [("minimum", -1.0), ("maximum", 1.0)] {
                if let Some(bound) = schema[bound].as_f64() {
                    let beyond = match schema["type"] == "integer" {
                        true => format!("{}", i128::from(bound as i64) + by as i128),
                        false => format!("{:?}", bound + by),
                    };
                    assert!(
                        refusal(&format!("{path} = {beyond}\n")).is_some(),
                        "{path} takes {beyond}"
                    );
                    tried += 1;
                }
            }
        }
        assert!(tried > 170, "only {tried} bounds");
    }

    /// What an editor marks as wrong is wrong: the schema takes whatever the parser takes.
    #[test]
    fn what_the_parser_takes_the_schema_takes() {
        let schema = validator();
        let mut taken = 0;
        for (path, of_key) in leaves() {
            for value in [
                "-1",
                "0",
                "1",
                "7",
                "20",
                "1000",
                "1000000",
                "-0.5",
                "0.0",
                "0.5",
                "1.0",
                "45.0",
                "-45.0",
                "200.5",
                "1e9",
                "true",
                "false",
                "\"x\"",
                "\"model\"",
                "\"none\"",
                "[]",
                "[0, 0]",
                "[1.0, 2.0]",
                "[2.0, 1.0]",
                "[1.0, 1.0, 1e9]",
                "{ counts = 1, counts_per_s = 2 }",
                "[{ id = 2, from_s = 3 }]",
            ] {
                // Numbers in the order of its keys are read as an inline table, which nobody is told.
                if of_key["properties"].is_object() && value.starts_with('[') {
                    continue;
                }
                let text = format!("{path} = {value}\n");
                if refusal(&text).is_none() {
                    let found = json_of(&text);
                    assert!(
                        schema.is_valid(&found),
                        "{text}: {:?}",
                        schema.iter_errors(&found).next()
                    );
                    taken += 1;
                }
            }
        }
        assert!(taken > 500, "only {taken} values");
    }
}
