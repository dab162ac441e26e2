use super::Taken;

/// How the lamp's output is followed during a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lamp {
    /// By the monitor, in each reading.
    Monitor,
    /// By visits to the reference pose, between which the output is taken to drift evenly. For a rig without monitor.
    Visits,
}

/// The lamp's output over a run, relative to that of the first visit to the reference pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drift {
    /// Time of a visit, s, its level and the standard uncertainty of that; ascending.
    visits: Vec<(f64, f64, f64)>,
}

impl Drift {
    /// From what a visit each said: readings at the reference pose with their signal (any unit) and its relative
    /// standard uncertainty, in the order of their time. Without a visit, the lamp is taken to be steady.
    pub(crate) fn new(visits: impl IntoIterator<Item = (Taken, f64, f64)>) -> Self {
        let mut visits: Vec<(f64, f64, f64)> = visits
            .into_iter()
            .filter(|(_, signal, _)| *signal > 0.0)
            .map(|(taken, signal, u)| (taken.time_s, signal, u * signal))
            .collect();
        if let Some(&(_, first, _)) = visits.first() {
            for visit in &mut visits {
                visit.1 /= first;
                visit.2 /= first;
            }
        }
        Self { visits }
    }

    /// Levels of the visits, in the order of their time.
    pub(crate) fn levels(&self) -> impl Iterator<Item = f64> {
        self.visits.iter().map(|visit| visit.1)
    }

    /// Level at a time, s, and its standard uncertainty: that of the visits, and a quarter of the step between two of
    /// them as the half width of a rectangle, since nobody saw what was between.
    pub(crate) fn level(&self, time_s: f64) -> (f64, f64) {
        let after = self.visits.partition_point(|visit| visit.0 <= time_s);
        let before = after.checked_sub(1).and_then(|i| self.visits.get(i));
        match (before, self.visits.get(after)) {
            (None, None) => (1.0, 0.0),
            (Some(only), None) | (None, Some(only)) => (only.1, only.2),
            (Some(a), Some(b)) => {
                let share = (time_s - a.0) / (b.0 - a.0);
                let level = a.1 + share * (b.1 - a.1);
                let visits = ((1.0 - share) * a.2).powi(2) + (share * b.2).powi(2);
                let bend = ((b.1 - a.1) / 4.0).powi(2) / 3.0;
                (level, (visits + bend).sqrt())
            }
        }
    }
}
