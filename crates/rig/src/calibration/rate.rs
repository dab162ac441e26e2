use crate::{Gain, Uncertainties};

/// Counts per µs at gain ×1 and nominal lamp output.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rate {
    pub(crate) rgb: [f64; 3],
    /// Counts above dark.
    pub(crate) net: [f64; 3],
    /// Whether a channel is at full scale: then it is only known to be larger.
    pub(super) full: [bool; 3],
    /// Standard uncertainties: of these counts, of the dark level, of the lamp (relative), of linearity (relative).
    pub(crate) u_counting: [f64; 3],
    pub(super) u_dark: [f64; 3],
    pub(super) u_lamp: f64,
    pub(super) u_linearity: [f64; 3],
    /// Of each gain step, relative, by step and channel.
    pub(super) u_gain: [[f64; 3]; 3],
    /// Of the monitor's own noise, relative.
    pub(super) u_monitor: f64,
    /// What the gain step amplifies by.
    pub(super) gain: f64,
    /// Rate of one count.
    pub(super) scale: f64,
    /// Counts that the dark has above its offset: they are noisy like those of light.
    pub(super) current: [f64; 3],
}

impl Rate {
    /// Variance of a channel by its own counts and those of the monitor, if its true rate is `level`.
    pub(super) fn variance(&self, channel: usize, level: f64, known: &Uncertainties) -> f64 {
        let counts = level / self.scale + self.current[channel];
        known.variance(counts, self.gain) * self.scale * self.scale + (self.u_monitor * level).powi(2)
    }

    /// Of each channel the mean by inverse variance over the exposures in which it is not at full scale; `None` where
    /// that leaves one without any.
    ///
    /// The variances are those of one level for all, the best exposure's: by its own counts an exposure that came out
    /// too low would claim to be surer than one that came out too high, and draw the mean down. What is no noise of a
    /// single exposure is added up with its sign, and so not averaged down.
    pub(super) fn mean(exposures: &[Self], known: &Uncertainties) -> Option<Self> {
        let mut mean = Self {
            u_lamp: exposures.iter().map(|rate| rate.u_lamp).fold(0.0, f64::max),
            ..Self::default()
        };
        for c in 0..3 {
            let usable = || exposures.iter().filter(|rate| !rate.full[c]);
            let best = usable().min_by(|a, b| a.u_counting[c].total_cmp(&b.u_counting[c]))?;
            let variance = |rate: &Self| rate.variance(c, best.rgb[c], known) + rate.u_dark[c].powi(2);
            let sum: f64 = usable().map(|rate| 1.0 / variance(rate)).sum();
            let mut noise = 0.0;
            for rate in usable() {
                let weight = 1.0 / variance(rate) / sum;
                mean.rgb[c] += weight * rate.rgb[c];
                mean.net[c] += weight * rate.net[c];
                mean.u_dark[c] += weight * rate.u_dark[c];
                mean.u_linearity[c] += weight * rate.u_linearity[c];
                for (mean, of_step) in mean.u_gain.iter_mut().zip(rate.u_gain) {
                    mean[c] += weight * of_step[c];
                }
                noise += weight * weight * rate.variance(c, best.rgb[c], known);
            }
            mean.u_counting[c] = noise.sqrt();
        }
        Some(mean)
    }
}

impl Uncertainties {
    /// Relative standard uncertainty of what a gain step amplifies by; ×1 amplifies nothing.
    pub fn of_gain(&self, gain: Gain) -> f64 {
        match gain {
            Gain::X1 => 0.0,
            Gain::X16 | Gain::X256 => self.gain,
        }
    }

    /// Variance of counts above the photometer's offset, taken with a gain: shot noise, converter, rounding.
    pub fn variance(&self, counts: f64, gain: f64) -> f64 {
        let shot = match self.electrons_per_count {
            0.0 => 0.0,
            electrons => gain * counts.max(0.0) / electrons,
        };
        shot + self.read_noise_counts.powi(2) + 1.0 / 12.0
    }
}
