use std::time::{Duration, Instant};

use api::client::{Message, ServerSentEvent};
use api::{FaultView, Job, Progress, RigView, VerdictView, What};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use terminal::Printable;

use crate::document;
use crate::progress::clock;

/// Without a terminal, progress is printed at most so often.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// What is added to the state of a job whose result must not be used.
const NOT_USABLE: &str = ", measured but not usable: the report in its run directory says why";

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
    pub(crate) fn show(&mut self, event: &ServerSentEvent, message: &Message) {
        match message {
            Message::Rig(rig) => self.rig(rig),
            _ if self.as_json => {
                // A reader that went away ends us with the next event.
                let _ = match serde_json::from_str::<Value>(&event.data) {
                    Ok(data) => document::EVENT.print_line(&data),
                    Err(_) => terminal::line(&event.data),
                };
            }
            Message::Event(event) => self.event(&event.what),
            Message::Unknown => tracing::debug!(event.data, "an event of a newer daemon"),
        }
    }

    fn event(&mut self, what: &What) {
        match what {
            What::Progress { progress } => self.progress(progress),
            What::Activity { activity } => self.bar.set_prefix(Printable(activity).to_string()),
            _ => {
                if let Some(line) = line(what) {
                    self.say(&line);
                }
            }
        }
    }

    /// Shows how a job stands.
    pub(crate) fn job(&mut self, job: &Job) {
        if self.as_json {
            let _ = document::EVENT.print_line(&json!({ "event": "job", "job": job }));
            return;
        }
        self.say(&job_line(job));
    }

    /// Says something, above the bar where there is one.
    pub(crate) fn say(&mut self, line: &str) {
        if self.said != line {
            line.clone_into(&mut self.said);
            self.bar.suspend(|| terminal::say(line));
        }
    }

    /// Takes the bar off the terminal.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn rig(&mut self, rig: &RigView) {
        if self.as_json {
            return;
        }
        self.bar.set_prefix(Printable(rig.activity).to_string());
        self.bar.set_message(Printable(status(rig)).to_string());
        if let Some(progress) = &rig.progress {
            self.progress(progress);
        }
        if let Some(fault) = &rig.fault {
            self.say(&fault_line(fault));
        }
    }

    fn progress(&mut self, progress: &Progress) {
        let Progress {
            done,
            of,
            seconds_left,
            ..
        } = *progress;
        self.bar.set_length(of as u64);
        self.bar.set_position(done as u64);
        if self.bar.is_hidden() && self.printed.is_none_or(|at| at.elapsed() >= LINE_EVERY) {
            self.printed = Some(Instant::now());
            let left = clock(seconds_left);
            terminal::say(format_args!("{done} of {of} readings, {left} of rig time left"));
        }
    }
}

/// An event that is worth a line.
fn line(what: &What) -> Option<String> {
    Some(match what {
        What::Job { job } => job_line(job),
        What::Repeat { step, difference_rel } => format!(
            "step {step} measured again: {:+.2} % against before",
            100.0 * difference_rel
        ),
        What::Warning { text } => format!("warning: {text}"),
        What::Fault { fault } => fault_line(fault),
        What::Acknowledged { by, id } => format!("fault {id} acknowledged by {by}"),
        What::Gap => "some events were missed".to_owned(),
        _ => return None,
    })
}

fn job_line(job: &Job) -> String {
    let why = job
        .why
        .as_ref()
        .map(|why| format!(" ({why})"))
        .unwrap_or_default();
    let verdict = match job.verdict {
        Some(VerdictView::Bad) => NOT_USABLE,
        _ => "",
    };
    format!("{} {}: {}{verdict}{why}", job.id, job.specimen, job.state)
}

fn fault_line(fault: &FaultView) -> String {
    format!(
        "FAULT {}: {}; `gonioctl acknowledge` once it is looked at",
        fault.code, fault.text
    )
}

/// The rig in a line: angles, lamp, temperature, time left.
fn status(rig: &RigView) -> String {
    if !rig.connected {
        let trouble = rig.trouble.as_deref();
        return trouble.unwrap_or("not connected yet").to_owned();
    }
    let mut parts = Vec::new();
    for (name, arm) in ["light", "sensor"].into_iter().zip(&rig.arms) {
        if let Some(angle_deg) = arm.measured_deg {
            parts.push(format!("{name} {angle_deg:+.2}°"));
        }
    }
    parts.push(match (rig.lamp, rig.lamp_monitor) {
        (true, Some(output)) => format!("lamp {:.1} %", 100.0 * output),
        (true, None) => "lamp on".to_owned(),
        _ => "lamp off".to_owned(),
    });
    if let Some(temperature_c) = rig.temperature_c {
        parts.push(format!("{temperature_c} °C"));
    }
    if let Some(progress) = &rig.progress {
        parts.push(format!("{} left", clock(progress.seconds_left)));
    }
    parts.join("  ")
}

#[cfg(test)]
mod tests {
    use serde_json::from_value;

    use super::*;

    fn told(event: serde_json::Value) -> Option<String> {
        line(&from_value(event).unwrap())
    }

    #[test]
    fn what_is_worth_remembering_is_a_line() {
        let id = "01KAGN4Z7Q3X9V5T8R2M6C1D0B";
        let job = json!({"event": "job", "job": {
            "id": id, "place": 1, "name": "gold.toml", "specimen": "gold", "on_stage": false, "text": "",
            "state": "awaiting_specimen", "why": null, "run": null, "by": "", "submitted": "", "changed": "",
        }});
        assert_eq!(told(job).unwrap(), format!("{id} gold: awaiting specimen"));
        let bad = json!({"event": "job", "job": {
            "id": id, "place": 1, "name": "gold.toml", "specimen": "gold", "on_stage": false, "text": "",
            "state": "done", "verdict": "bad", "why": null, "run": "01", "by": "", "submitted": "", "changed": "",
        }});
        let bad = told(bad).unwrap();
        assert!(
            bad.starts_with(&format!("{id} gold: done, measured but not usable")),
            "{bad}"
        );
        let fault = json!({"code": "no_reply", "text": "light servo is silent", "at": "", "run": null});
        assert!(
            told(json!({"event": "fault", "fault": fault}))
                .unwrap()
                .starts_with("FAULT no_reply: light servo is silent; `gonioctl acknowledge`")
        );
        let repeat = json!({"event": "repeat", "step": 3, "difference_rel": -0.0123});
        assert_eq!(
            told(repeat).unwrap(),
            "step 3 measured again: -1.23 % against before"
        );
        assert_eq!(told(json!({"event": "activity", "activity": "running"})), None);
    }

    #[test]
    fn the_rig_fits_a_line() {
        let arm = |measured_deg: f64| {
            json!({"measured_deg": measured_deg, "goal_deg": null, "moving": false, "torque": true,
                "min_deg": -90.0, "max_deg": 90.0})
        };
        let rig = json!({
            "connected": true, "trouble": null, "activity": "running", "arms": [arm(-45.0), arm(45.004)],
            "separation_deg": 5.0, "can_pass": false, "lamp": true, "lamp_monitor": 0.998, "temperature_c": 25,
            "fault": null, "job": null, "run": null,
            "progress": {"done": 1, "of": 2, "seconds_left": 61.0, "retries": 0},
        });
        let mut rig: RigView = from_value(rig).unwrap();
        assert_eq!(
            status(&rig),
            "light -45.00°  sensor +45.00°  lamp 99.8 %  25 °C  1 min 01 s left"
        );
        rig.connected = false;
        rig.trouble = Some("the serial port is gone".to_owned());
        assert_eq!(status(&rig), "the serial port is gone");
    }
}
