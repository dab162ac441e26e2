use glam::DVec3;
use pdv::{FactorTable, Model, Observation};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rig::{RigFile, ZeroUncertainty};
use sweep::{Job, Sweep};

use crate::Measurement;
use crate::derive::Sweeps;
use crate::measurement::{observation, visits};
use crate::uncertainty::{COVERAGE, angle_rad, zeros};

/// Draws: the standard deviation over them is known to 13 %.
const DRAWS: usize = 32;
/// Draws that a table is made of, which takes a million evaluations of each: known to 18 %.
const TABLE_DRAWS: usize = 16;
/// The least reflectance, sr⁻¹, that has a logarithm.
const LEAST: f64 = 1e-9;
/// Seed, so that a run says the same whenever it is reported.
const SEED: u64 = 0x676f_6e69_6f64;

/// The reconstruction made again of readings that differ from the measured ones as they may be wrong: what a result's
/// spread over these models is, is its uncertainty.
///
/// Errors are drawn in ln f, so that no draw is negative, and what is common to readings stays common: responsivity, linearity, each gain step, colour mixing, stray light, the alignment
/// and the difference of the arms' zeros are drawn once a draw, the lamp and the dark level once for each sweep; counting noise and an arm's angle in each reading for themselves.
pub struct MonteCarlo {
    models: Vec<Box<dyn Model>>,
}

impl MonteCarlo {
    /// Draws of a job's measurements. Empty where no model can be made of them.
    pub fn new(job: &Job, measurements: &[Measurement], records: &[capture::Record], rig: &RigFile) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        let zeros = zeros(records, rig);
        let alignment = measurements.first().map(|m| m.alignment.as_ref());
        let draw = |_| {
            let common = Common::draw(&mut random, zeros);
            let turned = alignment.map(|alignment| alignment.draw(&mut random));
            let mut sweep = |sweep: Sweep| -> Vec<Observation> {
                let of_sweep: [DVec3; 2] = [normal3(&mut random), normal3(&mut random)];
                let mut draw = |visit: &Vec<usize>| {
                    observation(measurements, visit, |m| {
                        let off = turned
                            .as_ref()
                            .map_or([0.0; 2], |turned| turned.of(sweep, m.lean));
                        drawn(m, common.error(m, of_sweep, off, angle_rad(m, rig), &mut random)?)
                    })
                };
                visits(measurements, sweep).iter().filter_map(&mut draw).collect()
            };
            let sweeps = Sweeps {
                planes: job.curves().map(&mut sweep).collect(),
                arc: sweep(Sweep::Arc),
            };
            sweeps.model(job).ok()
        };
        Self {
            models: (0..DRAWS).filter_map(draw).collect(),
        }
    }

    /// Expanded uncertainty, k = 2, of every row of a model's factors; `None` where a draw has other rows.
    pub fn factors(&self, of: &[FactorTable]) -> Option<Vec<Vec<DVec3>>> {
        let draws: Vec<Vec<FactorTable>> = self.models.iter().map(|model| model.factors()).collect();
        let table = |t: usize| {
            let row = |r: usize| {
                let values: Option<Vec<DVec3>> = draws
                    .iter()
                    .map(|draw| Some(draw.get(t)?.rows.get(r)?.1))
                    .collect();
                values.map(|values| expanded(&values))
            };
            (0..of[t].rows.len()).map(row).collect::<Option<Vec<DVec3>>>()
        };
        (0..of.len()).map(table).collect()
    }

    /// Expanded uncertainty, k = 2, of ln f between two unit vectors, by the first half of the draws; 0 of fewer than two.
    pub(crate) fn u_log(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        let draws = self.models.iter().take(TABLE_DRAWS);
        let (mut n, mut mean, mut squares) = (0.0, DVec3::ZERO, DVec3::ZERO);
        // Welford's: a million times, without a list.
        for model in draws {
            n += 1.0;
            let value = model.eval(incident, exitant).map(|f| f.max(LEAST).ln());
            let off = value - mean;
            mean += off / n;
            squares += off * (value - mean);
        }
        let variance = squares / f64::max(n - 1.0, 1.0);
        COVERAGE * variance.max(DVec3::ZERO).map(f64::sqrt)
    }

    /// Expanded uncertainty, k = 2, of what a model says of something; `None` where a draw says nothing.
    pub fn of(&self, value: impl Fn(&dyn Model) -> Option<DVec3>) -> Option<DVec3> {
        let values: Option<Vec<DVec3>> = self.models.iter().map(|model| value(model.as_ref())).collect();
        values.map(|values| expanded(&values))
    }
}

/// What all readings of a draw share, in standard uncertainties.
struct Common {
    reference: DVec3,
    linearity: f64,
    gain: [f64; 3],
    colour: DVec3,
    stray: f64,
    aperture: f64,
    bend: f64,
    /// Half the difference of the arms' zeros, rad.
    apart: f64,
}

impl Common {
    fn draw(random: &mut ChaCha8Rng, zeros: ZeroUncertainty) -> Self {
        Self {
            // A reference is as wrong in one colour as in the others, more or less.
            reference: DVec3::splat(normal(random)),
            linearity: normal(random),
            gain: [normal(random), normal(random), normal(random)],
            colour: normal3(random),
            stray: normal(random),
            aperture: normal(random),
            bend: normal(random),
            apart: zeros.half_difference_rad * normal(random),
        }
    }

    /// By how much a reading is off.
    fn error(
        &self,
        m: &Measurement,
        [dark, drift]: [DVec3; 2],
        [off_light, off_sensor]: [f64; 2],
        angle: [f64; 2],
        random: &mut ChaCha8Rng,
    ) -> Option<DVec3> {
        let budget = m.budget?;
        let u = DVec3::from_array;
        let gain: DVec3 = budget
            .gain
            .iter()
            .zip(self.gain)
            .map(|(&step, draw)| u(step) * draw)
            .sum();
        // A channel takes from the other colours where they are brighter, and gives where they are darker.
        let raw = m.raw?;
        let others = (DVec3::splat(raw.element_sum()) - 3.0 * raw).signum();
        let light = off_light + self.apart + angle[0] * normal(random);
        let sensor = off_sensor - self.apart + angle[1] * normal(random);
        Some(
            u(budget.counting) * normal3(random)
                + u(budget.dark) * dark
                + u(budget.drift) * drift
                + u(budget.reference) * self.reference
                + u(budget.linearity) * self.linearity
                + gain
                + u(budget.colour) * others * self.colour
                + u(budget.stray) * self.stray
                + m.sensitivity.arms[0] * light
                + m.sensitivity.arms[1] * sensor
                + m.sensitivity.bend * self.bend
                + m.sensitivity.aperture * self.aperture,
        )
    }
}

/// A reflectance that is off by an error, drawn in ln f: where the error is small beside it the sum of both, and above 0
/// wherever it is not. Its spread is that of a logarithm whose reflectance has the standard uncertainty of the reading;
/// what cannot be told from black counts as half of that.
fn drawn(m: &Measurement, error: DVec3) -> Option<DVec3> {
    let (f, u) = (m.rgb()?, m.u? / COVERAGE);
    let channel = |f: f64, u: f64, error: f64| {
        if u <= 0.0 {
            return f;
        }
        let centre = f.max(0.5 * u);
        let spread = (u / centre).powi(2).ln_1p().sqrt();
        centre * (spread * error / u).exp()
    };
    Some(DVec3::new(
        channel(f.x, u.x, error.x),
        channel(f.y, u.y, error.y),
        channel(f.z, u.z, error.z),
    ))
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

fn normal3(random: &mut ChaCha8Rng) -> DVec3 {
    DVec3::new(normal(random), normal(random), normal(random))
}

/// k times the standard deviation; 0 of fewer than two values.
fn expanded(values: &[DVec3]) -> DVec3 {
    let n = values.len() as f64;
    if n < 2.0 {
        return DVec3::ZERO;
    }
    let mean = values.iter().sum::<DVec3>() / n;
    let squares: DVec3 = values.iter().map(|value| (*value - mean) * (*value - mean)).sum();
    COVERAGE * DVec3::from_array((squares / (n - 1.0)).to_array().map(f64::sqrt))
}
