use std::path::PathBuf;

use serde_json::{Value, json};
use session::{Ended, Status};

use crate::eval;
use crate::progress::clock;

/// The last line about a run whose result must not be used, by the names of the checks that are bad.
pub(crate) fn not_usable<'a>(bad: impl IntoIterator<Item = &'a str>) -> String {
    let bad: Vec<&str> = bad.into_iter().collect();
    format!(
        "measured, but not usable: bad is the check of {}",
        bad.join(", of ")
    )
}

/// A run that has ended, as its files tell it; whoever captured it, the words are the same.
pub(crate) struct Closing {
    /// How the command ends.
    pub(crate) status: Status,
    /// Where everything is.
    pub(crate) directory: PathBuf,
    /// run.json; null where it could not be written.
    pub(crate) run: Value,
    /// report.json, likewise.
    pub(crate) report: Value,
    /// The command that goes on with it.
    pub(crate) again: String,
}

impl Closing {
    /// Of a run that this process captured.
    ///
    /// # Errors
    /// None is known: all of it was written as JSON before.
    pub(crate) fn of(ended: &Ended) -> serde_json::Result<Self> {
        let directory = ended.directory.path();
        Ok(Self {
            status: ended.status(),
            directory: directory.to_owned(),
            run: serde_json::to_value(&ended.report.run)?,
            report: serde_json::to_value(&ended.report)?,
            again: format!("gonioctl run --resume {}", directory.display()),
        })
    }

    /// The summary for machines.
    pub(crate) fn summary(&self, wall_s: f64) -> Value {
        let Self { run, report, .. } = self;
        json!({
            "id": run["id"],
            "state": run["state"],
            "exit_status": self.status.code(),
            "verdict": report["verdict"],
            "findings": self.findings().collect::<Vec<_>>(),
            "fault": run["fault"],
            "directory": self.directory,
            "rig_seconds": run["seconds"]["total"],
            "wall_seconds": wall_s,
            "readings": run["readings"],
            "retries": run["retries"],
            "flags": run["flags"],
            "errors": report["errors"],
            "adapted": report["adapted"],
        })
    }

    /// The checks that are not good, as report.json has them.
    fn findings(&self) -> impl Iterator<Item = &Value> {
        let checks = self.report["checks"].as_array().into_iter().flatten();
        checks.filter(|check| check["verdict"] != "good")
    }

    /// The summary for people.
    pub(crate) fn say(&self, wall_s: f64) {
        let Self { run, report, .. } = self;
        match self.status {
            Status::Done => terminal::say("done"),
            Status::Unusable => terminal::say("every step was measured"),
            Status::Stopped => terminal::say("interrupted: stopped; the readings so far are safe"),
            _ => terminal::say(format_args!(
                "interrupted: {}",
                run["fault"].as_str().unwrap_or("see above")
            )),
        }
        let rig_s = run["seconds"]["total"].as_f64().unwrap_or_default();
        terminal::say(format_args!(
            "rig time  {} ({rig_s:.1} s; what a real rig takes)",
            clock(rig_s)
        ));
        terminal::say(format_args!("wall time {wall_s:.1} s"));
        let readings = &run["readings"];
        terminal::say(format_args!(
            "readings  {} taken, {} of {} steps done, {} retries on the bus",
            readings["taken"], readings["accepted"], readings["planned"], run["retries"]
        ));
        for why in report["adapted"]["added"].as_array().into_iter().flatten() {
            terminal::say(format_args!("added     {}", why.as_str().unwrap_or_default()));
        }
        if let Some(why) = report["adapted"]["stopped"].as_str() {
            terminal::say(format_args!("ended     {why}"));
        }
        if !report["errors"].is_null() {
            terminal::say("errors against the simulated specimen");
            for line in eval::lines(&report["errors"]) {
                terminal::say(line);
            }
        }
        for export in report["exports"].as_array().into_iter().flatten() {
            let [format, file, text] =
                ["format", "file", "text"].map(|key| export[key].as_str().unwrap_or_default());
            match file {
                "" => terminal::say(format_args!("refused   {text}")),
                file => terminal::say(format_args!("{format:<9} {file}: {text}")),
            }
        }
        for check in self.findings() {
            let [verdict, name, text] =
                ["verdict", "name", "text"].map(|key| check[key].as_str().unwrap_or_default());
            terminal::say(format_args!("{verdict:<9} {name}: {text}"));
        }
    }

    /// The last line for people: what to do next, or why the result must not be used.
    pub(crate) fn say_last(&self) {
        match self.status {
            Status::Done => {}
            Status::Unusable => {
                let bad = self.findings().filter(|check| check["verdict"] == "bad");
                terminal::say(not_usable(bad.filter_map(|check| check["name"].as_str())));
            }
            _ => terminal::say(format_args!("go on with: {}", self.again)),
        }
    }
}
