//! What the parser of a rig file says may stand at a place of it.

use std::path::Path;
use std::sync::Arc;

use brdf::Black;
use firmware_sim::{Bench, WireSettings};
use rig::RigFile;
use serde_json::{Map, Value, json};

/// Keys whose range depends on other keys; on which; and those that must be set to something for them that is allowed then.
/// The schema has the widest range that any rig allows.
const DEPENDENT: [(&str, &[&str], &[&str]); 10] = [
    ("light.zero_deg", &["light.model"], &[]),
    ("light.velocity_deg_s", &["light.model", "light.gear"], &[]),
    (
        "light.acceleration_deg_s2",
        &["light.model", "light.gear"],
        &["light.velocity_deg_s"],
    ),
    ("sensor.zero_deg", &["sensor.model"], &[]),
    ("sensor.velocity_deg_s", &["sensor.model", "sensor.gear"], &[]),
    (
        "sensor.acceleration_deg_s2",
        &["sensor.model", "sensor.gear"],
        &["sensor.velocity_deg_s"],
    ),
    ("motion.park_light_deg", &["light.min_deg", "light.max_deg"], &[]),
    (
        "motion.park_sensor_deg",
        &["sensor.min_deg", "sensor.max_deg"],
        &[],
    ),
    (
        "photometer.integration_max_us",
        &["photometer.integration_min_us", "calibration.lamp"],
        &[],
    ),
    ("photometer.enough", &["photometer.full_scale"], &[]),
];
/// What the parser says of numbers that have no upper bound, and why they have none.
const ENDLESS: [(&str, &str); 3] = [
    (
        "> 0",
        "As large as one likes: counts are those of whatever photometer.",
    ),
    (
        "0 and more; hold 0",
        "As large as one likes: what no rig reaches never holds a run.",
    ),
    ("s and more", "As late and as long as one likes."),
];
/// A word that no key takes.
const NO_WORD: &str = "\"no such word\"";
/// A key that no table has.
const NO_KEY: &str = "no_such_key";

/// Why a rig file is refused.
pub(super) fn refusal(text: &str) -> Option<String> {
    let rig = match RigFile::parse(text, Path::new("rig file")) {
        Ok(rig) => rig,
        Err(error) => return Some(error.to_string()),
    };
    // What lies on the stage does not matter here.
    let bench = Bench::with_specimen(&rig, Arc::new(Black)).map(drop);
    let simulator = bench.and_then(|()| WireSettings::new(&rig).map(drop));
    simulator.err().map(|error| error.to_string())
}

/// A place where a value stands: a key, or one within the inline table that a key has.
pub(super) struct Place {
    /// The key.
    path: String,
    /// What stands before the value, and behind it.
    around: [String; 2],
    /// Other keys under which the parser is asked.
    contexts: Vec<String>,
}

impl Place {
    /// The place of a key, or of a table that has a header.
    pub(super) fn of(path: &str) -> Self {
        let dependent = DEPENDENT.iter().find(|(key, ..)| *key == path);
        let (others, beside) = dependent.map_or((&[][..], &[][..]), |(_, others, beside)| (*others, *beside));
        let mut contexts = vec![String::new()];
        for other in others {
            let extremes = Self::of(other).extremes();
            let with = |context: &String| -> Vec<String> {
                extremes
                    .iter()
                    .map(|value| format!("{context}{other} = {value}\n"))
                    .collect()
            };
            contexts = contexts.iter().flat_map(with).collect();
        }
        for other in beside {
            for context in &mut contexts {
                let least = &Self::under(other, vec![context.clone()]).number()["minimum"];
                *context += &format!("{other} = {least}\n");
            }
        }
        Self::under(path, contexts)
    }

    /// The place of a key beside other keys.
    fn under(path: &str, contexts: Vec<String>) -> Self {
        Self {
            path: path.to_owned(),
            around: [format!("{path} = "), "\n".to_owned()],
            contexts,
        }
    }

    /// The place of a key in an inline table that stands here, beside those of its other keys that are given.
    fn within(&self, key: &str, beside: &toml::Table) -> Self {
        let [before, after] = &self.around;
        let others = beside.iter().filter(|(other, _)| *other != key);
        let others: String = others
            .map(|(other, value)| format!("{other} = {value}, "))
            .collect();
        Self {
            path: self.path.clone(),
            around: [format!("{before}{{ {others}{key} = "), format!(" }}{after}")],
            contexts: self.contexts.clone(),
        }
    }

    /// The place of an element of an array that stands here.
    fn element(&self) -> Self {
        let [before, after] = &self.around;
        Self {
            path: self.path.clone(),
            around: [format!("{before}["), format!("]{after}")],
            contexts: self.contexts.clone(),
        }
    }

    /// What the parser says of a rig file with a value here, under each of the other keys.
    fn verdicts<'a>(&'a self, value: &'a str) -> impl Iterator<Item = Option<String>> + 'a {
        let [before, after] = &self.around;
        let contexts = self.contexts.iter();
        contexts.map(move |context| refusal(&format!("{before}{value}{after}{context}")))
    }

    /// Whether a refusal is of the value here, and not of one of the other keys.
    fn is_of_this(&self, why: &str) -> bool {
        self.contexts.len() == 1 || why.contains(&self.path)
    }

    /// What the parser says against a value here, under each of the other keys where it is this one that it refuses.
    fn refusals(&self, value: &str) -> Vec<String> {
        let whys = self.verdicts(value).flatten();
        whys.filter(|why| self.is_of_this(why)).collect()
    }

    /// What the parser says against a value here; `None` where any of the other keys lets it stand.
    pub(super) fn refused(&self, value: &str) -> Option<String> {
        let whys: Vec<String> = self.verdicts(value).collect::<Option<_>>()?;
        whys.into_iter().find(|why| self.is_of_this(why))
    }

    /// The keys of the table that stands here, as the parser names them where it does not know one.
    pub(super) fn keys(&self) -> Vec<String> {
        let why = match self.path.is_empty() {
            true => refusal(&format!("{NO_KEY} = 1\n")),
            false => self.refused(&format!("{{ {NO_KEY} = 1 }}")),
        };
        let why = why.unwrap_or_default();
        match why.contains(&format!("`{NO_KEY}`")) {
            true => quoted(&why, &["xpected "]),
            false => Vec::new(),
        }
    }

    /// The schema of what may stand here, of which this is an example; `elements` is one of the elements of an array that
    /// is empty.
    pub(super) fn schema(&self, example: &toml::Value, elements: Option<&toml::Value>) -> Value {
        match example {
            toml::Value::Boolean(_) => json!({ "type": "boolean" }),
            toml::Value::String(_) => self.word(),
            toml::Value::Table(table) => self.table(table),
            toml::Value::Array(array) if array.is_empty() => {
                let items = elements.map(|element| self.element().schema(element, None));
                json!({ "type": "array", "items": items.expect("a test reads the shipped file") })
            }
            toml::Value::Array(array) => self.numbers(array.len()),
            _ => self.number(),
        }
    }

    /// An inline table, of which this is an example.
    fn table(&self, example: &toml::Table) -> Value {
        let mut properties = Map::new();
        let mut required = Vec::new();
        for key in self.keys() {
            let place = self.within(&key, example);
            let schema = match example.get(&key) {
                Some(example) => place.schema(example, None),
                None => place.untold(),
            };
            let mut without = example.clone();
            if without.remove(&key).is_some() && self.refused(&without.to_inline()).is_some() {
                required.push(key.clone());
            }
            properties.insert(key, schema);
        }
        json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
    }

    /// What may stand here, of which nobody has an example: a table, or a number.
    fn untold(&self) -> Value {
        match self.keys().is_empty() {
            true => self.number(),
            false => self.table(&toml::Table::new()),
        }
    }

    /// A text: one of a few words where the parser says which, else any that is not empty. With some words there is a value
    /// to give, and some keys take numbers too.
    fn word(&self) -> Value {
        let allowed = self.refused(NO_WORD).unwrap_or_default();
        let words = quoted(&allowed, &["allowed: ", "xpected "]);
        if words.is_empty() {
            return match self.refused("\"\"") {
                Some(_) => json!({ "type": "string", "minLength": 1 }),
                None => json!({ "type": "string" }),
            };
        }
        if self.path.ends_with(".model") {
            // With or without the letter of its bus.
            return json!({ "type": "string", "pattern": format!("^({})(-[TR])?$", words.join("|")) });
        }
        let is_tag = |word: &String| {
            let why = self.refused(&format!("\"{word}\""));
            why.is_some_and(|why| why.contains("expected newtype variant"))
        };
        let (tags, words): (Vec<String>, Vec<String>) = words.into_iter().partition(is_tag);
        let words = json!({ "enum": words });
        if allowed.contains("or [") {
            return json!({ "anyOf": [words, self.numbers(2)] });
        }
        if let Some(range) = range(&allowed) {
            return json!({ "anyOf": [words, bounded("number", &range)] });
        }
        if tags.is_empty() {
            return words;
        }
        let values: Map<String, Value> = tags
            .into_iter()
            .map(|tag| {
                let schema = self.within(&tag, &toml::Table::new()).untold();
                (tag, schema)
            })
            .collect();
        let one = json!({
            "type": "object", "properties": values, "additionalProperties": false,
            "minProperties": 1, "maxProperties": 1,
        });
        json!({ "anyOf": [words, one] })
    }

    /// So many numbers.
    fn numbers(&self, length: usize) -> Value {
        let of = |value: f64| format!("{:?}", vec![value; length]);
        let why = self.refused(&of(-1.0)).unwrap_or_default();
        let items = endless(&why).unwrap_or_else(|| json!({ "type": "number" }));
        json!({ "type": "array", "items": items, "minItems": length, "maxItems": length })
    }

    /// A number, with the range that the parser tells of one that is too large, or too small.
    fn number(&self) -> Value {
        let whole = self
            .refusals("0.123")
            .iter()
            .any(|why| why.contains("invalid type: floating"));
        let kind = if whole { "integer" } else { "number" };
        let [low, high] = match whole {
            true => [i64::MIN.to_string(), i64::MAX.to_string()],
            false => ["-1e300".to_owned(), "1e300".to_owned()],
        };
        let whys = [self.refusals(&high), self.refusals(&low)].concat();
        if let Some(listed) = whys.first().and_then(|why| listed(why)) {
            return json!({ "enum": listed });
        }
        let mut ranges: Vec<[Value; 2]> = whys.iter().filter_map(|why| range(why)).collect();
        if whys.iter().any(|why| why.ends_with("expected u8")) {
            // What a byte holds, of which not all may be allowed.
            let most = self.refused(&u8::MAX.to_string()).unwrap_or_default();
            ranges.push(range(&most).unwrap_or_else(|| [json!(0), json!(u8::MAX)]));
        }
        let Some(widest) = widest(&ranges) else {
            let endless = whys.last().and_then(|why| endless(why));
            return endless.unwrap_or_else(|| json!({ "type": kind }));
        };
        let mut schema = bounded(kind, &widest);
        let odd = self.refused("1").unwrap_or_default();
        if let Some((_, step)) = odd.rsplit_once("in steps of ")
            && let Ok(step) = step.parse::<u32>()
        {
            schema["multipleOf"] = json!(step);
        }
        schema
    }

    /// The words that may stand here, or the bounds of the number that may.
    fn extremes(&self) -> Vec<String> {
        let words = quoted(&self.refused(NO_WORD).unwrap_or_default(), &["allowed: "]);
        if !words.is_empty() {
            return words.iter().map(|word| format!("\"{word}\"")).collect();
        }
        let schema = self.number();
        ["minimum", "maximum"]
            .map(|bound| schema[bound].to_string())
            .to_vec()
    }
}

/// A table as it stands in one line.
trait Inline {
    fn to_inline(&self) -> String;
}

impl Inline for toml::Table {
    fn to_inline(&self) -> String {
        toml::Value::Table(self.clone()).to_string()
    }
}

/// The words in quotation marks behind the first of some marks that is there.
fn quoted(why: &str, marks: &[&str]) -> Vec<String> {
    let after = marks.iter().find_map(|mark| why.split_once(mark));
    let words = after.map(|(_, listed)| listed.split(['"', '`']).skip(1).step_by(2));
    words.into_iter().flatten().map(str::to_owned).collect()
}

/// The whole numbers in a text such as "allowed: 1, -1".
fn listed(why: &str) -> Option<Vec<i64>> {
    let (_, listed) = why.rsplit_once("allowed: ")?;
    listed.split(", ").map(|word| word.parse().ok()).collect()
}

/// The bounds in a text such as "allowed: 0 … 100".
fn range(why: &str) -> Option<[Value; 2]> {
    let (_, allowed) = why.rsplit_once("allowed")?;
    let (before, after) = allowed.split_once(" … ")?;
    let number = |word: Option<&str>| -> Option<Value> {
        let word = word?.trim_end_matches(',');
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

/// The least and the largest bound of several ranges.
fn widest(ranges: &[[Value; 2]]) -> Option<[Value; 2]> {
    let order = |a: &&Value, b: &&Value| {
        let of = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
        of(a).total_cmp(&of(b))
    };
    let least = ranges.iter().map(|[least, _]| least).min_by(order)?;
    let most = ranges.iter().map(|[_, most]| most).max_by(order)?;
    Some([least.clone(), most.clone()])
}

fn bounded(kind: &str, [least, most]: &[Value; 2]) -> Value {
    json!({ "type": kind, "minimum": least, "maximum": most })
}

/// The schema of a number without an upper bound, by what the parser says of one that is too small.
fn endless(why: &str) -> Option<Value> {
    let (said, reason) = ENDLESS.iter().find(|(said, _)| why.contains(said))?;
    let least = if *said == "> 0" {
        "exclusiveMinimum"
    } else {
        "minimum"
    };
    Some(json!({ "type": "number", least: 0, "$comment": reason }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bound of a key that depends on others is one that some rig takes, and no rig takes more.
    #[test]
    fn some_rig_takes_the_bounds_of_a_key_that_depends_on_others_and_none_takes_more() {
        for (path, ..) in DEPENDENT {
            let place = Place::of(path);
            let schema = place.number();
            for (bound, beyond) in [("minimum", -1.0), ("maximum", 1.0)] {
                let is_whole = schema["type"] == "integer";
                let spell = |value: f64| {
                    if is_whole {
                        format!("{value:.0}")
                    } else {
                        format!("{value:?}")
                    }
                };
                let bound = schema[bound].as_f64().unwrap();
                let refused = place.refusals(&spell(bound)).len();
                assert!(refused < place.contexts.len(), "{path} {bound}");
                // A thousandth is what errors round to.
                let step = if is_whole { 1.0 } else { 2e-3 };
                assert!(
                    place.refused(&spell(bound + beyond * step)).is_some(),
                    "{path} {bound}"
                );
            }
        }
    }
}
