use arms::{Arm, ArmAngle, Pose};
use capture::Reading;
use nalgebra::{DMatrix, DVector};
use pdv::{Centre, Crossing, NarrowLobe, centres};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use rig::{Approach, RigFile, ZeroUncertainty};
use sweep::Sweep;

use crate::Measurement;

/// Places of the unknowns: by how much the specimen and the zeros turn all angles, by how much each arm lags behind its
/// encoder, and then two for each sweep, by how much both encoders err in it.
const TURN: usize = 0;
const LAG: usize = 1;
const OF_SWEEPS: usize = 3;
/// Standard uncertainty of how far an arm lags behind its encoder, as a share of half the play that its servo may have, before a
/// lobe tells it: a servo may have less play than its manual says, and none is taken to be sure to have any.
const PLAY_KNOWN: f64 = 0.85;
/// An arm leans to one side of its play from this share of it on.
const LEANS: f64 = 0.5;
/// By how many times as much as the rig file says encoders may err, where the lobes of the sweeps disagree by that.
const ENCODERS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

/// By how much what the encoders said is off the angles at the specimen: what the run's own lobes say of that, together
/// with what is known beforehand.
///
/// The unknowns are the turn that a tilted specimen and the arms' zeros give all angles, by how much each arm lags behind its
/// encoder in the direction in which it moved last, which is half of its play, and by how much each encoder errs
/// where the arms stand for a sweep. Each is known to a standard uncertainty by rig file and certificate; a lobe that stands
/// off the mirror direction tells a sum of them. What comes of both is the best linear estimate (Gauss and Markov).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Alignment {
    /// The sweeps that have encoder errors of their own.
    sweeps: Vec<Sweep>,
    /// Best estimate of each unknown, rad.
    mean: DVector<f64>,
    /// Its covariance, rad².
    covariance: DMatrix<f64>,
    /// What makes of independent standard normal numbers such ones that have the covariance.
    root: DMatrix<f64>,
    /// Of which sweeps the lobe tells where it stands, in which direction of the light arm, and by how much that is off what
    /// all unknowns together say, and by how much it may be.
    pub(crate) told: Vec<Told>,
    /// The lobe, where it is narrow.
    pub(crate) lobe: Option<NarrowLobe>,
    /// Standard uncertainty of the turn before, rad.
    pub(crate) u_turn_before_rad: f64,
}

/// What the lobe of a sweep tells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Told {
    pub(crate) sweep: Sweep,
    /// Direction in which each arm moved last, −1 … 1.
    pub(crate) lean: [f64; 2],
    /// Where the lobe stands by the encoders.
    pub(crate) centre: Centre,
    /// How far from where the alignment puts it, rad.
    pub(crate) left_rad: f64,
}

impl Alignment {
    /// Of angles that are right.
    pub(crate) fn none() -> Self {
        Self {
            sweeps: Vec::new(),
            mean: DVector::zeros(OF_SWEEPS),
            covariance: DMatrix::zeros(OF_SWEEPS, OF_SWEEPS),
            root: DMatrix::zeros(OF_SWEEPS, OF_SWEEPS),
            told: Vec::new(),
            lobe: None,
            u_turn_before_rad: 0.0,
        }
    }

    /// From measurements that are aligned by the certificate alone.
    pub(crate) fn new(measurements: &[Measurement], rig: &RigFile, zeros: ZeroUncertainty) -> Self {
        let sweeps = sweeps(measurements);
        let curves = curves(measurements);
        let points: Vec<Vec<Crossing>> = curves.iter().map(|curve| curve.crossings(measurements)).collect();
        let found = centres(&points);
        let seen: Vec<(&Curve, Centre)> = curves
            .iter()
            .zip(found.curves)
            .filter_map(|(curve, centre)| Some((curve, centre?)))
            .collect();
        let columns = OF_SWEEPS + 2 * sweeps.len();
        let mut rows = DMatrix::zeros(seen.len(), columns);
        for (row, (curve, _)) in seen.iter().enumerate() {
            let errs = errors(&sweeps, curve.sweep, curve.lean);
            // The signed half angle is half the sum of both arms' angles.
            for column in 0..columns {
                rows[(row, column)] = 0.5 * (errs[0][column] + errs[1][column]);
            }
        }
        let prior = |encoders: f64| Prior::new(rig, zeros, columns, encoders);
        // A narrow lobe that none of its curves can place says that the angles scatter; by how much, it does not say.
        let untold = match found.lobe {
            Some(_) => ENCODERS[ENCODERS.len() - 1],
            None => ENCODERS[0],
        };
        let best = ENCODERS
            .iter()
            .filter(|_| !seen.is_empty())
            .map(|&encoders| prior(encoders).told(&rows, &seen))
            .max_by(|a, b| a.likelihood.total_cmp(&b.likelihood));
        let Posterior { mean, covariance, .. } = best.unwrap_or_else(|| prior(untold).untold());
        let told = seen
            .iter()
            .enumerate()
            .map(|(row, &(curve, centre))| Told {
                sweep: curve.sweep,
                lean: curve.lean,
                centre,
                left_rad: centre.half_rad - rows.row(row).transpose().dot(&mean),
            })
            .collect();
        Self {
            sweeps,
            root: root(&covariance),
            mean,
            covariance,
            told,
            lobe: found.lobe,
            u_turn_before_rad: prior(1.0).variance[TURN].sqrt(),
        }
    }

    /// Where the arms were at the specimen.
    pub(crate) fn aligned(&self, pose: Pose, sweep: Sweep, lean: [f64; 2]) -> Pose {
        let off = errors(&self.sweeps, sweep, lean).map(|of| of.dot(&self.mean));
        Pose {
            light: ArmAngle::from_rad(pose.light.rad() - off[0]),
            sensor: ArmAngle::from_rad(pose.sensor.rad() - off[1]),
        }
    }

    /// Variance of a value that changes by so much for each radian that the light and the sensor are off.
    pub(crate) fn variance(&self, [light, sensor]: [f64; 2], sweep: Sweep, lean: [f64; 2]) -> f64 {
        let [of_light, of_sensor] = errors(&self.sweeps, sweep, lean);
        let slope = of_light * light + of_sensor * sensor;
        (slope.transpose() * &self.covariance * &slope)[(0, 0)].max(0.0)
    }

    /// What all unknowns may be off together, rad.
    pub(crate) fn draw(&self, random: &mut impl Rng) -> Draw<'_> {
        let normal = DVector::from_fn(self.mean.len(), |_, _| StandardNormal.sample(random));
        Draw {
            sweeps: &self.sweeps,
            off: &self.root * normal,
        }
    }

    /// By how much the specimen and the zeros turn all angles, and its standard uncertainty, rad.
    pub(crate) fn turn_rad(&self) -> [f64; 2] {
        [self.mean[TURN], self.covariance[(TURN, TURN)].sqrt()]
    }

    /// By how much an arm lags behind its encoder, half of its play, and its standard uncertainty, rad.
    pub(crate) fn lag_rad(&self, arm: Arm) -> [f64; 2] {
        let of = LAG + arm as usize;
        [self.mean[of], self.covariance[(of, of)].sqrt()]
    }
}

/// One draw of an alignment.
pub(crate) struct Draw<'a> {
    sweeps: &'a [Sweep],
    off: DVector<f64>,
}

impl Draw<'_> {
    /// By how much light and sensor are off in a reading, rad.
    pub(crate) fn of(&self, sweep: Sweep, lean: [f64; 2]) -> [f64; 2] {
        errors(self.sweeps, sweep, lean).map(|of| of.dot(&self.off))
    }
}

/// How much of each unknown is in the angles of light and sensor.
fn errors(sweeps: &[Sweep], sweep: Sweep, lean: [f64; 2]) -> [DVector<f64>; 2] {
    let place = sweeps.iter().position(|&known| known == sweep);
    Arm::BOTH.map(|arm| {
        let mut of = DVector::zeros(OF_SWEEPS + 2 * sweeps.len());
        of[TURN] = 1.0;
        of[LAG + arm as usize] = lean[arm as usize];
        if let Some(place) = place {
            of[OF_SWEEPS + 2 * place + arm as usize] = 1.0;
        }
        of
    })
}

/// What is known of the unknowns before a lobe says more.
struct Prior {
    variance: DVector<f64>,
}

/// What is known of them after that.
struct Posterior {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Logarithm of how likely what the lobes say was, but for a constant.
    likelihood: f64,
}

impl Prior {
    fn new(rig: &RigFile, zeros: ZeroUncertainty, unknowns: usize, encoders: f64) -> Self {
        let known = &rig.uncertainty;
        let encoder = (encoders * known.encoder_rad).powi(2);
        let mut variance = DVector::from_element(unknowns, encoder);
        variance[TURN] = zeros.half_sum_rad.powi(2) + known.tilt_rad.powi(2);
        for arm in Arm::BOTH {
            let half = known.play_rad[arm as usize] / 2.0;
            variance[LAG + arm as usize] = (PLAY_KNOWN * half).powi(2);
        }
        Self { variance }
    }

    fn untold(self) -> Posterior {
        Posterior {
            mean: DVector::zeros(self.variance.len()),
            covariance: DMatrix::from_diagonal(&self.variance),
            likelihood: 0.0,
        }
    }

    fn told(self, rows: &DMatrix<f64>, seen: &[(&Curve, Centre)]) -> Posterior {
        let before = DMatrix::from_diagonal(&self.variance);
        let noise = DMatrix::from_diagonal(&DVector::from_iterator(
            seen.len(),
            seen.iter().map(|(_, centre)| centre.u_rad.powi(2).max(1e-18)),
        ));
        let says = DVector::from_iterator(seen.len(), seen.iter().map(|(_, centre)| centre.half_rad));
        let spread = rows * &before * rows.transpose() + noise;
        let Some(spread) = spread.cholesky().filter(|_| !seen.is_empty()) else {
            return self.untold();
        };
        let gain = &before * rows.transpose() * spread.inverse();
        let likelihood = -0.5 * says.dot(&spread.solve(&says)) - spread.l().diagonal().map(f64::ln).sum();
        let covariance = &before - &gain * rows * &before;
        Posterior {
            mean: &gain * says,
            covariance: (&covariance + covariance.transpose()) * 0.5,
            likelihood,
        }
    }
}

/// A matrix whose product with its transpose is a covariance, of which some unknowns may be certain.
fn root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = covariance.clone().symmetric_eigen();
    let scale = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * DMatrix::from_diagonal(&scale)
}

/// The sweeps of measurements that were lit.
fn sweeps(measurements: &[Measurement]) -> Vec<Sweep> {
    let mut sweeps: Vec<Sweep> = Vec::new();
    for m in measurements.iter().filter(|m| m.reading.lamp) {
        if !sweeps.contains(&m.reading.sweep) {
            sweeps.push(m.reading.sweep);
        }
    }
    sweeps
}

/// Readings of a plane during which the arms leant the same way.
struct Curve {
    sweep: Sweep,
    lean: [f64; 2],
    members: Vec<usize>,
}

impl Curve {
    fn crossings(&self, measurements: &[Measurement]) -> Vec<Crossing> {
        let crossing = |&i: &usize| {
            let m = &measurements[i];
            let counting = m.budget.map_or([0.0; 3], |budget| budget.counting);
            Some(Crossing {
                half_rad: (m.pose.light.rad() + m.pose.sensor.rad()) / 2.0,
                difference_rad: (m.pose.sensor.rad() - m.pose.light.rad()).abs() / 2.0,
                f: m.rgb()?.element_sum() / 3.0,
                u: counting.iter().map(|u| u * u).sum::<f64>().sqrt() / 3.0,
            })
        };
        self.members.iter().filter_map(crossing).collect()
    }
}

/// The readings of planes that count, by sweep and the way the arms leant.
fn curves(measurements: &[Measurement]) -> Vec<Curve> {
    let mut curves: Vec<Curve> = Vec::new();
    for (i, m) in measurements.iter().enumerate() {
        let [light, sensor] = m.lean;
        let counts = m.reading.accepted && !m.shadowed && m.rgb().is_some();
        if !counts || !m.reading.sweep.is_curve() || light.abs() < LEANS {
            continue;
        }
        let lean = [
            light.signum(),
            if sensor.abs() < LEANS {
                0.0
            } else {
                sensor.signum()
            },
        ];
        let curve = curves
            .iter_mut()
            .find(|curve| curve.sweep == m.reading.sweep && curve.lean == lean);
        match curve {
            Some(curve) => curve.members.push(i),
            None => curves.push(Curve {
                sweep: m.reading.sweep,
                lean,
                members: vec![i],
            }),
        }
    }
    curves
}

/// Which way each arm leant against its encoder in each reading, −1 … 1, by the way it came: +1 where the encoder went
/// on towards larger angles until all play was taken up. 0 where nobody knows.
pub(crate) fn leans(readings: &[&Reading], rig: &RigFile) -> Vec<[f64; 2]> {
    let mut at: Option<Pose> = None;
    let mut off_rad = [0.0; 2];
    readings
        .iter()
        .map(|reading| {
            let before = at.replace(reading.measured).unwrap_or(reading.measured);
            let at_rest = reading.swept_rad.is_none();
            Arm::BOTH.map(|arm| {
                let half_rad = rig.uncertainty.play_rad[arm as usize] / 2.0;
                let off_rad = &mut off_rad[arm as usize];
                let moved_rad = reading.measured.angle(arm) - before.angle(arm);
                *off_rad = (*off_rad + moved_rad).clamp(-half_rad, half_rad);
                match rig.motion.approach {
                    Approach::Up if at_rest => *off_rad = half_rad,
                    Approach::Down if at_rest => *off_rad = -half_rad,
                    _ => {}
                }
                if half_rad > 0.0 { *off_rad / half_rad } else { 0.0 }
            })
        })
        .collect()
}
