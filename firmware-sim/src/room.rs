use std::f64::consts::TAU;

/// Light from outside over time, whether the lamp is on or not, as the f·cos that gives as much, sr⁻¹: each source
/// p · (1 + sin ωt) while it is there.
#[derive(Clone, Debug, Default)]
pub(crate) struct Room {
    sources: Vec<Source>,
}

#[derive(Clone, Copy, Debug)]
struct Source {
    /// Since power-on, s.
    from_s: f64,
    to_s: f64,
    per_sr: f64,
    /// Of its flicker, rad/s; 0: it is steady.
    omega: f64,
}

impl Room {
    /// Adds a source from one moment to another, s since power-on.
    pub(crate) fn light(&mut self, from_s: f64, to_s: f64, per_sr: f64, flicker_hz: f64) {
        self.sources.push(Source {
            from_s,
            to_s,
            per_sr,
            omega: TAU * flicker_hz,
        });
    }

    /// ∫ over a stretch of time, s/sr.
    pub(crate) fn integral(&self, from_s: f64, to_s: f64) -> f64 {
        self.sources
            .iter()
            .map(|source| source.integral(from_s, to_s))
            .sum()
    }

    /// Ends what shines at a moment.
    pub(crate) fn darken(&mut self, now_s: f64) {
        for source in &mut self.sources {
            source.to_s = source.to_s.min(now_s);
        }
    }

    /// Lets go of light that ended before a moment.
    pub(crate) fn forget(&mut self, before_s: f64) {
        self.sources.retain(|source| source.to_s > before_s);
    }
}

impl Source {
    fn integral(&self, from_s: f64, to_s: f64) -> f64 {
        let (from, to) = (from_s.max(self.from_s), to_s.min(self.to_s));
        if to <= from {
            return 0.0;
        }
        let ripple = match self.omega {
            0.0 => 0.0,
            omega => ((omega * from).cos() - (omega * to).cos()) / omega,
        };
        self.per_sr * (to - from + ripple)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_counts_only_while_it_is_there() {
        let mut room = Room::default();
        room.light(1.0, 3.0, 0.5, 0.0);
        room.light(2.0, f64::INFINITY, 0.25, 0.0);
        assert_eq!(room.integral(0.0, 1.0), 0.0);
        assert_eq!(room.integral(0.0, 4.0), 1.5);
        room.darken(3.5);
        assert_eq!(room.integral(0.0, 10.0), 1.375);
        room.forget(3.2);
        assert_eq!(room.sources.len(), 1);
    }

    #[test]
    fn flicker_averages_out_over_its_period_and_shows_within_it() {
        let mut room = Room::default();
        room.light(0.0, f64::INFINITY, 0.1, 100.0);
        assert!((room.integral(0.0, 0.1) - 0.01).abs() < 1e-12, "ten periods");
        let [first, second] = [room.integral(0.0, 0.005), room.integral(0.005, 0.01)];
        // Half a period holds p (T/2 ± 2/ω).
        assert!(
            (first - second - 0.4 / (100.0 * TAU)).abs() < 1e-12,
            "{first} {second}"
        );
        assert!(second > 0.0);
    }
}
