use sweep::{Plan, Step, Sweep};

/// Seconds of plan that count like measured ones, against a jumpy start.
const PRIOR_S: f64 = 5.0;

/// How long a run still takes: the planned seconds of what is left of each sweep, times how much slower or faster
/// than planned that sweep has been in this execution. One sweep says little of the next, whose light may be weaker
/// and its exposures longer. Times are the photometer's.
#[derive(Clone, Debug)]
pub(crate) struct Progress {
    /// Warm-up still to come, s.
    warm_up_s: f64,
    /// The last look at the dark, s.
    closing_s: f64,
    sweeps: Vec<(Sweep, Pace)>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Pace {
    /// Planned seconds of the steps that are not done.
    left_s: f64,
    /// Planned seconds of the steps done in this execution.
    planned_s: f64,
    /// Measured seconds that these took.
    measured_s: f64,
}

impl Progress {
    pub(crate) fn new(plan: &Plan, done: impl Fn(usize) -> bool) -> Self {
        let left = || plan.steps.iter().filter(|step| !done(step.index));
        let warm_up_s = if left().any(|step| step.lamp) {
            plan.overhead_s
        } else {
            0.0
        };
        let mut progress = Self {
            warm_up_s,
            closing_s: plan.closing_s,
            sweeps: Vec::new(),
        };
        left().for_each(|step| progress.pace(step.sweep).left_s += step.seconds);
        progress
    }

    /// Steps were added to the plan.
    pub(crate) fn extend(&mut self, steps: &[Step]) {
        for step in steps {
            self.pace(step.sweep).left_s += step.seconds;
        }
    }

    /// The lamp is warm.
    pub(crate) fn warm(&mut self) {
        self.warm_up_s = 0.0;
    }

    /// The dark was looked at for the last time.
    pub(crate) fn closed(&mut self) {
        self.closing_s = 0.0;
    }

    /// A step is done that was planned to take `planned_s` and took `measured_s`.
    pub(crate) fn step(&mut self, sweep: Sweep, planned_s: f64, measured_s: f64) {
        let pace = self.pace(sweep);
        pace.left_s -= planned_s;
        pace.planned_s += planned_s;
        pace.measured_s += measured_s;
    }

    /// Seconds still needed.
    pub(crate) fn seconds_left(&self) -> f64 {
        let left = |(_, pace): &(Sweep, Pace)| {
            pace.left_s.max(0.0) * (pace.measured_s + PRIOR_S) / (pace.planned_s + PRIOR_S)
        };
        self.warm_up_s + self.closing_s + self.sweeps.iter().map(left).sum::<f64>()
    }

    fn pace(&mut self, sweep: Sweep) -> &mut Pace {
        let known = self.sweeps.iter().position(|(of, _)| *of == sweep);
        let i = known.unwrap_or_else(|| {
            self.sweeps.push((sweep, Pace::default()));
            self.sweeps.len() - 1
        });
        &mut self.sweeps[i].1
    }
}
