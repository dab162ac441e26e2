use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use brdf::Black;
use firmware_sim::{Bench, WireSettings};
use rig::RigFile;
use serde_json::{Map, Value, json};

use super::DIALECT;

/// Keys whose range depends on other keys: what the shipped file allows is not what every rig allows.
const DEPENDENT: [&str; 12] = [
    "light.zero_deg",
    "light.velocity_deg_s",
    "light.acceleration_deg_s2",
    "sensor.zero_deg",
    "sensor.velocity_deg_s",
    "sensor.acceleration_deg_s2",
    "motion.park_light_deg",
    "motion.park_sensor_deg",
    "photometer.integration_max_us",
    "photometer.enough",
    "sim.start_light_deg",
    "sim.start_sensor_deg",
];
/// A word that no key takes.
const NO_WORD: &str = "\"no such word\"";

/// The schema of a rig file.
///
/// Which keys a table has is asked of the parser, by a key that it does not know; what a key may hold likewise, by values
/// that it refuses with what is allowed. What a key means, and its default, stand in the shipped file.
pub(super) fn schema() -> Value {
    let shipped = Shipped::read(RigFile::BUILT_IN);
    let properties: Map<String, Value> = keys("")
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
        let properties: Map<String, Value> = keys(path)
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
        let mut schema = form(&path, key, &value["x"]);
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

/// Why a rig file is refused.
fn refusal(text: &str) -> Option<String> {
    let rig = match RigFile::parse(text, Path::new("rig file")) {
        Ok(rig) => rig,
        Err(error) => return Some(error.to_string()),
    };
    // What lies on the stage does not matter here.
    let bench = Bench::with_specimen(&rig, Arc::new(Black)).map(drop);
    let simulator = bench.and_then(|()| WireSettings::new(&rig).map(drop));
    simulator.err().map(|error| error.to_string())
}

/// Why a value is refused for a key.
fn refused(path: &str, value: &str) -> Option<String> {
    refusal(&format!("{path} = {value}\n"))
}

/// The keys of a table, as the parser names them where it does not know one.
fn keys(table: &str) -> Vec<String> {
    let dot = if table.is_empty() { "" } else { "." };
    let why = refused(&format!("{table}{dot}no_such_key"), "1").unwrap_or_default();
    let Some((_, expected)) = why.split_once("xpected ") else {
        return Vec::new();
    };
    let words = expected.split('`').skip(1).step_by(2);
    words.map(str::to_owned).collect()
}

/// What may stand at a key whose default is this.
fn form(path: &str, key: &str, default: &toml::Value) -> Value {
    if path == "suspend.supply_v" {
        let pair = json!({ "type": "array", "items": { "type": "number", "minimum": 0 }, "minItems": 2, "maxItems": 2 });
        return json!({ "anyOf": [{ "const": "model" }, pair] });
    }
    match default {
        toml::Value::Boolean(_) => json!({ "type": "boolean" }),
        toml::Value::String(_) => word(path, key),
        toml::Value::Integer(_) | toml::Value::Float(_) => number(path),
        toml::Value::Array(array) if array.is_empty() => {
            json!({ "type": "array", "items": { "type": "object" } })
        }
        toml::Value::Array(array) => {
            let above = refused(path, &format!("{:?}", vec![0.0; array.len()]))
                .is_some_and(|why| why.contains("> 0"));
            let least = if above { "exclusiveMinimum" } else { "minimum" };
            json!({
                "type": "array", "items": { "type": "number", least: 0 },
                "minItems": array.len(), "maxItems": array.len(),
            })
        }
        _ => json!({ "type": "object" }),
    }
}

/// A text: one of a few words where the parser says which, else any that is not empty.
fn word(path: &str, key: &str) -> Value {
    let allowed = refused(path, NO_WORD).unwrap_or_default();
    let after = ["allowed: ", "xpected "]
        .iter()
        .find_map(|mark| allowed.split_once(mark));
    let words: Vec<&str> = after.map_or_else(Vec::new, |(_, listed)| {
        listed.split(['"', '`']).skip(1).step_by(2).collect()
    });
    match key {
        _ if words.is_empty() && refused(path, "\"\"").is_some() => {
            json!({ "type": "string", "minLength": 1 })
        }
        _ if words.is_empty() => json!({ "type": "string" }),
        // With or without the letter of its bus.
        "model" => json!({ "type": "string", "pattern": format!("^({})(-[TR])?$", words.join("|")) }),
        _ => json!({ "enum": words }),
    }
}

/// A number, with the range that the parser tells of one that is too large, or too small.
fn number(path: &str) -> Value {
    let whole = refused(path, "0.123").is_some_and(|why| why.contains("invalid type: floating"));
    let kind = if whole { "integer" } else { "number" };
    let [low, high] = match whole {
        true => [i64::MIN.to_string(), i64::MAX.to_string()],
        false => ["-1e300".to_owned(), "1e300".to_owned()],
    };
    let why = refused(path, &high)
        .or_else(|| refused(path, &low))
        .unwrap_or_default();
    let allowed = why.rsplit_once("allowed").map_or("", |(_, allowed)| allowed);
    let listed: Result<Vec<i64>, _> = allowed
        .trim_start_matches(": ")
        .split(", ")
        .map(str::parse)
        .collect();
    if let Ok(listed) = listed
        && whole
    {
        return json!({ "enum": listed });
    }
    let mut schema = json!({ "type": kind });
    if refused(path, "0.0").is_some_and(|why| why.contains("> 0")) {
        schema["exclusiveMinimum"] = json!(0);
    }
    if DEPENDENT.contains(&path) {
        return schema;
    }
    if let Some([least, most]) = range(allowed) {
        schema["minimum"] = least;
        schema["maximum"] = most;
        let odd = refused(path, "1").unwrap_or_default();
        if let Some(step) = odd
            .rsplit_once("in steps of ")
            .and_then(|(_, step)| step.parse::<u32>().ok())
        {
            schema["multipleOf"] = json!(step);
        }
    }
    schema
}

/// The bounds in a text such as "allowed: 0 … 100".
fn range(text: &str) -> Option<[Value; 2]> {
    let (before, after) = text.split_once(" … ")?;
    let number = |word: Option<&str>| -> Option<Value> {
        let word = word?;
        match word.parse::<i64>() {
            Ok(whole) => Some(json!(whole)),
            Err(_) => Some(json!(word.parse::<f64>().ok()?)),
        }
    };
    Some([
        number(before.split_whitespace().next_back())?,
        number(after.split_whitespace().next())?,
    ])
}

#[cfg(test)]
mod tests {
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
        ] {
            assert!(refusal(text).is_some(), "{text}");
            assert!(!schema.is_valid(&json_of(text)), "{text}");
        }
    }

    /// Whatever the schema says of a number is what the parser says, on either side; and nothing is left unsaid but what
    /// depends on other keys.
    #[test]
    fn every_key_has_a_meaning_and_every_number_its_range() {
        fn walk(schema: &Value, path: &str, tried: &mut usize) {
            for (key, schema) in schema["properties"].as_object().unwrap() {
                let path = format!("{path}{key}");
                if schema["properties"].is_object() {
                    walk(schema, &format!("{path}."), tried);
                    continue;
                }
                assert!(schema["description"].is_string(), "{path} is not explained");
                for (bound, by) in [("minimum", -1.0), ("maximum", 1.0)] {
                    if let Some(bound) = schema[bound].as_f64() {
                        let beyond = match schema["type"] == "integer" {
                            true => format!("{}", i128::from(bound as i64) + by as i128),
                            false => format!("{:?}", bound + by),
                        };
                        assert!(refused(&path, &beyond).is_some(), "{path} takes {beyond}");
                        *tried += 1;
                    }
                }
                let is_number = ["integer", "number"].contains(&schema["type"].as_str().unwrap_or_default());
                let is_bounded = schema["maximum"].is_number() || schema["exclusiveMinimum"].is_number();
                let depends = DEPENDENT.contains(&path.as_str());
                assert!(
                    !is_number || is_bounded || depends,
                    "{path} has no range: {schema}"
                );
            }
        }
        let mut tried = 0;
        walk(&schema(), "", &mut tried);
        assert!(tried > 150, "only {tried} bounds");
    }
}
