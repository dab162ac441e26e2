//! Parts of a certificate from readings of a standard on the stage.

use arms::Pose;
use glam::{DMat3, DVec3};

use super::Taken;
use super::certificate::{Certificate, Colour, Conditions, Patch, Trap, White, Zero};
use super::ladder::Ladder;
use super::lamp::Lamp;
use super::reduction::Reduction;
use crate::{RigError, RigFile};

/// Patches span the colours where the determinant of their normal matrix is above this share of its trace, cubed.
const SINGULAR: f64 = 1e-9;

/// One geometry of a white reference's certificate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certified {
    /// Light and sensor.
    pub pose: Pose,
    /// Reflectance factor there (π f; 1 for a perfect diffuser), red, green, blue.
    pub reflectance_factor: [f64; 3],
}

/// Readings of a white reference at one geometry, and what different geometries say of it, may differ by so many standard
/// uncertainties and such a share beside: the lamp and the arms are not as steady as counting noise.
const WHITE_SIGMAS: f64 = 8.0;
const WHITE_SHARE: f64 = 0.01;
/// The same share where nothing but visits to a reference pose follows the lamp.
const WHITE_SHARE_VISITS: f64 = 0.05;
/// Scans of a mirror's lobe at different angles may differ by so much in its centre: encoders of real servos are wrong by up
/// to a quarter of a degree either way, and a mirror that moved is off by more.
const MIRROR_DEG: f64 = 0.5;
/// By so many of its standard uncertainties a black trap may give less than no light.
const TRAP_SIGMAS: f64 = 8.0;
/// A mirror's lobe must be seen over at least so many readings.
const MIN_LOBE: usize = 5;
/// Share of the peak below which a reading of a mirror's lobe does not count: the centre of a lobe must not hang on
/// where the scan ends.
const LOBE_FOOT: f64 = 0.02;

impl White {
    /// From readings of a white reference: at certified geometries, of which there may be one or a table, and a ladder
    /// of overlapping exposures at one pose. `u_reference` is the relative standard uncertainty of its certificate.
    /// `readings` are all of the run in the order of their time, dark ones too; `before` is what other
    /// standards said.
    ///
    /// # Errors
    /// No usable reading at a certified geometry, or a ladder that says nothing.
    pub fn measure(
        file: &RigFile,
        readings: &[Taken],
        ladder: &[Taken],
        certified: &[(Certified, Vec<Taken>)],
        u_reference: f64,
        before: &Certificate,
    ) -> Result<Self, RigError> {
        let nominal = Reduction::new(file, None, readings, &[]);
        let rates = ladder.iter().filter_map(|taken| {
            let rate = nominal.rate(taken).ok()?;
            Some((taken.counts.exposure.gain, rate))
        });
        let ladder = Ladder::fit(file, &rates.collect::<Vec<_>>())?;
        let mut white = Self {
            gains: ladder.gains,
            u_gains: ladder.u_gains,
            nonlinearity: ladder.loss,
            u_nonlinearity: ladder.u_loss,
            ..Self::nominal(file)
        };
        let straight = nominal.with_white(white.clone());
        let mut found: Vec<[f64; 3]> = Vec::new();
        let mut geometries = Vec::new();
        let mut tilt: f64 = 0.0;
        let mut u_photometer = [0.0_f64; 3];
        for (at, taken) in certified {
            let (first, mut u_counting) = (found.len(), 0.0_f64);
            for taken in taken {
                let Ok(rate) = straight.rate(taken) else { continue };
                let pose = before.aligned(taken.pose);
                let stray = before.trap.as_ref().map_or([0.0; 3], |trap| trap.at(pose));
                let arm = file.calibration.filling.arm(pose).rad();
                let cosine = arm.cos();
                tilt = tilt.max(arm.tan().abs());
                for (c, u) in u_photometer.iter_mut().enumerate() {
                    let u_gain = rate.u_gain.iter().map(|step| step[c]).fold(0.0, f64::max);
                    *u = u.max(rate.u_linearity[c].hypot(u_gain));
                    u_counting = u_counting.max((rate.u_counting[c] / rate.rgb[c]).abs());
                }
                found.push(std::array::from_fn(|c| {
                    let f = at.reflectance_factor[c] / std::f64::consts::PI;
                    (rate.rgb[c] - stray[c]) / (f * cosine)
                }));
            }
            geometries.push(Geometry {
                pose: at.pose,
                said: first..found.len(),
                u_counting,
            });
        }
        if found.is_empty() {
            return Err(RigError::Calibration {
                what: "white reference",
                why: "no usable reading at a certified geometry".to_owned(),
            });
        }
        let u_table = u_reference.hypot(tilt * before.u_zero(file).arm_rad());
        agree(&geometries, &found, u_table, file)?;
        for c in 0..3 {
            let (mean, u) = mean(found.iter().map(|r| r[c]));
            white.responsivity[c] = mean;
            white.u_responsivity[c] = (u / mean).hypot(u_table).hypot(u_photometer[c]);
        }
        white.conditions.temperature_c = temperature_c(readings);
        Ok(white)
    }
}

/// What the readings at one certified geometry say.
struct Geometry {
    pose: Pose,
    /// Which of all responsivities.
    said: std::ops::Range<usize>,
    /// Largest relative standard uncertainty of its counts.
    u_counting: f64,
}

/// Whether the readings at each geometry agree with each other, and the geometries among themselves within the uncertainty of
/// their table.
fn agree(geometries: &[Geometry], found: &[[f64; 3]], u_table: f64, file: &RigFile) -> Result<(), RigError> {
    let share = match file.visits.lamp {
        Lamp::Monitor => WHITE_SHARE,
        Lamp::Visits => WHITE_SHARE_VISITS,
    };
    let refuse = |why: String| {
        Err(RigError::Calibration {
            what: "white reference",
            why,
        })
    };
    for c in 0..3 {
        let all = mean(found.iter().map(|r| r[c])).0;
        for geometry in geometries.iter().filter(|geometry| !geometry.said.is_empty()) {
            let Pose { light, sensor } = geometry.pose;
            let at = format!("at light {:.1}°, sensor {:.1}°", light.deg(), sensor.deg());
            let said = || found[geometry.said.clone()].iter().map(|r| r[c]);
            let (of_it, _) = mean(said());
            let noise = WHITE_SIGMAS * geometry.u_counting + share;
            let off = said().map(|r| (r / of_it - 1.0).abs()).fold(0.0, f64::max);
            if off.is_nan() || off > noise {
                return refuse(format!(
                    "its readings {at} differ by {:.2} % from their mean, {:.2} % would be noise: look for light from outside, a \
                     lamp that is not warm, or a reference that moved, and calibrate again",
                    100.0 * off,
                    100.0 * noise
                ));
            }
            let (off, allowed) = ((of_it / all - 1.0).abs(), noise + WHITE_SIGMAS * u_table);
            if off > allowed {
                return refuse(format!(
                    "what it says {at} differs by {:.2} % from the mean of all geometries, its table and the arms' zeros allow \
                     {:.2} %: compare the table with the certificate, and measure a mirror first",
                    100.0 * off,
                    100.0 * allowed
                ));
            }
        }
    }
    Ok(())
}

impl Trap {
    /// From readings of a black trap at some poses. `readings` are all of the run in the order of their time.
    ///
    /// # Errors
    /// No usable reading.
    pub fn measure(
        file: &RigFile,
        readings: &[Taken],
        trap: &[Taken],
        before: &Certificate,
    ) -> Result<Self, RigError> {
        let reduction = Reduction::new(file, Some(before), readings, &[]);
        let mut points = Vec::new();
        let mut variance = [0.0; 3];
        for taken in trap {
            let Ok(rate) = reduction.rate(taken) else { continue };
            for (sum, u) in variance.iter_mut().zip(rate.u_counting) {
                *sum += u * u;
            }
            for c in 0..3 {
                let noise = TRAP_SIGMAS * rate.u_counting[c].hypot(rate.u_dark[c]);
                if rate.rgb[c] < -noise {
                    return Err(RigError::Calibration {
                        what: "black trap",
                        why: format!(
                            "at light {:.1}°, sensor {:.1}° it gives {:.2e} counts per µs, less than no light by more than the \
                             noise of {noise:.1e}: the dark level was not the one that was subtracted. Darken the room, and \
                             calibrate again",
                            taken.pose.light.deg(),
                            taken.pose.sensor.deg(),
                            rate.rgb[c]
                        ),
                    });
                }
            }
            points.push((before.aligned(taken.pose), rate.rgb));
        }
        if points.is_empty() {
            return Err(RigError::Calibration {
                what: "black trap",
                why: "no usable reading".to_owned(),
            });
        }
        let n = points.len() as f64;
        Ok(Self {
            conditions: Conditions {
                temperature_c: temperature_c(readings),
                ..Conditions::default()
            },
            points,
            u: variance.map(|sum| (sum / n).sqrt()),
        })
    }
}

impl Zero {
    /// From scans of the light across the lobe of a mirror-like specimen, the sensor standing. `readings` are all of
    /// the run in the order of their time.
    ///
    /// The lobe is symmetrical about the mirror direction, so its centre of gravity stands where the true angles add
    /// up to 0.
    ///
    /// # Errors
    /// Too few readings within a lobe.
    pub fn measure(file: &RigFile, readings: &[Taken], scans: &[Vec<Taken>]) -> Result<Self, RigError> {
        let reduction = Reduction::new(file, None, readings, &[]);
        let mut sums = Vec::new();
        for scan in scans {
            let lobe: Vec<(f64, f64)> = scan
                .iter()
                .filter_map(|taken| {
                    let f = reduction.reflectance(taken).ok()?.raw;
                    let sum = taken.pose.light.rad() + taken.pose.sensor.rad();
                    Some((sum, f.iter().sum::<f64>()))
                })
                .collect();
            let peak = lobe.iter().map(|point| point.1).fold(0.0, f64::max);
            let within: Vec<_> = lobe.iter().filter(|point| point.1 > LOBE_FOOT * peak).collect();
            if within.len() < MIN_LOBE {
                return Err(RigError::Calibration {
                    what: "mirror",
                    why: format!(
                        "{} readings within its lobe, at least {MIN_LOBE} are needed: is it a mirror, and near the mirror direction?",
                        within.len()
                    ),
                });
            }
            let weight: f64 = within.iter().map(|point| point.1).sum();
            sums.push(within.iter().map(|point| point.0 * point.1).sum::<f64>() / weight);
        }
        if sums.is_empty() {
            return Err(RigError::Calibration {
                what: "mirror",
                why: "no scan across its lobe".to_owned(),
            });
        }
        let apart_deg = (sums.iter().copied().fold(f64::NEG_INFINITY, f64::max)
            - sums.iter().copied().fold(f64::INFINITY, f64::min))
        .to_degrees();
        if apart_deg > MIRROR_DEG {
            return Err(RigError::Calibration {
                what: "mirror",
                why: format!(
                    "its lobe stands at mirror directions that are {apart_deg:.2}° apart at different angles, up to \
                     {MIRROR_DEG}° is possible: it moved, or light got in from outside; calibrate again"
                ),
            });
        }
        let step = file.arms[0]
            .axis
            .resolution_rad()
            .max(file.arms[1].axis.resolution_rad());
        let (sum, u) = mean(sums.iter().copied());
        // Never surer than a tenth of the step with which the lobe was seen.
        Ok(Self {
            conditions: Conditions {
                temperature_c: temperature_c(readings),
                ..Conditions::default()
            },
            offset_rad: -sum / 2.0,
            u_rad: (u / 2.0).max(step / 10.0),
        })
    }
}

impl Colour {
    /// The matrix that takes what the sensor says of some patches closest to what they are: least squares over pairs of
    /// the sensor's own reflectance and linear sRGB, both in the same unit.
    ///
    /// # Errors
    /// Fewer than three patches, or patches that differ too little in colour.
    pub fn measure(patches: &[Patch]) -> Result<Self, RigError> {
        let mut normal = DMat3::ZERO;
        let mut right = DMat3::ZERO;
        for patch in patches {
            let (sensor, rgb) = (DVec3::from(patch.sensor), DVec3::from(patch.rgb));
            normal += outer(sensor, sensor);
            right += outer(rgb, sensor);
        }
        let size = normal.diagonal().element_sum().powi(3);
        let spans = normal.determinant() > SINGULAR * size;
        if !spans {
            return Err(RigError::Calibration {
                what: "colour patches",
                why: format!(
                    "{} patches do not span the colours; at least three that differ are needed",
                    patches.len()
                ),
            });
        }
        let matrix = right * normal.inverse();
        let free = 3 * patches.len().saturating_sub(3);
        let white = patches.iter().flat_map(|patch| patch.rgb).fold(0.0, f64::max);
        let mut colour = Self {
            conditions: Conditions::default(),
            matrix: matrix.transpose().to_cols_array_2d(),
            residual: 0.0,
            // Each row of the matrix is three numbers for as many equations as there are patches.
            u: None,
        };
        colour.residual = colour.left_over(patches).unwrap_or_default();
        let squares = (colour.residual * white).powi(2) * (3 * patches.len()) as f64;
        colour.u = (free > 0).then(|| (squares / free as f64).sqrt() / white);
        Ok(colour)
    }
}

/// a bᵀ.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Mean and the standard uncertainty of it; of a single value that is 0.
fn mean(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let squares: f64 = values.map(|value| (value - mean).powi(2)).sum();
    (
        mean,
        if n > 1.0 {
            (squares / (n * (n - 1.0))).sqrt()
        } else {
            0.0
        },
    )
}

fn temperature_c(readings: &[Taken]) -> f64 {
    let sum: f64 = readings
        .iter()
        .map(|taken| f64::from(taken.counts.temperature_c))
        .sum();
    sum / readings.len().max(1) as f64
}
