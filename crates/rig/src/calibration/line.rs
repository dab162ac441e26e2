/// Counts in the dark over integration time: offset + rate · t, with the variance of what the line says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Line {
    /// Counts.
    pub(super) offset: f64,
    /// Counts per µs.
    pub(super) rate: f64,
    /// Mean integration time of the readings, µs.
    mean_t: f64,
    /// Sum of the squared distances from it, µs².
    spread: f64,
    /// Readings.
    n: f64,
    /// Variance of one reading, counts².
    variance: f64,
}

impl Line {
    /// Least squares through (t in µs, counts); of a single integration time, all is offset.
    pub(super) fn fit(points: &[(f64, f64)]) -> Option<Self> {
        if points.is_empty() {
            return None;
        }
        let n = points.len() as f64;
        let mean_t = points.iter().map(|p| p.0).sum::<f64>() / n;
        let mean_c = points.iter().map(|p| p.1).sum::<f64>() / n;
        let spread: f64 = points.iter().map(|p| (p.0 - mean_t).powi(2)).sum();
        let common: f64 = points.iter().map(|p| (p.0 - mean_t) * (p.1 - mean_c)).sum();
        let rate = if spread > 0.0 { common / spread } else { 0.0 };
        let offset = mean_c - rate * mean_t;
        let residuals: f64 = points.iter().map(|p| (p.1 - offset - rate * p.0).powi(2)).sum();
        let free = n - if spread > 0.0 { 2.0 } else { 1.0 };
        // Whole counts are never surer than a twelfth; too few readings to tell, no surer than one count.
        let variance = if free > 0.0 { residuals / free } else { 1.0 };
        Some(Self {
            offset,
            rate,
            mean_t,
            spread,
            n,
            variance: variance.max(1.0 / 12.0),
        })
    }

    /// Counts at an integration time.
    pub(super) fn at(&self, time_us: f64) -> f64 {
        self.offset + self.rate * time_us
    }

    /// Variance of what [`Line::at`] says, counts².
    pub(super) fn variance_at(&self, time_us: f64) -> f64 {
        if self.n == 0.0 {
            return 0.0;
        }
        let lever = match self.spread {
            0.0 => 0.0,
            spread => (time_us - self.mean_t).powi(2) / spread,
        };
        self.variance * (1.0 / self.n + lever)
    }
}
