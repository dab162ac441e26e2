use serde::Serialize;
use serde_json::{Value, json};

use crate::schema;

/// One kind of JSON that the commands print, with a version: its first number goes up when a reader must change.
///
/// Each such object says what it is in the key `schema`, such as `plan/1`, and `gonioctl schema plan` prints its schema.
pub(crate) struct Document {
    /// Its name.
    pub(crate) name: &'static str,
    /// Its version.
    version: u32,
    source: Source,
}

/// Where the schema of a document is written down.
enum Source {
    /// With the command line: a JSON Schema of the object without its key `schema`.
    Own(&'static str),
    /// In the daemon's OpenAPI document, under this name.
    Daemon(&'static str),
    /// Likewise, as a list under this key.
    DaemonList(&'static str, &'static str),
}

const fn own(name: &'static str, schema: &'static str) -> Document {
    Document {
        name,
        version: 1,
        source: Source::Own(schema),
    }
}

/// Why a command failed.
pub(crate) static ERROR: Document = own("error", include_str!("../schemas/error.json"));
/// Serial ports.
pub(crate) static PORTS: Document = own("ports", include_str!("../schemas/ports.json"));
/// What checks of a rig found.
pub(crate) static FINDINGS: Document = own("findings", include_str!("../schemas/findings.json"));
/// What a job would do.
pub(crate) static PLAN: Document = own("plan", include_str!("../schemas/plan.json"));
/// The key of a cache.
pub(crate) static PLAN_HASH: Document = own("plan-hash", include_str!("../schemas/plan-hash.json"));
/// How a run ended.
pub(crate) static RUN: Document = own("run", include_str!("../schemas/run.json"));
/// What a calibration came to.
pub(crate) static CALIBRATION: Document = own("calibration", include_str!("../schemas/calibration.json"));
/// Error metrics.
pub(crate) static METRICS: Document = own("metrics", include_str!("../schemas/metrics.json"));
/// What a campaign came to.
pub(crate) static CAMPAIGN: Document = own("campaign", include_str!("../schemas/campaign.json"));
/// What one script came to.
pub(crate) static REPLAY: Document = own("replay", include_str!("../schemas/replay.json"));
/// What a run says of itself.
pub(crate) static REPORT: Document = own("report", include_str!("../schemas/report.json"));
/// A job of the queue.
pub(crate) static QUEUED: Document = Document {
    name: "queued-job",
    version: 1,
    source: Source::Daemon("Job"),
};
/// The queue.
pub(crate) static QUEUE: Document = Document {
    name: "queue",
    version: 1,
    source: Source::DaemonList("jobs", "Job"),
};
/// A live picture of the rig.
pub(crate) static RIG_STATE: Document = Document {
    name: "rig-state",
    version: 1,
    source: Source::Daemon("RigView"),
};
/// Something that happened.
pub(crate) static EVENT: Document = Document {
    name: "event",
    version: 1,
    source: Source::Daemon("What"),
};

/// Every kind of JSON that is printed.
pub(crate) static DOCUMENTS: [&Document; 15] = [
    &ERROR,
    &PORTS,
    &FINDINGS,
    &PLAN,
    &PLAN_HASH,
    &RUN,
    &CALIBRATION,
    &METRICS,
    &CAMPAIGN,
    &REPLAY,
    &REPORT,
    &QUEUED,
    &QUEUE,
    &RIG_STATE,
    &EVENT,
];

impl Document {
    /// Prints an object of this kind, indented.
    ///
    /// # Errors
    /// Stdout refuses.
    pub(crate) fn print(&self, value: &impl Serialize) -> std::io::Result<()> {
        terminal::json(&self.labelled(serde_json::to_value(value)?))
    }

    /// Prints an object of this kind in one line.
    ///
    /// # Errors
    /// Stdout refuses.
    pub(crate) fn print_line(&self, value: &impl Serialize) -> std::io::Result<()> {
        terminal::json_line(&self.labelled(serde_json::to_value(value)?))
    }

    /// What stands in the key `schema`.
    fn label(&self) -> String {
        format!("{}/{}", self.name, self.version)
    }

    fn labelled(&self, mut value: Value) -> Value {
        if let Some(object) = value.as_object_mut() {
            object.insert("schema".to_owned(), json!(self.label()));
        }
        value
    }

    /// The JSON Schema (2020-12) of this kind.
    pub(crate) fn schema(&self) -> Value {
        let mut schema = match self.source {
            Source::Own(text) => serde_json::from_str(text).expect("a test reads every schema"),
            Source::Daemon(name) => schema::of_daemon(name),
            Source::DaemonList(key, name) => {
                let mut schema = schema::of_daemon(name);
                schema["properties"] =
                    json!({ key: { "type": "array", "items": { "$ref": schema["$ref"] } } });
                schema["required"] = json!([key]);
                schema.as_object_mut().expect("it is one").remove("$ref");
                schema
            }
        };
        schema["$schema"] = json!(schema::DIALECT);
        schema["$id"] = json!(format!("urn:goniod:{}:{}", self.name, self.version));
        schema["type"] = json!("object");
        let label = json!({ "const": self.label(), "description": "What this is, and its version." });
        let kinds = schema.get_mut("oneOf").and_then(Value::as_array_mut);
        match kinds {
            Some(kinds) => kinds.iter_mut().for_each(|kind| require(kind, &label)),
            None => require(&mut schema, &label),
        }
        schema
    }
}

/// Has a schema of an object ask for the label too.
fn require(schema: &mut Value, label: &Value) {
    schema["properties"]["schema"] = label.clone();
    match schema["required"].as_array_mut() {
        Some(required) => required.insert(0, json!("schema")),
        None => schema["required"] = json!(["schema"]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_schema_is_one_that_a_validator_takes() {
        for document in DOCUMENTS {
            let schema = document.schema();
            let made = jsonschema::draft202012::new(&schema);
            assert!(made.is_ok(), "{}: {:?}", document.name, made.err());
            assert!(
                !made.unwrap().is_valid(&json!({})),
                "{}: an object without a label is of no kind",
                document.name
            );
        }
    }

    #[test]
    fn no_two_kinds_have_one_name() {
        let mut names: Vec<_> = DOCUMENTS.iter().map(|document| document.name).collect();
        names.extend(["job", "rig"]);
        names.sort_unstable();
        let all = names.len();
        names.dedup();
        assert_eq!(names.len(), all);
    }
}
