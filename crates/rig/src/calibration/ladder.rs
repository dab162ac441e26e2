use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector, Matrix3, RowDVector, Vector3};

use super::linearity::Linearity;
use super::rate::Rate;
use crate::{Gain, RigError, RigFile};

/// Readings of a ladder that show counts within this share of full scale tell about linearity; the weakest gain sees a
/// white reference with a hundredth of full scale.
const SHARES: std::ops::Range<f64> = 0.002..0.97;
/// Most steps of the fit; it settles within ten.
const STEPS: usize = 50;
/// A step that changes no parameter by more than this is the last one.
const SETTLED: f64 = 1e-9;
/// A loss at full scale that is this unsure was not measured at all.
const UNKNOWN: f64 = 1.0;
/// Singular values below this share of the largest one belong to what no reading tells.
const SINGULAR: f64 = 1e-12;

/// Gains and linearity as a ladder of overlapping exposures of one steady light tells them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ladder {
    /// What the gain steps really amplify.
    pub(super) gains: [f64; 3],
    /// Relative standard uncertainty of each.
    pub(super) u_gains: [f64; 3],
    /// Share of the counts that is lost at full scale.
    pub(super) loss: f64,
    /// Standard uncertainty of that share.
    pub(super) u_loss: f64,
}

/// One reading of a ladder.
struct Rung {
    gain: Gain,
    /// Time × nominal gain × lamp output, µs.
    exposure_us: f64,
    /// Counts above the dark level; of a channel outside [`SHARES`] `None`.
    net: [Option<f64>; 3],
    /// Counts of dark current.
    dark: [f64; 3],
    /// Standard uncertainty of the dark level, counts.
    u_dark: [f64; 3],
    /// Relative standard uncertainty of the lamp output by the monitor, for all three channels the same.
    u_monitor: f64,
}

impl Rung {
    fn new(gain: Gain, rate: &Rate, full_scale: f64) -> Self {
        Self {
            gain,
            exposure_us: rate.scale.recip(),
            net: rate
                .net
                .map(|net| SHARES.contains(&(net / full_scale)).then_some(net)),
            dark: rate.current,
            u_dark: rate.u_dark.map(|u| u / rate.scale),
            u_monitor: rate.u_monitor,
        }
    }

    fn tells(&self) -> bool {
        self.net.iter().any(Option::is_some)
    }
}

impl Ladder {
    /// Fits what the photometer shows of the true signal: level · gain · exposure, less what is lost of it. `rates` were
    /// worked out with the nominal gains and no loss.
    ///
    /// The unknowns are the levels of the three channels and the gain steps, as logarithms, the loss, and by how much the
    /// dark level of each gain and channel is off, which its uncertainty bounds. All are found together by weighted least
    /// squares (Gauss and Newton, each step by a singular value decomposition), so that the loss is that of the signal
    /// and its uncertainty holds what the levels leave open. The weights are those of the fitted signal, not of the noisy
    /// counts. The monitor's noise is the same in all channels of a reading, and is taken so. Where the readings scatter
    /// more than the rig file's noise explains, the uncertainties grow with it.
    ///
    /// # Errors
    /// Readings that do not tell the loss: too few, or all of much the same exposure.
    pub(super) fn fit(file: &RigFile, rates: &[(Gain, Rate)]) -> Result<Self, RigError> {
        let full_scale = f64::from(file.photometer.full_scale);
        let rungs: Vec<Rung> = rates
            .iter()
            .map(|(gain, rate)| Rung::new(*gain, rate, full_scale))
            .filter(Rung::tells)
            .collect();
        let fit = Fit::new(file, &rungs);
        let solved = fit.solve().filter(|solved| solved.u(fit.loss()) < UNKNOWN);
        let solved = solved.ok_or_else(|| RigError::Calibration {
            what: "ladder of exposures",
            why: format!(
                "{} of its {} readings show between 0.2 % and 97 % of full scale, and they do not tell how much is lost \
                 there; readings of one gain at several exposures are needed",
                rungs.len(),
                rates.len()
            ),
        })?;
        let mut gains = Gain::ALL.map(Gain::factor);
        let mut u_gains = Gain::ALL.map(|gain| file.uncertainty.of_gain(gain));
        let u_base = fit.base().map_or(0.0, |base| file.uncertainty.of_gain(base));
        for gain in Gain::ALL {
            if let Some(column) = fit.gain(gain) {
                gains[gain as usize] *= solved.values[column].exp();
                u_gains[gain as usize] = solved.u(column).hypot(u_base);
            }
        }
        Ok(Self {
            gains,
            u_gains,
            loss: solved.values[fit.loss()],
            u_loss: solved.u(fit.loss()),
        })
    }
}

/// The unknowns of a ladder by their columns: the levels of the channels, the gains but the weakest, the loss, and the
/// dark level of each gain and channel.
struct Fit<'a> {
    file: &'a RigFile,
    rungs: &'a [Rung],
    /// The gains that have readings, ascending; the others are told by the weakest of them.
    gains: Vec<Gain>,
}

/// Values of the unknowns and the square roots of their variances' matrix.
struct Solved {
    values: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Solved {
    fn u(&self, column: usize) -> f64 {
        self.covariance[(column, column)].sqrt()
    }
}

impl<'a> Fit<'a> {
    fn new(file: &'a RigFile, rungs: &'a [Rung]) -> Self {
        let present: BTreeSet<usize> = rungs.iter().map(|rung| rung.gain as usize).collect();
        Self {
            file,
            rungs,
            gains: present.into_iter().map(|step| Gain::ALL[step]).collect(),
        }
    }

    /// The weakest gain that has readings.
    fn base(&self) -> Option<Gain> {
        self.gains.first().copied()
    }

    /// Column of a gain's logarithm over its nominal factor; `None` of the weakest, and of those without a reading.
    fn gain(&self, gain: Gain) -> Option<usize> {
        let place = self.gains.iter().position(|&of| of == gain)?;
        (place > 0).then(|| 3 + place - 1)
    }

    fn loss(&self) -> usize {
        3 + self.gains.len().saturating_sub(1)
    }

    fn dark(&self, gain: Gain, channel: usize) -> usize {
        let place = self.gains.iter().position(|&of| of == gain).unwrap_or(0);
        self.loss() + 1 + 3 * place + channel
    }

    fn columns(&self) -> usize {
        self.loss() + 1 + 3 * self.gains.len()
    }

    /// A start: no loss, nominal gains, and the mean level of each channel.
    fn start(&self) -> Option<DVector<f64>> {
        let mut values = DVector::zeros(self.columns());
        for c in 0..3 {
            let levels = self
                .rungs
                .iter()
                .filter_map(|rung| Some(rung.net[c]? / rung.exposure_us));
            let (sum, n) = levels.fold((0.0, 0.0), |(sum, n), level| (sum + level, n + 1.0));
            if n == 0.0 {
                return None;
            }
            values[c] = f64::ln(sum / n);
        }
        Some(values)
    }

    /// The unknowns with their covariance; `None` where the readings do not tell them all, or the fit does not settle.
    fn solve(&self) -> Option<Solved> {
        let mut values = self.start()?;
        for _ in 0..STEPS {
            let (design, residuals) = self.equations(&values)?;
            if design.nrows() < design.ncols() {
                return None;
            }
            let chi_squared = residuals.norm_squared();
            let svd = design.svd(true, true);
            let least = SINGULAR * svd.singular_values.max();
            if svd.singular_values.min() <= least {
                return None;
            }
            let step = svd.solve(&residuals, least).ok()?;
            values += &step;
            if !step.amax().is_finite() {
                return None;
            }
            if step.amax() < SETTLED {
                let rows = svd.v_t?;
                let scaled = DMatrix::from_fn(rows.nrows(), rows.ncols(), |i, j| {
                    rows[(i, j)] / svd.singular_values[i]
                });
                // Each dark level has its own bound, and is no freedom less.
                let seen: usize = self
                    .rungs
                    .iter()
                    .map(|rung| rung.net.iter().flatten().count())
                    .sum();
                let free = seen.saturating_sub(self.loss() + 1).max(1);
                let scatter = (chi_squared / free as f64).max(1.0);
                return Some(Solved {
                    values,
                    covariance: scaled.tr_mul(&scaled) * scatter,
                });
            }
        }
        None
    }

    /// The linearised equations at some values of the unknowns, in units of standard deviations; `None` where they are
    /// far from any photometer.
    fn equations(&self, values: &DVector<f64>) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let mut rows = Vec::new();
        let mut residuals = Vec::new();
        for rung in self.rungs {
            let (design, residual) = self.reading(rung, values)?;
            rows.extend(design);
            residuals.extend(residual);
        }
        for column in self.loss() + 1..self.columns() {
            let mut bound = RowDVector::zeros(self.columns());
            bound[column] = 1.0;
            rows.push(bound);
            residuals.push(-values[column]);
        }
        Some((DMatrix::from_rows(&rows), DVector::from_vec(residuals)))
    }

    /// The equations of one reading: its channels, made independent of the monitor's noise, which they share.
    fn reading(&self, rung: &Rung, values: &DVector<f64>) -> Option<([RowDVector<f64>; 3], [f64; 3])> {
        let known = &self.file.uncertainty;
        let factor = rung.gain.factor();
        let linearity = Linearity {
            loss: values[self.loss()],
            full_scale: f64::from(self.file.photometer.full_scale),
        };
        let mut variance = Matrix3::identity();
        let mut shared = Vector3::zeros();
        let mut residual = Vector3::zeros();
        let mut design = DMatrix::zeros(3, self.columns());
        for c in 0..3 {
            let Some(net) = rung.net[c] else { continue };
            let gain = self.gain(rung.gain).map_or(0.0, |column| values[column]);
            let dark = rung.dark[c];
            let signal = (values[c] + gain).exp() * rung.exposure_us;
            let slope = linearity.slope(signal + dark);
            let of_dark = self.dark(rung.gain, c);
            let shown = linearity.shown(signal + dark) - linearity.shown(dark);
            residual[c] = net - shown - values[of_dark] * rung.u_dark[c];
            design[(c, c)] = signal * slope;
            if let Some(column) = self.gain(rung.gain) {
                design[(c, column)] = signal * slope;
            }
            design[(c, self.loss())] = (dark * dark - (signal + dark).powi(2)) / linearity.full_scale;
            design[(c, of_dark)] = rung.u_dark[c];
            let converter = known.variance(0.0, factor);
            let shot = known.variance(signal + dark, factor) - converter;
            variance[(c, c)] = shot * slope * slope + converter;
            shared[c] = rung.u_monitor * signal * slope;
        }
        let root = (variance + shared * shared.transpose()).cholesky()?.l();
        let residual = root.solve_lower_triangular(&residual)?;
        let design = root.solve_lower_triangular(&design)?;
        Some(([0, 1, 2].map(|c| design.row(c).into_owned()), residual.into()))
    }
}
