use sweep::Plan;

/// Seconds of plan that count like measured ones when the first measurements come in, against a jumpy start.
const PRIOR_S: f64 = 2.0;

/// How long a run still takes: the planned seconds of what is left, times how much slower or faster than planned the
/// rig has been in this execution. Times are the photometer's.
#[derive(Clone, Debug)]
pub(crate) struct Progress {
    /// Planned seconds of the steps of this execution that are done.
    planned_s: f64,
    /// Planned seconds of the steps that are not.
    left_s: f64,
    /// Measured seconds that the former took.
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
        let left_s = warm_up_s + left().map(|step| step.seconds).sum::<f64>();
        Self {
            planned_s: 0.0,
            left_s,
            measured_s: 0.0,
        }
    }

    /// A step, or the warm-up, is done that was planned to take `planned_s` and took `measured_s`.
    pub(crate) fn step(&mut self, planned_s: f64, measured_s: f64) {
        self.planned_s += planned_s;
        self.left_s -= planned_s;
        self.measured_s += measured_s;
    }

    /// Seconds still needed.
    pub(crate) fn seconds_left(&self) -> f64 {
        self.left_s.max(0.0) * (self.measured_s + PRIOR_S) / (self.planned_s + PRIOR_S)
    }
}
