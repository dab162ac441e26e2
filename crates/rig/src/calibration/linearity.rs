/// How a channel of the photometer loses counts towards full scale: of a signal of s counts it shows
/// s · (1 − loss · s / full scale).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Linearity {
    /// Share of the counts that is lost where the signal reaches full scale; below 0.25 the counts shown grow with the
    /// signal over the whole range.
    pub(super) loss: f64,
    /// Counts at which a channel is full.
    pub(super) full_scale: f64,
}

impl Linearity {
    /// Counts shown of a signal, in counts.
    pub(super) fn shown(self, signal: f64) -> f64 {
        signal * (1.0 - self.loss * signal / self.full_scale)
    }

    /// Counts that are shown more for each count that a signal has more.
    pub(super) fn slope(self, signal: f64) -> f64 {
        1.0 - 2.0 * self.loss * signal / self.full_scale
    }

    /// The signal, in counts, of which so many counts are shown.
    pub(super) fn signal(self, shown: f64) -> f64 {
        let root = (1.0 - 4.0 * self.loss * shown / self.full_scale).max(0.0).sqrt();
        // 2 / (1 + root) is (1 − root) / (2 loss share) without its 0/0.
        shown * 2.0 / (1.0 + root)
    }

    /// By which share a signal that was worked out of its counts grows for each unit that the loss is larger.
    pub(super) fn sensitivity(self, signal: f64) -> f64 {
        signal.abs() / self.full_scale / self.slope(signal).max(f64::EPSILON)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn prop_a_signal_is_worked_out_of_what_is_shown_of_it(
            loss in -0.2..0.2_f64, share in -0.01..1.1_f64, full_scale in 255.0..16_777_215.0_f64,
        ) {
            let linearity = Linearity { loss, full_scale };
            let signal = share * full_scale;
            let back = linearity.signal(linearity.shown(signal));
            prop_assert!((back - signal).abs() <= 1e-9 * full_scale, "{back} instead of {signal}");
        }

        #[test]
        fn prop_slope_and_sensitivity_are_the_derivatives(loss in -0.2..0.2_f64, share in 0.01..1.1_f64) {
            let (full_scale, step) = (1e6, 1e-6);
            let linearity = Linearity { loss, full_scale };
            let signal = share * full_scale;
            let slope = (linearity.shown(signal + 1.0) - linearity.shown(signal - 1.0)) / 2.0;
            prop_assert!((slope - linearity.slope(signal)).abs() < 1e-6);
            let shown = linearity.shown(signal);
            let other = Linearity { loss: loss + step, full_scale }.signal(shown);
            let grown = (other / signal - 1.0) / step;
            prop_assert!((grown / linearity.sensitivity(signal) - 1.0).abs() < 1e-3, "{grown}");
        }
    }
}
