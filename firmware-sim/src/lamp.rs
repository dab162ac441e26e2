use std::collections::VecDeque;
use std::f64::consts::TAU;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Periods of the slow drift, s; none a multiple of another, so that the sum does not repeat within a run.
const DRIFT_PERIODS_S: [f64; 3] = [97.0, 311.0, 1009.0];
/// Ripple of a supply on 50 Hz mains.
const FLICKER_PERIOD_S: f64 = 0.01;

/// A sinusoidal deviation from nominal output.
#[derive(Clone, Copy, Debug)]
struct Ripple {
    amplitude: f64,
    omega: f64,
    phase: f64,
}

/// The lamp: output relative to nominal, 1, as a closed form of time.
///
/// L(t) = (1 − e^(−(t − t_on)/τ)) · (1 + bt + Σ A sin(ωt + φ)); τ is the warm-up, b a trend, the sum the slow drift and
/// the flicker.
#[derive(Clone, Debug)]
pub(crate) struct Lamp {
    warm_up_s: f64,
    /// Relative growth per second.
    trend_per_s: f64,
    ripples: Vec<Ripple>,
    /// Spans of light: on, off; seconds since power-on.
    spans: VecDeque<(f64, f64)>,
}

impl Lamp {
    /// A dark lamp. `drift` and `flicker` are amplitudes relative to nominal output, `warm_up_s` a time constant.
    pub(crate) fn new(warm_up_s: f64, drift: f64, flicker: f64, random: &mut ChaCha8Rng) -> Self {
        let amplitude = drift / DRIFT_PERIODS_S.len() as f64;
        let ripples = DRIFT_PERIODS_S
            .into_iter()
            .map(|period_s| (amplitude, period_s))
            .chain([(flicker, FLICKER_PERIOD_S)])
            .map(|(amplitude, period_s)| Ripple {
                amplitude,
                omega: TAU / period_s,
                phase: random.random::<f64>() * TAU,
            })
            .collect();
        Self {
            warm_up_s,
            trend_per_s: 0.0,
            ripples,
            spans: VecDeque::new(),
        }
    }

    /// The same with a trend, relative to nominal output.
    pub(crate) fn with_trend(mut self, per_h: f64) -> Self {
        self.trend_per_s = per_h / 3600.0;
        self
    }

    pub(crate) fn on(&self) -> bool {
        self.spans.back().is_some_and(|span| span.1 == f64::INFINITY)
    }

    pub(crate) fn switch(&mut self, now_s: f64, on: bool) {
        match self.spans.back_mut().filter(|span| span.1 == f64::INFINITY) {
            Some(span) if !on => span.1 = now_s,
            None if on => self.spans.push_back((now_s, f64::INFINITY)),
            _ => {}
        }
    }

    /// Output at a moment.
    pub(crate) fn level(&self, t_s: f64) -> f64 {
        let Some(&(on, _)) = self.spans.iter().find(|&&(on, off)| on <= t_s && t_s < off) else {
            return 0.0;
        };
        let ripple = |ripple: &Ripple| ripple.amplitude * (ripple.omega * t_s + ripple.phase).sin();
        self.warmth(t_s - on) * (1.0 + self.trend_per_s * t_s + self.ripples.iter().map(ripple).sum::<f64>())
    }

    fn warmth(&self, since_s: f64) -> f64 {
        match self.warm_up_s {
            0.0 => 1.0,
            tau => -(-since_s / tau).exp_m1(),
        }
    }

    /// Integral of the output over a stretch of time, s.
    pub(crate) fn integral(&self, from_s: f64, to_s: f64) -> f64 {
        self.spans
            .iter()
            .map(|&(on, off)| (on, on.max(from_s), off.min(to_s)))
            .filter(|&(_, from, to)| from < to)
            .map(|(on, from, to)| self.primitive(on, to) - self.primitive(on, from))
            .sum()
    }

    /// ∫ L dt from wherever suits each term, for a lamp that came on at `on`.
    fn primitive(&self, on: f64, t: f64) -> f64 {
        let tau = self.warm_up_s;
        let cold = if tau == 0.0 { 0.0 } else { (-(t - on) / tau).exp() };
        let ripple = |ripple: &Ripple| {
            let Ripple {
                amplitude,
                omega,
                phase,
            } = *ripple;
            let (sin, cos) = (omega * t + phase).sin_cos();
            // ∫ sin, and ∫ e^(−(t − on)/τ) sin = −τ e^(…) (sin + ωτ cos) / (1 + ω²τ²).
            let steady = -cos / omega;
            let warming = tau * cold * (sin + omega * tau * cos) / (1.0 + (omega * tau).powi(2));
            amplitude * (steady + warming)
        };
        // ∫ t, and ∫ −t e^(−(t − on)/τ) = τ e^(…) (t + τ).
        let trend = self.trend_per_s * (t * t / 2.0 + tau * cold * (t + tau));
        t + tau * cold + trend + self.ripples.iter().map(ripple).sum::<f64>()
    }

    /// Moments within a stretch of time at which the lamp was switched.
    pub(crate) fn breaks(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = f64> {
        self.spans
            .iter()
            .flat_map(|&(on, off)| [on, off])
            .filter(move |&t| from_s < t && t < to_s)
    }

    /// Lets go of light that went out before a moment.
    pub(crate) fn forget(&mut self, before_s: f64) {
        while self.spans.front().is_some_and(|span| span.1 <= before_s) {
            self.spans.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    fn lamp() -> Lamp {
        Lamp::new(0.02, 0.005, 0.001, &mut ChaCha8Rng::seed_from_u64(1))
    }

    #[test]
    fn a_trend_is_in_level_and_integral() {
        let mut lamp = lamp().with_trend(36.0);
        lamp.switch(0.1, true);
        assert!((lamp.level(10.0) - 1.1).abs() < 0.01);
        for (from, to) in [(0.1, 0.11), (0.3, 2.0)] {
            let (exact, numeric) = (lamp.integral(from, to), numeric(&lamp, from, to));
            assert!((exact - numeric).abs() < 1e-6, "{exact} against {numeric}");
        }
    }

    /// Midpoint rule, fine enough for 1e-9.
    fn numeric(lamp: &Lamp, from: f64, to: f64) -> f64 {
        let n = 200_000;
        let dt = (to - from) / f64::from(n);
        (0..n)
            .map(|i| lamp.level(from + (f64::from(i) + 0.5) * dt))
            .sum::<f64>()
            * dt
    }

    #[test]
    fn integral_is_that_of_the_level() {
        let mut lamp = lamp();
        lamp.switch(0.1, true);
        lamp.switch(0.35, false);
        lamp.switch(0.4, true);
        for (from, to) in [(0.0, 0.5), (0.1, 0.11), (0.3, 0.45), (0.36, 0.39), (3.0, 3.0)] {
            let (exact, numeric) = (lamp.integral(from, to), numeric(&lamp, from, to));
            assert!(
                (exact - numeric).abs() < 1e-6,
                "{from} to {to}: {exact} against {numeric}"
            );
        }
    }

    #[test]
    fn without_imperfections_it_is_nominal_at_once() {
        let mut lamp = Lamp::new(0.0, 0.0, 0.0, &mut ChaCha8Rng::seed_from_u64(1));
        assert_eq!(lamp.integral(0.0, 1.0), 0.0);
        lamp.switch(1.0, true);
        assert_eq!(lamp.level(1.0), 1.0);
        assert_eq!(lamp.integral(1.0, 1.5), 0.5);
    }

    #[test]
    fn it_stays_within_its_stated_drift_and_flicker() {
        let mut lamp = lamp();
        lamp.switch(0.0, true);
        for i in 0..10_000 {
            let level = lamp.level(1.0 + f64::from(i) * 0.317);
            assert!((level - 1.0).abs() <= 0.006, "level {level}");
        }
    }
}
