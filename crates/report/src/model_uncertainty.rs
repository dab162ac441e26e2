use brdf::{Brdf, MerlTable};
use glam::DVec3;
use pdv::metric::quantile;
use pdv::{Alternatives, Model};
use serde::Serialize;

use crate::derive::Sweeps;
use crate::uncertainty::COVERAGE;
use crate::{Measurement, MonteCarlo};

/// So many times f the uncertainty may be before nothing is stated any more.
const MOST: f64 = 10.0;
/// What stands for "nothing can be stated", as MERL marks what is not valid.
const NOT_STATED: f64 = -1.0;
/// Of so many entries of a table one is looked at for the median: eighty thousand, which do for three digits.
const EVERY: usize = 17;

/// The expanded uncertainty, k = 2, of a reconstruction: of its readings, their angles and the calibration by Monte Carlo,
/// and of the model by what other models the same readings allow.
///
/// Both are of ln f. As a [`Brdf`] it is what brdf.uncertainty.binary holds: u = f·(e^U − 1), sr⁻¹, so that f·e^(−U) …
/// f·e^U lies within f ± u; −1 in a channel where u would be more than ten times f.
pub struct ModelUncertainty<'a> {
    model: &'a dyn Model,
    draws: &'a MonteCarlo,
    alternatives: Option<Alternatives>,
}

impl<'a> ModelUncertainty<'a> {
    /// The uncertainty of a model of some sweeps, with the draws of their readings.
    pub fn new(model: &'a dyn Model, sweeps: &Sweeps, draws: &'a MonteCarlo) -> Self {
        Self {
            model,
            draws,
            // There are none only where the readings make no model at all.
            alternatives: Alternatives::new(&sweeps.planes, &sweeps.arc).ok(),
        }
    }

    /// Expanded uncertainty, k = 2, of ln f between two unit vectors.
    pub fn u_log(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        self.u_log_of(self.model.eval(incident, exitant), incident, exitant)
    }

    fn u_log_of(&self, f: DVec3, incident: DVec3, exitant: DVec3) -> DVec3 {
        let readings = self.draws.u_log(incident, exitant);
        let model = self.alternatives.as_ref().map_or(DVec3::ZERO, |alternatives| {
            COVERAGE * alternatives.u_log(f, incident, exitant)
        });
        (readings * readings + model * model).map(f64::sqrt)
    }
}

impl Brdf for ModelUncertainty<'_> {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let f = self.model.eval(incident, exitant);
        let relative = self.u_log_of(f, incident, exitant).map(f64::exp_m1);
        let stated = relative.cmple(DVec3::splat(MOST)) & f.cmpgt(DVec3::ZERO);
        DVec3::select(stated, f * relative, DVec3::splat(NOT_STATED))
    }

    fn valid(&self, incident: DVec3, exitant: DVec3) -> bool {
        self.model.valid(incident, exitant)
    }
}

/// What brdf.uncertainty.binary holds, in words and figures: brdf.uncertainty.json.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UncertaintySummary {
    /// What an entry of the file is.
    pub holds: &'static str,
    /// Coverage factor.
    pub coverage_factor: f64,
    /// What the uncertainty is made of, by what it is worked out from.
    pub readings: [&'static str; 6],
    /// Likewise, of the model.
    pub model: [&'static str; 6],
    /// What it leaves out.
    pub leaves_out: [&'static str; 3],
    /// What −1 means.
    pub flag: &'static str,
    /// Share of the entries with a reflectance for which nothing is stated, 0 … 1.
    pub flagged: f64,
    /// Median of u/f over the others; `None` where there are none.
    pub median_relative: Option<f64>,
    /// Per channel the least uncertainty of a reading that was not told from black, sr⁻¹: where nothing is stated and f is
    /// below it, the specimen is as dark as that. `None` where every reading was told from black.
    pub black_below_per_sr: [Option<f64>; 3],
}

impl UncertaintySummary {
    /// The summary of a reconstruction and its uncertainty, both as tables.
    pub(crate) fn new(f: &MerlTable, u: &MerlTable, measurements: &[Measurement]) -> Self {
        let (mut entries, mut flagged) = (0_u32, 0_u32);
        let mut relative = Vec::new();
        let both = f.nodes().iter().zip(u.nodes()).step_by(EVERY);
        for (f, u) in both.flat_map(|(f, u)| f.iter().zip(u)) {
            if *f < 0.0 {
                continue;
            }
            entries += 1;
            if *u < 0.0 {
                flagged += 1;
            } else {
                relative.push(u / f);
            }
        }
        Self {
            holds: "expanded uncertainty u of each entry of brdf.binary, in 1/sr: the truth should be within f - u … f + u \
                    95 times of 100; in ln f the interval is as wide on both sides, U = ln(1 + u/f)",
            coverage_factor: COVERAGE,
            readings: [
                "counting noise, of each reading",
                "dark level and lamp, of each sweep",
                "responsivity, linearity, gain steps, colour mixing and stray light, of the whole run",
                "the angle of each arm in each reading, by the slope of ln f there",
                "the zeros of both arms, of the whole run",
                "what the apertures blur, by the lobe that the readings show",
            ],
            model: [
                "a quarter of what changes without a plane, or with a single plane without a side",
                "a quarter of what changes without every second reading of the planes",
                "a quarter of what changes without every second reading of the arc",
                "the distance to the model whose shape is not fitted",
                "the distance to the model over half and difference angle alone",
                "7.5 % for what no reading in the plane tells",
            ],
            leaves_out: [
                "a lobe narrower than the gaps between the readings that none of them met",
                "a specimen that looks different when it is turned about its normal",
                "places of the specimen other than the one that was lit",
            ],
            flag: "-1: f is not valid there, or 0, or u would be more than ten times f, and nothing is stated",
            flagged: f64::from(flagged) / f64::from(entries.max(1)),
            median_relative: quantile(&mut relative, 0.5),
            black_below_per_sr: [0, 1, 2].map(|c| black_below(measurements, c)),
        }
    }
}

/// The least uncertainty of a reading of a channel that was not told from black, sr⁻¹.
fn black_below(measurements: &[Measurement], channel: usize) -> Option<f64> {
    let told = |m: &Measurement| Some((m.rgb()?[channel], m.u_of_black()?[channel]));
    let counts = measurements.iter().filter(|m| m.reading.accepted && !m.shadowed);
    let dark = counts.filter_map(told).filter(|(f, u)| f <= u).map(|(_, u)| u);
    dark.reduce(f64::min)
}
