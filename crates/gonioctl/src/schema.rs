//! JSON Schemas of what is read and printed.

use anyhow::Context;
use serde_json::{Value, json};

use crate::document::DOCUMENTS;

mod rig_file;

/// The dialect of every schema.
pub(crate) const DIALECT: &str = "https://json-schema.org/draft/2020-12/schema";

/// The daemon's OpenAPI document, whose schemas are JSON Schemas; tests of goniod keep it as its types and parsers are.
const OPENAPI: &str = include_str!("../../goniod/openapi.json");
/// Where schemas stand in it.
const COMPONENTS: &str = "#/components/schemas/";

/// Every name of which there is a schema.
pub(crate) fn names() -> Vec<&'static str> {
    let printed = DOCUMENTS.iter().map(|document| document.name);
    ["job", "rig"].into_iter().chain(printed).collect()
}

/// Prints the schema of a job file, a rig file, or of something that a command prints with `--json`.
///
/// # Errors
/// Stdout refuses.
pub(crate) fn schema(name: &str) -> anyhow::Result<()> {
    let document = DOCUMENTS.iter().find(|document| document.name == name);
    let schema = match (name, document) {
        ("job", _) => job_file(),
        ("rig", _) => rig_file::schema(),
        (_, Some(document)) => document.schema(),
        _ => return Err(anyhow::anyhow!("there are {}", names().join(", "))).context("no such schema"),
    };
    Ok(terminal::json(&schema)?)
}

/// The schema of a type of the daemon's document, with all that it needs.
pub(crate) fn of_daemon(name: &str) -> Value {
    let document: Value = serde_json::from_str(OPENAPI).expect("a test reads it");
    let mut needed = serde_json::Map::new();
    let mut open = vec![name.to_owned()];
    while let Some(name) = open.pop() {
        if needed.contains_key(&name) {
            continue;
        }
        let mut schema = document["components"]["schemas"][&name].clone();
        refer(&mut schema, &mut open);
        needed.insert(name, schema);
    }
    json!({ "$ref": format!("#/$defs/{name}"), "$defs": needed })
}

/// Has every reference of a schema point to `$defs`, and collects the names.
fn refer(schema: &mut Value, names: &mut Vec<String>) {
    match schema {
        Value::Object(object) => {
            for (key, value) in object {
                match (
                    key.as_str(),
                    value.as_str().and_then(|to| to.strip_prefix(COMPONENTS)),
                ) {
                    ("$ref", Some(name)) => {
                        names.push(name.to_owned());
                        *value = json!(format!("#/$defs/{name}"));
                    }
                    _ => refer(value, names),
                }
            }
        }
        Value::Array(array) => array.iter_mut().for_each(|value| refer(value, names)),
        _ => {}
    }
}

/// The schema of a job file: that of a job in JSON, and what only a file may say.
fn job_file() -> Value {
    let mut schema = of_daemon("JobFile");
    schema["$schema"] = json!(DIALECT);
    schema["$id"] = json!("urn:goniod:job-file:1");
    schema["title"] = json!("Job file of goniod");
    schema["$defs"]["JobFile"]["description"] =
        json!("What is to be measured. config/jobs/quickstart.toml explains every key.");
    schema["$defs"]["JobFile"]["properties"]["formats"]["uniqueItems"] = json!(true);
    let scene = &mut schema["$defs"]["SceneTable"]["properties"];
    for range in ["theta_i_deg", "theta_o_deg"] {
        scene[range]["items"] = json!({ "type": "number", "minimum": 0, "maximum": 90 });
    }
    let mut cells = scene["directions"].clone();
    cells["type"] = json!("array");
    cells["items"]["minItems"] = json!(5);
    cells["items"]["maxItems"] = json!(5);
    let about = cells["description"].clone();
    scene["directions"] = json!({
        "description": about,
        "anyOf": [cells, { "type": "string", "description": "The name of a file with the cells: EXR or CSV." }],
    });
    schema
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use sweep::Job;

    use super::*;

    fn validator(schema: &Value) -> jsonschema::Validator {
        jsonschema::draft202012::new(schema).unwrap()
    }

    fn json_of(text: &str) -> Value {
        serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap()
    }

    fn config() -> &'static Path {
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../config"))
    }

    #[test]
    fn every_shipped_job_is_one_by_the_schema() {
        let schema = validator(&job_file());
        let mut seen = 0;
        for entry in fs::read_dir(config().join("jobs")).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "toml") {
                let found = json_of(&fs::read_to_string(&path).unwrap());
                assert!(
                    schema.is_valid(&found),
                    "{}: {:?}",
                    path.display(),
                    schema.iter_errors(&found).next()
                );
                seen += 1;
            }
        }
        assert!(seen >= 6, "only {seen} jobs");
    }

    const JOB: &str = "[[plane]]\ntheta_r_deg = 45.0\nreadings = 6\n";

    #[test]
    fn what_is_no_job_is_none_by_the_schema() {
        let schema = validator(&job_file());
        assert!(schema.is_valid(&json_of(JOB)));
        for bad in [
            "speciment = \"x\"\n",
            "on_stage = \"yes\"\n",
            "formats = \"astm\"\n",
            "formats = [\"jpeg\"]\n[[plane]]\ntheta_r_deg = 45.0\nreadings = 6\n",
            "formats = [\"astm\", \"astm\"]\n[[plane]]\ntheta_r_deg = 45.0\nreadings = 6\n",
            "plane = 3\n",
            "[[plane]]\ntheta_r_deg = 45.0\n",
            "[[plane]]\ntheta_r_deg = 89.0\nreadings = 10\n",
            "[[plane]]\ntheta_r_deg = 70.0\nreadings = \"many\"\n",
            "[[plane]]\ntheta_r_deg = 70.0\nreadings = 0\n",
            "[[plane]]\ntheta_r_deg = 70.0\nreadings = 1.5\n",
            "[[plane]]\ntheta_r_deg = 70.0\nreadings = 10\ndistribution = \"even\"\n",
            "[arc]\nreadings = 10\noffset = 2.0\n",
            "[reconstruction]\nmodel = \"plane\"\n",
            "[sweep]\nmode = \"walk\"\n",
            "[sweep]\ntarget_male = 0.0\n",
            "[sweep]\nbudget_s = 1e6\n",
            "[scene]\nchannels = []\n",
            "[scene]\ntheta_i_deg = [0, 95]\n",
            "[scene]\ndirections = [[0, 10, 0, 10]]\n",
            "[scene]\nshare = 0\n",
        ] {
            assert!(Job::parse(bad, "job.toml").is_err(), "{bad}");
            assert!(!schema.is_valid(&json_of(bad)), "{bad}");
        }
    }

    /// Bounds of the schema are those of the parser: the number beyond is refused with them.
    #[test]
    fn bounds_of_a_job_are_those_of_the_parser() {
        let schema = job_file();
        let mut tried = 0;
        for (table, before) in [
            ("PlaneTable", "[[plane]]\n"),
            (
                "LegTable",
                "[[leg]]\nhalf_deg = [0, 9]\ndifference_deg = [20, 20]\n",
            ),
            ("ArcTable", "[arc]\n"),
            ("SceneTable", "[scene]\ndirections = [[0, 10, 0, 10, 1]]\n"),
            ("SweepTable", "[sweep]\n"),
        ] {
            for (key, property) in schema["$defs"][table]["properties"].as_object().unwrap() {
                let (Some(least), Some(most)) = (property["minimum"].as_f64(), property["maximum"].as_f64())
                else {
                    continue;
                };
                for beyond in [least - 1.0, most + 1.0] {
                    let missing = match (table, key.as_str()) {
                        ("PlaneTable", "readings") => "theta_r_deg = 1.0\n",
                        ("PlaneTable", _) => "readings = 2\n",
                        ("ArcTable", "offset") => "readings = 2\n",
                        ("SweepTable", "passes") => "mode = \"fly\"\n",
                        _ => "",
                    };
                    let planes = if table == "PlaneTable" { "" } else { JOB };
                    let job = format!("{before}{missing}{key} = {beyond}\n{planes}");
                    let why = Job::parse(&job, "job.toml").unwrap_err().to_string();
                    assert!(
                        why.contains(&format!("not within {least} … {most}")),
                        "{job}: {why}"
                    );
                    tried += 1;
                }
            }
        }
        assert_eq!(tried, 18, "two sides of nine keys");
    }
}
