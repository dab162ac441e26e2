use std::time::{Duration, Instant};

use goniod::Job;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use crate::print;
use crate::progress::clock;

/// Without a terminal, progress is printed at most so often.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// Shows what a daemon tells: on a terminal a bar with the rig's state, and lines above it for what is worth
/// remembering; elsewhere lines; for machines every event as a line of JSON.
pub(crate) struct Screen {
    bar: ProgressBar,
    as_json: bool,
    printed: Option<Instant>,
    /// The line that was printed last, so that nothing is said twice.
    said: String,
}

impl Screen {
    pub(crate) fn new(as_json: bool) -> Self {
        let style = ProgressStyle::with_template("{prefix:>13} [{bar:24}] {pos}/{len}  {wide_msg}")
            .expect("the template is a constant")
            .progress_chars("=> ");
        // Hidden by itself where stderr is no terminal.
        let bar = if as_json {
            ProgressBar::hidden()
        } else {
            ProgressBar::new(0).with_style(style)
        };
        Self {
            bar,
            as_json,
            printed: None,
            said: String::new(),
        }
    }

    /// Shows an event or a picture of the rig.
    pub(crate) fn show(&mut self, event: &Value) {
        let Some(kind) = event["event"].as_str() else {
            return self.rig(event);
        };
        if self.as_json {
            // A reader that went away ends us with the next event.
            let _ = print::line(event);
            return;
        }
        match kind {
            "progress" => self.progress(&event["progress"]),
            "activity" => self.bar.set_prefix(text(&event["activity"]).replace('_', " ")),
            _ => {
                if let Some(line) = line(event) {
                    self.say(&line);
                }
            }
        }
    }

    /// Shows how a job stands.
    pub(crate) fn job(&mut self, job: &Job) {
        if self.as_json {
            let _ = print::line(json!({ "event": "job", "job": job }));
            return;
        }
        self.say(&told(
            job.id,
            &job.specimen,
            &job.state.to_string(),
            job.why.as_deref(),
        ));
    }

    /// Says something, above the bar where there is one.
    pub(crate) fn say(&mut self, line: &str) {
        if self.said != line {
            line.clone_into(&mut self.said);
            self.bar.suspend(|| print::say(line));
        }
    }

    /// Takes the bar off the terminal.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn rig(&mut self, rig: &Value) {
        if self.as_json {
            return;
        }
        self.bar.set_prefix(text(&rig["activity"]).replace('_', " "));
        self.bar.set_message(status(rig));
        if let Some(progress) = rig.get("progress").filter(|progress| !progress.is_null()) {
            self.progress(progress);
        }
        if let Some(fault) = rig.get("fault").filter(|fault| !fault.is_null()) {
            let line = fault_line(fault);
            self.say(&line);
        }
    }

    fn progress(&mut self, progress: &Value) {
        let (done, of) = (progress["done"].as_u64(), progress["of"].as_u64());
        let (Some(done), Some(of)) = (done, of) else {
            return;
        };
        self.bar.set_length(of);
        self.bar.set_position(done);
        if self.bar.is_hidden() && self.printed.is_none_or(|at| at.elapsed() >= LINE_EVERY) {
            self.printed = Some(Instant::now());
            let left = clock(progress["seconds_left"].as_f64().unwrap_or_default());
            print::say(format_args!("{done} of {of} readings, {left} of rig time left"));
        }
    }
}

/// An event that is worth a line.
fn line(event: &Value) -> Option<String> {
    Some(match event["event"].as_str()? {
        "job" => {
            let job = &event["job"];
            let state = text(&job["state"]).replace('_', " ");
            told(
                text(&job["id"]),
                text(&job["specimen"]),
                &state,
                job["why"].as_str(),
            )
        }
        "repeat" => format!(
            "step {} measured again: {:+.2} % against before",
            event["step"],
            100.0 * event["difference_rel"].as_f64().unwrap_or(f64::NAN)
        ),
        "warning" => format!("warning: {}", text(&event["text"])),
        "fault" => fault_line(&event["fault"]),
        "acknowledged" => format!("fault acknowledged by {}", text(&event["by"])),
        "gap" => "some events were missed".to_owned(),
        _ => return None,
    })
}

fn told(id: impl std::fmt::Display, specimen: &str, state: &str, why: Option<&str>) -> String {
    let why = why.map(|why| format!(" ({why})")).unwrap_or_default();
    format!("{id} {specimen}: {state}{why}")
}

fn fault_line(fault: &Value) -> String {
    format!(
        "FAULT {}: {}; `gonioctl acknowledge` once it is looked at",
        text(&fault["code"]),
        text(&fault["text"])
    )
}

/// The rig in a line: angles, lamp, temperature, time left.
fn status(rig: &Value) -> String {
    if rig["connected"] == false {
        return rig["trouble"].as_str().unwrap_or("not connected yet").to_owned();
    }
    let mut parts = Vec::new();
    for (i, arm) in ["light", "sensor"].into_iter().enumerate() {
        if let Some(angle) = rig["arms"][i]["measured_deg"].as_f64() {
            parts.push(format!("{arm} {angle:+.2}°"));
        }
    }
    let lamp = match (rig["lamp"].as_bool(), rig["lamp_monitor"].as_f64()) {
        (Some(true), Some(output)) => format!("lamp {:.1} %", 100.0 * output),
        (Some(true), None) => "lamp on".to_owned(),
        _ => "lamp off".to_owned(),
    };
    parts.push(lamp);
    if let Some(temperature) = rig["temperature_c"].as_u64() {
        parts.push(format!("{temperature} °C"));
    }
    if let Some(left) = rig["progress"]["seconds_left"].as_f64() {
        parts.push(format!("{} left", clock(left)));
    }
    parts.join("  ")
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_worth_remembering_is_a_line() {
        let job = json!({"event": "job", "job": {"id": "01K", "specimen": "gold", "state": "awaiting_specimen", "why": null}});
        assert_eq!(line(&job).unwrap(), "01K gold: awaiting specimen");
        let fault = json!({"event": "fault", "fault": {"code": "no_reply", "text": "light servo is silent"}});
        assert!(
            line(&fault)
                .unwrap()
                .starts_with("FAULT no_reply: light servo is silent; `gonioctl acknowledge`")
        );
        let repeat = json!({"event": "repeat", "step": 3, "difference_rel": -0.0123});
        assert_eq!(
            line(&repeat).unwrap(),
            "step 3 measured again: -1.23 % against before"
        );
        assert_eq!(line(&json!({"event": "reading", "run": "01K"})), None);
        assert_eq!(
            line(&json!({"event": "of tomorrow"})),
            None,
            "a newer daemon is understood as far as can be"
        );
    }

    #[test]
    fn the_rig_fits_a_line() {
        let rig = json!({
            "connected": true, "activity": "running", "lamp": true, "lamp_monitor": 0.998, "temperature_c": 25,
            "arms": [{"measured_deg": -45.0}, {"measured_deg": 45.004}], "progress": {"seconds_left": 61.0},
        });
        assert_eq!(
            status(&rig),
            "light -45.00°  sensor +45.00°  lamp 99.8 %  25 °C  1 min 01 s left"
        );
        let away = json!({"connected": false, "trouble": "the serial port is gone"});
        assert_eq!(status(&away), "the serial port is gone");
    }
}
