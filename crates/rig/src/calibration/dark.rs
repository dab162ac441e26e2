use super::Taken;
use super::line::Line;
use crate::{Counts, Exposure, Gain};

/// What the photometer counts in the dark: for each gain and channel an offset and a rate, fitted to dark readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dark {
    /// Red, green, blue by gain; `None` where no dark reading was taken.
    rgb: [Option<[Line; 3]>; 3],
    /// Longest integration of each gain for which that holds, µs: where longer ones were at full scale.
    longest_us: [f64; 3],
    /// The monitor always integrates at gain ×1, so all readings tell of it.
    monitor: Line,
}

/// What an exposure would have in the dark.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DarkCounts {
    /// Counts of red, green and blue.
    pub rgb: [f64; 3],
    /// Standard uncertainty of each, counts.
    pub u_rgb: [f64; 3],
    /// Counts of red, green and blue without any time: what holds no electrons, and so no shot noise.
    pub offset: [f64; 3],
    /// Counts of the monitor.
    pub monitor: f64,
    /// Its standard uncertainty, counts.
    pub u_monitor: f64,
}

impl Counts {
    /// Whether a channel is at full scale, so that nobody knows how much more there was.
    pub fn is_full(&self, full_scale: u32) -> bool {
        self.saturated || self.rgb.into_iter().any(|counts| counts >= full_scale)
    }
}

impl Dark {
    /// Fits dark readings: least squares of counts over integration time, for each gain and channel by itself. Two
    /// integration times per gain make offset and rate distinct; of one alone, all is taken for offset. The fitted
    /// values are not forced to be positive, so that noise averages out.
    ///
    /// Readings of which a channel is at `full_scale` say nothing, and nothing is said of exposures as long.
    pub fn fit<'a>(readings: impl IntoIterator<Item = &'a Counts>, full_scale: u32) -> Self {
        let full = |reading: &&Counts| reading.is_full(full_scale);
        let (useless, readings): (Vec<&Counts>, Vec<&Counts>) = readings.into_iter().partition(full);
        let longest_us = Gain::ALL.map(|gain| {
            let times = |of: &[&Counts]| -> Vec<u32> {
                let of_gain = of.iter().filter(|reading| reading.exposure.gain == gain);
                of_gain.map(|reading| reading.exposure.integration_us).collect()
            };
            match times(&useless).is_empty() {
                true => f64::INFINITY,
                false => times(&readings).into_iter().max().map_or(0.0, f64::from),
            }
        });
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
            longest_us,
            monitor: Line::fit(&points).unwrap_or_default(),
        }
    }

    /// What an exposure would have in the dark; `None` where no dark reading at its gain says so.
    pub fn counts(&self, exposure: Exposure) -> Option<DarkCounts> {
        let time_us = f64::from(exposure.integration_us);
        if time_us > self.longest_us[exposure.gain as usize] {
            return None;
        }
        let lines = self.rgb[exposure.gain as usize]?;
        Some(DarkCounts {
            rgb: lines.map(|line| line.at(time_us)),
            u_rgb: lines.map(|line| line.variance_at(time_us).sqrt()),
            offset: lines.map(|line| line.offset),
            monitor: self.monitor.at(time_us),
            u_monitor: self.monitor.variance_at(time_us).sqrt(),
        })
    }
}

/// Dark readings repeated during a run: between two sets the dark level is interpolated in time, so that a drift with
/// the photometer's temperature is followed.
#[derive(Clone, Debug, PartialEq)]
pub struct Darks {
    /// Ascending in time.
    sets: Vec<Set>,
}

/// What an unbroken series of dark readings says.
#[derive(Clone, Debug, PartialEq)]
struct Set {
    /// Mean time of all of it, s.
    mean_s: f64,
    /// When its readings of each gain saw the dark current, s: the mean of their times by how long they integrated. The
    /// gains are read one after the other, and a photometer that warms up meanwhile shows each another level.
    of_gain_s: [f64; 3],
    dark: Dark,
}

impl Set {
    fn fit(readings: &[Taken], full_scale: u32) -> Self {
        let mean_s = readings.iter().map(|taken| taken.time_s).sum::<f64>() / readings.len() as f64;
        let of_gain_s = Gain::ALL.map(|gain| {
            let of_gain = readings.iter().filter(|taken| taken.counts.exposure.gain == gain);
            let weighted = of_gain.map(|taken| {
                let weight = f64::from(taken.counts.exposure.integration_us);
                (weight, weight * taken.time_s)
            });
            let (weights, sum) = weighted.fold((0.0, 0.0), |(a, b), (x, y)| (a + x, b + y));
            match weights > 0.0 {
                true => sum / weights,
                false => mean_s,
            }
        });
        Self {
            mean_s,
            of_gain_s,
            dark: Dark::fit(readings.iter().map(|taken| &taken.counts), full_scale),
        }
    }
}

impl Darks {
    /// Fits each unbroken series of readings without lamp, out of all readings of a run in the order of their time.
    pub fn fit(readings: &[Taken], full_scale: u32) -> Self {
        let sets = readings
            .chunk_by(|a, b| a.lamp == b.lamp)
            .filter(|set| !set[0].lamp)
            .map(|set| Set::fit(set, full_scale));
        Self { sets: sets.collect() }
    }

    /// What an exposure would have in the dark at a time, s; before the first set and after the last one as there.
    /// `None` where no dark reading was taken at its gain.
    ///
    /// The uncertainty holds that of the fits, and for the way between two sets a quarter of the difference as the
    /// half width of a rectangle: nobody knows how straight the way was.
    pub fn counts(&self, time_s: f64, exposure: Exposure) -> Option<DarkCounts> {
        let usable: Vec<(f64, DarkCounts)> = self
            .sets
            .iter()
            .filter_map(|set| Some((set.of_gain_s[exposure.gain as usize], set.dark.counts(exposure)?)))
            .collect();
        let after = usable.partition_point(|(at, _)| *at <= time_s);
        let (Some(before), Some(next)) = (after.checked_sub(1).map(|i| usable[i]), usable.get(after)) else {
            return usable.get(after).or(usable.last()).map(|(_, counts)| *counts);
        };
        let share = (time_s - before.0) / (next.0 - before.0);
        let between = |a: f64, b: f64| a + share * (b - a);
        let u = |ua: f64, ub: f64, step: f64| {
            let fits = ((1.0 - share) * ua).powi(2) + (share * ub).powi(2);
            (fits + (step / 4.0).powi(2) / 3.0).sqrt()
        };
        let (a, b) = (before.1, next.1);
        Some(DarkCounts {
            rgb: std::array::from_fn(|c| between(a.rgb[c], b.rgb[c])),
            u_rgb: std::array::from_fn(|c| u(a.u_rgb[c], b.u_rgb[c], b.rgb[c] - a.rgb[c])),
            offset: std::array::from_fn(|c| between(a.offset[c], b.offset[c])),
            monitor: between(a.monitor, b.monitor),
            u_monitor: u(a.u_monitor, b.u_monitor, b.monitor - a.monitor),
        })
    }

    /// Times of the sets, s.
    pub fn times_s(&self) -> impl Iterator<Item = f64> {
        self.sets.iter().map(|set| set.mean_s)
    }
}

#[cfg(test)]
mod tests {
    use arms::Pose;

    use super::*;

    const FULL: u32 = 1_048_575;

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

    fn taken(time_s: f64, lamp: bool, counts: Counts) -> Taken {
        Taken {
            pose: Pose::default(),
            time_s,
            lamp,
            counts,
        }
    }

    #[test]
    fn offset_and_rate_come_apart_with_two_times() {
        let dark = Dark::fit(
            [
                &reading(Gain::X16, 1_000, [110, 210, 60], 5),
                &reading(Gain::X16, 100_000, [1_100, 1_200, 60], 5),
            ],
            FULL,
        );
        let exposure = Exposure {
            integration_us: 50_000,
            gain: Gain::X16,
        };
        let at = dark.counts(exposure).unwrap();
        for (found, expected) in at.rgb.into_iter().zip([600.0, 700.0, 60.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} instead of {expected}");
        }
        assert!((at.monitor - 5.0).abs() < 1e-9);
    }

    #[test]
    fn gains_are_apart_but_the_monitor_is_one() {
        let dark = Dark::fit(
            [
                &reading(Gain::X1, 1_000, [10; 3], 4),
                &reading(Gain::X256, 1_000, [900; 3], 8),
            ],
            FULL,
        );
        let at = |gain| {
            let counts = dark.counts(Exposure {
                integration_us: 1_000,
                gain,
            });
            counts.map(|counts| (counts.rgb, counts.monitor))
        };
        assert_eq!(at(Gain::X1), Some(([10.0; 3], 6.0)));
        assert_eq!(at(Gain::X256), Some(([900.0; 3], 6.0)));
        assert_eq!(at(Gain::X16), None);
    }

    #[test]
    fn readings_at_full_scale_say_nothing_of_the_dark() {
        let full = reading(Gain::X16, 100_000, [60, FULL, 60], 5);
        let dark = Dark::fit([&reading(Gain::X16, 1_000, [60; 3], 5), &full, &full], FULL);
        let counts = |integration_us| {
            let gain = Gain::X16;
            dark.counts(Exposure { integration_us, gain })
                .map(|counts| counts.rgb)
        };
        assert_eq!(counts(1_000), Some([60.0; 3]));
        assert_eq!(counts(1_001), None);
        assert_eq!(Dark::fit([&full], FULL).counts(full.exposure), None);
    }

    #[test]
    fn between_two_sets_the_dark_drifts_evenly_and_beyond_them_stays() {
        let set = |time_s: f64, counts: u32| taken(time_s, false, reading(Gain::X1, 1_000, [counts; 3], 0));
        let lit = taken(5.0, true, reading(Gain::X1, 1_000, [900; 3], 0));
        let run = [set(0.0, 100), set(2.0, 100), lit, set(10.0, 140), set(12.0, 140)];
        let darks = Darks::fit(&run, FULL);
        assert_eq!(darks.times_s().collect::<Vec<_>>(), [1.0, 11.0]);
        let exposure = run[0].counts.exposure;
        let at = |time_s| darks.counts(time_s, exposure).unwrap().rgb[1];
        assert_eq!(
            [at(-3.0), at(1.0), at(6.0), at(11.0), at(99.0)],
            [100.0, 100.0, 120.0, 140.0, 140.0]
        );
        let unsure = darks.counts(6.0, exposure).unwrap().u_rgb[0];
        assert!(unsure > 10.0 / 3f64.sqrt() && unsure < 6.5, "{unsure}");
    }
}
