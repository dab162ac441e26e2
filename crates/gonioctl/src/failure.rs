use std::error::Error;
use std::path::PathBuf;

use api::ClientError;
use firmware_sim::SimError;
use rig::RigError;
use serde::Serialize;
use serde_json::json;
use session::{SessionError, Status};
use sweep::SweepError;

use crate::{document, exit};

/// Why a command failed, for machines.
#[derive(Debug, Default, PartialEq, Serialize)]
pub(crate) struct Failure {
    /// What is to blame.
    kind: &'static str,
    /// All of it in words.
    message: String,
    #[serde(flatten)]
    place: Place,
    /// What can be done, where that is known beyond the message.
    #[serde(skip_serializing_if = "Option::is_none")]
    remedy: Option<String>,
    /// The exit code.
    exit_status: u8,
}

/// Where what is to blame stands.
#[derive(Debug, Default, PartialEq, Serialize)]
struct Place {
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<PathBuf>,
    #[serde(skip_serializing_if = "Option::is_none")]
    line: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    key: Option<String>,
}

impl Failure {
    /// Of arguments that are none.
    pub(crate) fn of_arguments(message: &str) -> Self {
        Self {
            kind: "arguments",
            message: message.to_owned(),
            exit_status: Status::Invalid.code(),
            ..Self::default()
        }
    }

    /// Of an error, and the exit status that it leads to.
    pub(crate) fn of(error: &anyhow::Error) -> (Self, Status) {
        let (status, message) = exit::failure(error);
        let kind = match status {
            // Nothing fails with the first two.
            Status::Done | Status::Above | Status::Invalid => "input",
            Status::Rig => "rig",
            Status::Stopped => "stopped",
            Status::Daemon => "daemon",
            Status::Unusable => "unusable",
        };
        let failure = Self {
            kind,
            message,
            place: error.chain().find_map(place).unwrap_or_default(),
            remedy: error.chain().find_map(remedy),
            exit_status: status.code(),
        };
        (failure, status)
    }

    /// All of it in words.
    pub(crate) fn message(&self) -> &str {
        &self.message
    }

    /// Prints it as an object on a line of its own on stdout, where the command was asked for JSON: no reader of JSON gets
    /// nothing.
    pub(crate) fn tell_machines(&self) {
        let given = std::env::args_os().take_while(|argument| argument != "--");
        if given.into_iter().any(|argument| argument == "--json") {
            // Nobody is left to tell where stdout is gone.
            let _ = document::ERROR.print_line(&json!({ "error": self }));
        }
    }
}

impl Place {
    fn file(file: impl Into<PathBuf>) -> Self {
        Self {
            file: Some(file.into()),
            ..Self::default()
        }
    }

    fn key(self, key: impl Into<String>) -> Self {
        Self {
            key: Some(key.into()),
            ..self
        }
    }

    fn line(self, line: Option<usize>) -> Self {
        Self { line, ..self }
    }
}

/// Where one error of a chain says that something is wrong.
fn place(error: &(dyn Error + 'static)) -> Option<Place> {
    if let Some(error) = error.downcast_ref::<SessionError>() {
        return of_session(error);
    }
    if let Some(error) = error.downcast_ref::<RigError>() {
        return of_rig(error);
    }
    if let Some(error) = error.downcast_ref::<SweepError>() {
        return of_job(error);
    }
    match error.downcast_ref::<ClientError>()? {
        ClientError::TokenFile { path, .. }
        | ClientError::Authorities { path, .. }
        | ClientError::NoToken { path } => Some(Place::file(path)),
        _ => None,
    }
}

fn of_session(error: &SessionError) -> Option<Place> {
    match error {
        SessionError::Job(error) => of_job(error),
        SessionError::Rig(error) => of_rig(error),
        SessionError::Read { path, .. }
        | SessionError::Certificate { path, .. }
        | SessionError::Out { path, .. } => Some(Place::file(path)),
        SessionError::Uncertified { directory, .. } => Some(Place::file(directory)),
        SessionError::Port { file, .. } => Some(Place::file(file).key("bus.port")),
        SessionError::Sim { file, source } => {
            let place = Place::file(file);
            Some(match source {
                SimError::Value { key, .. } => place.key(format!("sim.{key}")),
                SimError::Specimen { .. } => place.key("sim.specimen"),
                _ => place.key("sim"),
            })
        }
        _ => None,
    }
}

fn of_rig(error: &RigError) -> Option<Place> {
    match error {
        RigError::Read { path, .. } => Some(Place::file(path)),
        RigError::Form { place, key, .. } => {
            let found = Place::file(&place.file).line(place.line);
            Some(match key {
                Some(key) => found.key(key),
                None => found,
            })
        }
        RigError::Value { place, key, .. } => Some(Place::file(&place.file).line(place.line).key(key)),
        _ => None,
    }
}

fn of_job(error: &SweepError) -> Option<Place> {
    match error {
        SweepError::File { file, line, key, .. } => Some(Place::file(file).line(*line).key(key)),
        SweepError::Unreachable { file, key, .. } => Some(Place::file(file).key(key)),
        _ => None,
    }
}

/// What one error of a chain says that can be done.
fn remedy(error: &(dyn Error + 'static)) -> Option<String> {
    let allowed = |key: &str, allowed: &str| Some(format!("give {key} one of what is allowed: {allowed}"));
    if session::is_disk_full(error) {
        return Some(
            "make room on the disk and go on with the run: gonioctl run --resume RUN_DIR".to_owned(),
        );
    }
    if let Some(SessionError::Rig(error)) = error.downcast_ref::<SessionError>() {
        return remedy(error.as_ref());
    }
    if let Some(SimError::Value {
        key, allowed: words, ..
    }) = error.downcast_ref::<SimError>()
    {
        return allowed(&format!("sim.{key}"), words);
    }
    if let Some(RigError::Value {
        key, allowed: words, ..
    }) = error.downcast_ref::<RigError>()
    {
        return allowed(key, words);
    }
    match error.downcast_ref::<ClientError>()? {
        ClientError::Unreachable { remedy, .. } if !remedy.is_empty() => {
            Some(remedy.trim_start_matches([';', ' ']).to_owned())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::Value;
    use session::RunRequest;

    use super::*;

    fn told(job: &str, rig: &str) -> Value {
        let error = RunRequest::parse(job.to_owned(), "job.toml", rig.to_owned(), "rig.toml".as_ref());
        let (failure, status) = Failure::of(&error.unwrap_err().into());
        assert_eq!(status, Status::Invalid);
        serde_json::to_value(failure).unwrap()
    }

    const JOB: &str = "[[plane]]\ntheta_r_deg = 45.0\nreadings = 6\n";

    #[test]
    fn what_is_wrong_in_a_file_is_told_by_file_line_and_key() {
        for (job, rig, file, line, key) in [
            (
                "[[plane]]\ntheta_r_deg = 89.0\nreadings = 10\n",
                "",
                "job.toml",
                2,
                "plane[0].theta_r_deg",
            ),
            ("speciment = 'x'\n", "", "job.toml", 1, "speciment"),
            (JOB, "[motion]\nsettle = 20\n", "rig.toml", 2, "motion.settle"),
            (JOB, "\n[light]\nmin_deg = -95\n", "rig.toml", 3, "light.min_deg"),
        ] {
            let told = told(job, rig);
            assert_eq!(told["file"], file, "{told}");
            assert_eq!(told["line"], line, "{told}");
            assert_eq!(told["key"], key, "{told}");
            assert_eq!(told["kind"], "input", "{told}");
            assert_eq!(told["exit_status"], 2, "{told}");
        }
        let told = told(JOB, "\n[light]\nmin_deg = -95\n");
        assert!(told["remedy"].as_str().unwrap().contains("-90 … 90"), "{told}");
    }

    proptest! {
        /// Whatever is wrong in whichever file: the object is of its schema.
        #[test]
        fn prop_every_failure_is_of_its_schema(job in any::<String>(), rig in any::<String>(), arguments in any::<bool>()) {
            let schema = jsonschema::draft202012::new(&document::ERROR.schema()).unwrap();
            let failure = match (arguments, RunRequest::parse(job.clone(), &job, rig.clone(), rig.as_ref())) {
                (false, Err(error)) => Failure::of(&error.into()).0,
                _ => Failure::of_arguments(&job),
            };
            let object = json!({ "schema": "error/1", "error": failure });
            prop_assert!(schema.is_valid(&object), "{object}");
        }
    }
}
