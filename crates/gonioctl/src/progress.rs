use std::time::{Duration, Instant};

use capture::{Event, State};
use indicatif::{ProgressBar, ProgressStyle};

/// Without a terminal, a line is printed at most so often.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// Shows how a capture goes on: a bar on a terminal, a line now and then elsewhere; on stderr.
pub(crate) struct Progress {
    bar: ProgressBar,
    begun: Instant,
    printed: Instant,
    /// Steps that were done and rig seconds that were left when it began.
    first: Option<(usize, f64)>,
}

impl Progress {
    pub(crate) fn new() -> Self {
        let style = ProgressStyle::with_template("{prefix:>10} [{bar:30}] {pos}/{len}  {msg}")
            .expect("the template is a constant")
            .progress_chars("=> ");
        // Hidden by itself where stderr is no terminal.
        let bar = ProgressBar::new(0).with_style(style);
        let now = Instant::now();
        Self {
            bar,
            begun: now,
            printed: now,
            first: None,
        }
    }

    /// Shows an event.
    pub(crate) fn show(&mut self, event: &Event) {
        match event {
            Event::State { state } => self.bar.set_prefix(word(*state)),
            Event::Suspended { why } => self.bar.suspend(|| terminal::say(format_args!("holding: {why}"))),
            Event::Step { sweep, .. } => self.bar.set_prefix(sweep.to_string()),
            Event::Progress {
                done,
                of,
                seconds_left,
                retries,
            } => self.advance(*done, *of, *seconds_left, *retries),
            _ => {}
        }
    }

    fn advance(&mut self, done: usize, of: usize, rig_left_s: f64, retries: u32) {
        let (first_done, first_left_s) = *self.first.get_or_insert((done, rig_left_s));
        let wall_s = self.begun.elapsed().as_secs_f64();
        let taken = (done - first_done.min(done)) as f64;
        let rig_s = first_left_s - rig_left_s;
        let mut text = format!("{:.1} readings/s", taken / wall_s.max(1e-3));
        if rig_s > 0.0 {
            // A simulated rig's seconds pass faster than ours.
            text += &format!(", {} left", clock(rig_left_s * wall_s / rig_s));
        }
        if retries > 0 {
            text += &format!(", {retries} retries");
        }
        if self.bar.is_hidden() {
            if self.printed.elapsed() >= LINE_EVERY {
                self.printed = Instant::now();
                terminal::say(format_args!("{done} of {of} readings, {text}"));
            }
            return;
        }
        self.bar.set_length(of as u64);
        self.bar.set_position(done as u64);
        self.bar.set_message(text);
    }

    /// Takes the bar off the terminal.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn word(state: State) -> &'static str {
    match state {
        State::Identifying => "identify",
        State::Engaging => "engage",
        State::WarmingUp => "warm up",
        State::Running => "run",
        State::Paused => "paused",
        State::Suspended => "suspended",
        State::ShuttingDown => "shut down",
        State::Parking => "park",
    }
}

/// Seconds as minutes and seconds.
pub(crate) fn clock(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s:02} s"),
        (h, m, _) => format!("{h} h {m:02} min"),
    }
}

#[cfg(test)]
mod tests {
    use super::clock;

    #[test]
    fn times_are_short_and_round() {
        assert_eq!(clock(0.4), "0 s");
        assert_eq!(clock(59.6), "1 min 00 s");
        assert_eq!(clock(3725.0), "1 h 02 min");
        assert_eq!(clock(f64::NAN), "0 s");
    }
}
