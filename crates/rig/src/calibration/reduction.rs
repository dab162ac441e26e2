use arms::Pose;

use super::certificate::{Certificate, White};
use super::lamp::{Drift, Lamp};
use super::rate::Rate;
use super::{Darks, MIN_COSINE, MIN_LAMP, Taken, Unusable};
use crate::RigFile;

/// From the counts of one run to reflectance: the rig file, the certificate, the run's dark readings and its visits to
/// the reference pose.
#[derive(Clone, Debug)]
pub struct Reduction<'a> {
    file: &'a RigFile,
    certificate: Certificate,
    white: White,
    darks: Darks,
    drift: Drift,
}

/// BRDF from one reading, or from several exposures of one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflectance {
    /// Linear sRGB in sr⁻¹; the sensor's own colours where no colour matrix was measured.
    pub rgb: [f64; 3],
    /// In the sensor's own colours, sr⁻¹.
    pub raw: [f64; 3],
    /// How sure `rgb` is, as far as its own counts can tell.
    pub u: Budget,
    /// How many exposures told it: those in which not every channel was at full scale.
    pub exposures: usize,
}

/// Standard uncertainty of a reflectance by its origin, red, green, blue, sr⁻¹. What depends on how the reflectance
/// varies with the angles is not in it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Budget {
    /// Photons, electrons and the converter, in these counts alone: signal and monitor.
    pub counting: [f64; 3],
    /// The dark level: the same for all readings of a gain between two dark sets.
    pub dark: [f64; 3],
    /// The lamp between two visits to the reference pose; 0 with a monitor.
    pub drift: [f64; 3],
    /// Responsivity and the white reference: the same for all readings.
    pub reference: [f64; 3],
    /// Linearity: the same sign for all readings.
    pub linearity: [f64; 3],
    /// What each gain step amplifies by, by step: the same share and sign for all readings of a step.
    pub gain: [[f64; 3]; 3],
    /// Light of the other colours in a channel, or what the colour matrix leaves over.
    pub colour: [f64; 3],
    /// Stray light: the same amount of light in all readings.
    pub stray: [f64; 3],
}

impl Budget {
    /// Of all gain steps together, which are independent of each other.
    pub fn all_gains(&self) -> [f64; 3] {
        std::array::from_fn(|c| self.gain.iter().map(|step| step[c].powi(2)).sum::<f64>().sqrt())
    }
}

impl<'a> Reduction<'a> {
    /// For the readings of a run in the order of their time, of which `visits` were taken at the reference pose.
    pub fn new(
        file: &'a RigFile,
        certificate: Option<&Certificate>,
        readings: &[Taken],
        visits: &[Taken],
    ) -> Self {
        let certificate = certificate.cloned().unwrap_or_default();
        let white = certificate.white.clone().unwrap_or_else(|| White::nominal(file));
        let mut reduction = Self {
            file,
            certificate,
            white,
            darks: Darks::fit(readings, file.photometer.full_scale),
            drift: Drift::default(),
        };
        if file.visits.lamp == Lamp::Visits {
            let signals = visits.iter().filter_map(|visit| {
                let rate = reduction.rate(visit).ok()?;
                let sum: f64 = rate.rgb.iter().sum();
                let variance: f64 = (0..3)
                    .map(|c| rate.u_counting[c].powi(2) + rate.u_dark[c].powi(2))
                    .sum();
                Some((*visit, sum, variance.sqrt() / sum))
            });
            reduction.drift = Drift::new(signals.collect::<Vec<_>>());
        }
        reduction
    }

    /// The same with another white reference.
    pub(crate) fn with_white(mut self, white: White) -> Self {
        self.white = white;
        self
    }

    /// The lamp's output at the usable visits to the reference pose, relative to the first, in the order of their time.
    /// None where a monitor follows the lamp.
    pub fn lamp_levels(&self) -> Vec<f64> {
        self.drift.levels().collect()
    }

    /// Where the arms really were, when their encoders said `pose`.
    pub fn aligned(&self, pose: Pose) -> Pose {
        self.certificate.aligned(pose)
    }

    /// BRDF from one reading.
    ///
    /// f = M · ((counts − dark) / (gain · t · lamp) − stray) / (responsivity · cos θ), with θ = θ_i where the light
    /// overfills the field of the sensor, θ_o where it underfills it (ASTM E2387, Nicodemus), and the lamp by its
    /// monitor or by visits to the reference pose. Of a black specimen the values scatter about 0: they may be
    /// slightly negative, and must stay so until averages are taken.
    ///
    /// # Errors
    /// Counts that say nothing, and why.
    pub fn reflectance(&self, taken: &Taken) -> Result<Reflectance, Unusable> {
        self.combined(std::slice::from_ref(taken))
    }

    /// BRDF from exposures of one pose that overlap: of each channel the mean over those in which it is not at full
    /// scale, by the inverse of their variances. Their own noise is averaged down and nothing else: dark level, lamp,
    /// linearity, responsivity and stray light are wrong in all of them alike.
    ///
    /// Exposures that say nothing at all are left out.
    ///
    /// # Errors
    /// No exposure says anything, or a channel is at full scale in all of them; why.
    ///
    /// # Panics
    /// If there are no exposures.
    pub fn combined(&self, exposures: &[Taken]) -> Result<Reflectance, Unusable> {
        self.combined_at(self.aligned(exposures[0].pose), exposures)
    }

    /// The same of arms that are known to have been at `pose`, whatever their encoders said.
    ///
    /// # Errors
    /// As [`Reduction::combined`].
    ///
    /// # Panics
    /// If there are no exposures.
    pub fn combined_at(&self, pose: Pose, exposures: &[Taken]) -> Result<Reflectance, Unusable> {
        let cosine = self.file.calibration.filling.arm(pose).rad().cos();
        if cosine.is_nan() || cosine < MIN_COSINE {
            return Err(Unusable::Grazing);
        }
        let rates: Vec<Rate> = exposures.iter().flat_map(|taken| self.channels(taken)).collect();
        let usable: Vec<Rate> = rates.into_iter().filter(|rate| rate.full != [true; 3]).collect();
        let rate = match usable.as_slice() {
            [] => self.rate(&exposures[0])?,
            [one] if one.full == [false; 3] => *one,
            several => Rate::mean(several, &self.file.uncertainty).ok_or(Unusable::Saturated)?,
        };
        let (stray, u_stray) = self.stray(pose);
        let scale = self.white.responsivity.map(|r| 1.0 / (r * cosine));
        let raw: [f64; 3] = std::array::from_fn(|c| (rate.rgb[c] - stray[c]) * scale[c]);
        let scaled = |u: [f64; 3]| std::array::from_fn::<f64, 3, _>(|c| u[c] * scale[c]);
        let relative = |u: [f64; 3]| std::array::from_fn::<f64, 3, _>(|c| u[c] * raw[c].abs());
        let u = Budget {
            counting: scaled(rate.u_counting),
            dark: scaled(rate.u_dark),
            drift: relative([rate.u_lamp; 3]),
            reference: relative(self.white.u_responsivity),
            linearity: relative(rate.u_linearity),
            gain: rate.u_gain.map(|step| std::array::from_fn(|c| step[c] * raw[c])),
            colour: crosstalk(raw).map(|light| self.file.uncertainty.crosstalk * light),
            stray: scaled(u_stray),
        };
        Ok(self.colour(Reflectance {
            rgb: raw,
            raw,
            u,
            exposures: usable.len(),
        }))
    }

    /// Counts per µs at gain ×1 and nominal lamp output, stray light included.
    ///
    /// # Errors
    /// Counts that say nothing, and why.
    pub(crate) fn rate(&self, taken: &Taken) -> Result<Rate, Unusable> {
        match taken.counts.saturated {
            true => Err(Unusable::Saturated),
            false => self.channels(taken),
        }
    }

    /// The same of a reading of which channels may be at full scale, and say nothing.
    fn channels(&self, taken: &Taken) -> Result<Rate, Unusable> {
        let counts = &taken.counts;
        let exposure = counts.exposure;
        let dark = self
            .darks
            .counts(taken.time_s, exposure)
            .ok_or(Unusable::Dark(exposure.gain))?;
        let time_us = f64::from(exposure.integration_us);
        let known = &self.file.uncertainty;
        let gain = self.white.gains[exposure.gain as usize];
        let full_scale = f64::from(self.file.photometer.full_scale);
        let (lamp, u_monitor, u_lamp) = match self.file.visits.lamp {
            Lamp::Visits => {
                let (level, u) = self.drift.level(taken.time_s);
                (level, 0.0, u / level)
            }
            Lamp::Monitor if counts.monitor >= self.file.photometer.full_scale => {
                return Err(Unusable::Monitor);
            }
            Lamp::Monitor => {
                let net = f64::from(counts.monitor) - dark.monitor;
                let u = (known.variance(net, 1.0) + dark.u_monitor.powi(2)).sqrt();
                (net / (self.file.calibration.monitor * time_us), u / net, 0.0)
            }
        };
        // NaN, of a drift that nobody saw, is no light either.
        if lamp.is_nan() || lamp < MIN_LAMP {
            return Err(Unusable::Lamp);
        }
        let scale = 1.0 / (gain * time_us * lamp);
        let mut rate = Rate {
            u_lamp,
            u_monitor,
            gain,
            scale,
            ..Rate::default()
        };
        let full = |c: usize| counts.rgb[c] >= self.file.photometer.full_scale;
        // Where the photometer calls itself full below that, it does not say which channel is.
        let which = (0..3).any(full);
        for c in 0..3 {
            let net = f64::from(counts.rgb[c]) - dark.rgb[c];
            let current = dark.rgb[c] - dark.offset[c];
            let (straight, u_linearity) = self.white.straighten(net, current, full_scale);
            rate.rgb[c] = straight * scale;
            rate.net[c] = net;
            rate.full[c] = counts.saturated && (full(c) || !which);
            rate.u_dark[c] = dark.u_rgb[c] * scale;
            rate.u_linearity[c] = u_linearity;
            rate.u_gain[exposure.gain as usize][c] = self.white.u_gains[exposure.gain as usize];
            rate.current[c] = current;
            rate.u_counting[c] = rate.variance(c, rate.rgb[c], known).sqrt();
        }
        Ok(rate)
    }

    /// Stray light at a pose and its standard uncertainty, counts per µs.
    fn stray(&self, pose: Pose) -> ([f64; 3], [f64; 3]) {
        match &self.certificate.trap {
            Some(trap) => (trap.at(pose), trap.u),
            None => {
                let u = self.file.uncertainty.stray_per_sr;
                ([0.0; 3], self.white.responsivity.map(|r| r * u))
            }
        }
    }

    fn colour(&self, sensor: Reflectance) -> Reflectance {
        let Some(colour) = &self.certificate.colour else {
            return sensor;
        };
        let row = |of: &[f64; 3], row: &[f64; 3]| row.iter().zip(of).map(|(m, x)| m * x).sum::<f64>();
        let squares = |of: &[f64; 3], row: &[f64; 3]| {
            let sum: f64 = row.iter().zip(of).map(|(m, x)| (m * x).powi(2)).sum();
            sum.sqrt()
        };
        let mixed = |of: [f64; 3]| colour.matrix.map(|line| squares(&of, &line));
        let u = sensor.u;
        let rgb = colour.matrix.map(|line| row(&sensor.raw, &line));
        let brightest = rgb.into_iter().map(f64::abs).fold(0.0, f64::max);
        Reflectance {
            rgb,
            u: Budget {
                counting: mixed(u.counting),
                dark: mixed(u.dark),
                drift: mixed(u.drift),
                reference: mixed(u.reference),
                linearity: mixed(u.linearity),
                // All channels of a step are off by one share, so that what is mixed keeps its sign.
                gain: u.gain.map(|step| colour.matrix.map(|line| row(&step, &line))),
                colour: match colour.u {
                    Some(u) => [u * brightest; 3],
                    // Three patches leave nothing over that would tell how good the matrix is.
                    None => u.colour,
                },
                stray: mixed(u.stray),
            },
            ..sensor
        }
    }
}

/// Root mean square, for each channel, of what the two other colours have more or less than it, times √(1/2): a share of
/// its light that comes from each of them, independent of the other, changes the channel by that.
///
/// Where a share x of a channel's light comes from the two others in equal parts it changes by x times the difference of
/// their mean; the formula holds that difference where both are brighter or both are darker than the channel, and more
/// than it where one is brighter and one darker, since nobody knows that the parts are equal.
fn crosstalk(raw: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| {
        let squares: f64 = raw.iter().map(|other| (other - raw[c]).powi(2)).sum();
        (squares / 2.0).sqrt()
    })
}
