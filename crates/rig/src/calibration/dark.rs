use crate::{Counts, Exposure, Gain};

/// What the photometer counts in the dark: for each gain and channel an offset and a rate, fitted to dark readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dark {
    /// Red, green, blue by gain; `None` where no dark reading was taken.
    rgb: [Option<[Line; 3]>; 3],
    /// The monitor always integrates at gain ×1, so all readings tell of it.
    monitor: Line,
}

/// Counts over integration time: offset + rate · t.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Line {
    /// Counts.
    offset: f64,
    /// Counts per µs.
    rate: f64,
}

impl Line {
    const ZERO: Self = Self {
        offset: 0.0,
        rate: 0.0,
    };

    /// Least squares through (t in µs, counts); of a single integration time, all is offset.
    fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let n = points.len() as f64;
        if points.is_empty() {
            return None;
        }
        let mean_t = points.iter().map(|p| p.0).sum::<f64>() / n;
        let mean_c = points.iter().map(|p| p.1).sum::<f64>() / n;
        let spread: f64 = points.iter().map(|p| (p.0 - mean_t).powi(2)).sum();
        let common: f64 = points.iter().map(|p| (p.0 - mean_t) * (p.1 - mean_c)).sum();
        let rate = if spread > 0.0 { common / spread } else { 0.0 };
        Some(Self {
            offset: mean_c - rate * mean_t,
            rate,
        })
    }

    fn at(self, time_us: f64) -> f64 {
        self.offset + self.rate * time_us
    }
}

impl Dark {
    /// A photometer that counts nothing in the dark.
    pub const NONE: Self = Self {
        rgb: [Some([Line::ZERO; 3]); 3],
        monitor: Line::ZERO,
    };

    /// Fits dark readings: least squares of counts over integration time, for each gain and channel by itself. Two
    /// integration times per gain make offset and rate distinct; of one alone, all is taken for offset. The fitted
    /// values are not forced to be positive, so that noise averages out.
    pub fn fit<'a>(readings: impl IntoIterator<Item = &'a Counts>) -> Self {
        let readings: Vec<&Counts> = readings.into_iter().collect();
        let time = |reading: &Counts| f64::from(reading.exposure.integration_us);
        let rgb = Gain::ALL.map(|gain| {
            let channel = |c: usize| {
                let points: Vec<_> = readings
                    .iter()
                    .filter(|reading| reading.exposure.gain == gain)
                    .map(|reading| (time(reading), f64::from(reading.rgb[c])))
                    .collect();
                Line::fit(&points)
            };
            Some([channel(0)?, channel(1)?, channel(2)?])
        });
        let points: Vec<_> = readings
            .iter()
            .map(|reading| (time(reading), f64::from(reading.monitor)))
            .collect();
        Self {
            rgb,
            monitor: Line::fit(&points).unwrap_or_default(),
        }
    }

    /// Counts that an exposure would have in the dark, of red, green, blue and of the monitor; `None` where no dark
    /// reading was taken at its gain.
    pub fn counts(&self, exposure: Exposure) -> Option<([f64; 3], f64)> {
        let time_us = f64::from(exposure.integration_us);
        let lines = self.rgb[exposure.gain as usize]?;
        Some((lines.map(|line| line.at(time_us)), self.monitor.at(time_us)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(gain: Gain, integration_us: u32, rgb: [u32; 3], monitor: u32) -> Counts {
        Counts {
            rgb,
            monitor,
            exposure: Exposure { integration_us, gain },
            saturated: false,
            sequence: 0,
            ticks: 0,
            temperature_c: 25,
        }
    }

    #[test]
    fn offset_and_rate_come_apart_with_two_times() {
        let dark = Dark::fit([
            &reading(Gain::X16, 1_000, [110, 210, 60], 5),
            &reading(Gain::X16, 100_000, [1_100, 1_200, 60], 5),
        ]);
        let exposure = Exposure {
            integration_us: 50_000,
            gain: Gain::X16,
        };
        let (rgb, monitor) = dark.counts(exposure).unwrap();
        for (found, expected) in rgb.into_iter().zip([600.0, 700.0, 60.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
        }
        assert!((monitor - 5.0).abs() < 1e-9);
    }

    #[test]
    fn gains_are_apart_but_the_monitor_is_one() {
        let dark = Dark::fit([
            &reading(Gain::X1, 1_000, [10; 3], 4),
            &reading(Gain::X256, 1_000, [900; 3], 8),
        ]);
        let at = |gain| {
            dark.counts(Exposure {
                integration_us: 1_000,
                gain,
            })
        };
        assert_eq!(at(Gain::X1), Some(([10.0; 3], 6.0)));
        assert_eq!(at(Gain::X256), Some(([900.0; 3], 6.0)));
        assert_eq!(at(Gain::X16), None);
    }
}
