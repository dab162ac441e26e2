use arms::{ArmAngle, Pose};
use capture::Record;
use rig::{Certificate, Certified, Colour, Conditions, Gain, Patch, RigFile, Taken, Trap, White, Zero};
use serde::Deserialize;
use sweep::{Sweep, Visit};

use crate::measurement::{all_taken, believed};
use crate::{ReportError, Verdict, checks, measurements};

/// Readings at each certified geometry of a white reference.
const WHITE_REPEATS: usize = 6;
/// Readings of each rung of the ladder of exposures.
const RUNG_REPEATS: usize = 4;
/// Shares of full scale that a ladder reaches for.
const RUNGS: [f64; 8] = [0.005, 0.01, 0.02, 0.1, 0.25, 0.45, 0.65, 0.85];
/// Poses of a black trap, degrees; those in shadow are left out.
const TRAP_LIGHT_DEG: [f64; 5] = [-80.0, -60.0, -40.0, -20.0, 0.0];
const TRAP_SENSOR_DEG: [f64; 5] = [0.0, 20.0, 40.0, 60.0, 80.0];
/// Where the sensor stands while the light crosses a mirror's lobe, degrees.
const MIRROR_DEG: [f64; 3] = [20.0, 40.0, 60.0];
/// How far to both sides of the mirror direction the light goes, degrees.
const MIRROR_SPAN_DEG: f64 = 2.2;
/// The usual geometry of a certificate, light and sensor in degrees.
const USUAL_DEG: [f64; 2] = [-45.0, 0.0];

/// What lies on the stage in a calibration.
#[derive(Clone, Debug, PartialEq)]
pub enum Standard {
    /// A white reference: responsivity, gains, linearity.
    White(WhiteReference),
    /// A black trap: stray light.
    Trap,
    /// A mirror: alignment of the arms.
    Mirror,
    /// A colour patch: once there are three that differ, the colour matrix.
    Patch {
        /// Its name.
        name: String,
        /// Reflectance factor at 45°/0° in linear sRGB, as certified.
        rgb: [f64; 3],
    },
}

/// A white reference with its certificate: one geometry or a table.
#[derive(Clone, Debug, PartialEq)]
pub struct WhiteReference {
    /// What it is called, with its serial number.
    pub name: String,
    /// Relative standard uncertainty of its certificate.
    pub u: f64,
    /// Certified geometries, at least one.
    pub certified: Vec<Certified>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWhite {
    name: String,
    u_percent: f64,
    at: Vec<RawAt>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawAt {
    light_deg: f64,
    sensor_deg: f64,
    reflectance_factor: [f64; 3],
}

impl Default for WhiteReference {
    /// A sintered PTFE tile of unknown history: 98 % ± 0.5 % at 45°/0°.
    fn default() -> Self {
        Self {
            name: "white reference, 98 % at 45°/0°".to_owned(),
            u: 0.005,
            certified: vec![Certified {
                pose: Pose::from_deg(USUAL_DEG[0], USUAL_DEG[1]),
                reflectance_factor: [0.98; 3],
            }],
        }
    }
}

impl WhiteReference {
    /// Reads the text of a certificate: `name`, `u_percent` (relative standard uncertainty), and a table `[[at]]` with
    /// `light_deg`, `sensor_deg` and `reflectance_factor` (red, green, blue) for each certified geometry. `file` is for
    /// the errors.
    ///
    /// # Errors
    /// No TOML, an unknown key, no geometry, a value out of its range.
    pub fn parse(text: &str, file: &str) -> Result<Self, ReportError> {
        let refuse = |why: String| ReportError::Standard {
            file: file.to_owned(),
            why,
        };
        let raw: RawWhite = config::parse(text).map_err(|flaws| {
            let line = flaws.line(text).map(|line| format!("line {line}: "));
            let key = flaws.first().key.as_ref().map(|key| format!("{key}: "));
            refuse([line, key, Some(flaws.why(text))].into_iter().flatten().collect())
        })?;
        let within =
            |key: &str, value: f64, range: std::ops::RangeInclusive<f64>| match range.contains(&value) {
                true => Ok(value),
                false => Err(refuse(format!(
                    "{key} is {value}, allowed: {} … {}",
                    range.start(),
                    range.end()
                ))),
            };
        let certified = raw.at.iter().map(|at| {
            for factor in at.reflectance_factor {
                within("reflectance_factor", factor, 0.01..=2.0)?;
            }
            Ok::<_, ReportError>(Certified {
                pose: Pose::from_deg(
                    within("light_deg", at.light_deg, -85.0..=85.0)?,
                    within("sensor_deg", at.sensor_deg, -85.0..=85.0)?,
                ),
                reflectance_factor: at.reflectance_factor,
            })
        });
        let reference = Self {
            certified: certified.collect::<Result<Vec<_>, _>>()?,
            u: within("u_percent", raw.u_percent, 0.0..=50.0)? / 100.0,
            name: raw.name,
        };
        match reference.certified.is_empty() {
            true => Err(refuse("no [[at]], at least one geometry is needed".to_owned())),
            false => Ok(reference),
        }
    }
}

impl Standard {
    /// What it is, for people and for the certificate.
    pub fn name(&self) -> &str {
        match self {
            Self::White(reference) => &reference.name,
            Self::Trap => "black trap",
            Self::Mirror => "mirror",
            Self::Patch { name, .. } => name,
        }
    }

    /// What a simulated stage holds in its place; `None`: nothing stands for it.
    pub fn simulated(&self) -> Option<String> {
        match self {
            Self::White(reference) => {
                let factor = reference.certified.first()?.reflectance_factor[1];
                Some(format!("lambert:{}", factor.min(1.0)))
            }
            Self::Trap => Some("black".to_owned()),
            Self::Mirror => Some("mirror:0.9".to_owned()),
            Self::Patch { .. } => None,
        }
    }

    /// The readings that are taken of it, in their order.
    pub fn visits(&self, file: &RigFile) -> Vec<Visit> {
        let ranged = |pose: Pose| Visit {
            sweep: Sweep::Reference,
            pose: file.nearest(pose),
            exposure: None,
        };
        match self {
            Self::White(reference) => {
                let poses = reference.certified.iter().map(|at| at.pose);
                let repeated = poses.flat_map(|pose| [ranged(pose); WHITE_REPEATS]);
                repeated.chain(ladder(file, &reference.certified[0])).collect()
            }
            Self::Trap => TRAP_SENSOR_DEG
                .into_iter()
                .flat_map(|sensor| TRAP_LIGHT_DEG.map(|light| Pose::from_deg(light, sensor)))
                .filter(|&pose| file.envelope.check_pose(pose).is_ok() && readable(file, pose))
                .filter(|pose| pose.light < pose.sensor)
                .map(ranged)
                .collect(),
            Self::Mirror => MIRROR_DEG
                .into_iter()
                .flat_map(|deg| scan(file, deg))
                .map(ranged)
                .collect(),
            Self::Patch { .. } => vec![ranged(Pose::from_deg(USUAL_DEG[0], USUAL_DEG[1])); WHITE_REPEATS],
        }
    }

    /// A certificate with the part that the records of a calibration run make; the other parts are those of `before`.
    /// The caller gives it its id and time.
    ///
    /// # Errors
    /// Readings that do not make a calibration, or one that no rig of this rig file can have.
    pub fn certify(
        &self,
        file: &RigFile,
        records: &[Record],
        before: &Certificate,
    ) -> Result<Certificate, ReportError> {
        let readings = all_taken(records);
        let taken = believed(&readings);
        let of = |sweep: Sweep, at: &dyn Fn(Pose) -> bool| -> Vec<Taken> {
            let of = readings
                .iter()
                .filter(|(reading, _)| reading.accepted && reading.sweep == sweep && at(reading.goal));
            of.map(|(_, taken)| *taken).collect()
        };
        let failed = ReportError::Calibration;
        let dark = checks::darkness(&measurements(records, file), records, file);
        if dark.verdict == Verdict::Bad {
            return Err(failed(rig::RigError::Calibration {
                what: "dark level",
                why: dark.text,
            }));
        }
        let conditions = |of| self.conditions(records, of);
        let mut certificate = before.clone();
        match self {
            Self::White(reference) => {
                let at = |certified: &Certified| {
                    let goal = file.nearest(certified.pose);
                    (*certified, of(Sweep::Reference, &|pose| pose == goal))
                };
                let certified: Vec<(Certified, Vec<Taken>)> = reference.certified.iter().map(at).collect();
                let ladder = of(Sweep::Repeat, &|_| true);
                let mut white =
                    White::measure(file, &taken, &ladder, &certified, reference.u, before).map_err(failed)?;
                white.conditions = conditions(white.conditions);
                certificate.white = Some(white);
            }
            Self::Trap => {
                let visits = of(Sweep::Reference, &|_| true);
                let mut trap = Trap::measure(file, &taken, &visits, before).map_err(failed)?;
                trap.conditions = conditions(trap.conditions);
                certificate.trap = Some(trap);
            }
            Self::Mirror => {
                let scans = MIRROR_DEG.map(|deg| {
                    let sensor = file.nearest(Pose::from_deg(-deg, deg)).sensor;
                    of(Sweep::Reference, &|pose| pose.sensor == sensor)
                });
                let mut zero = Zero::measure(file, &taken, &scans).map_err(failed)?;
                zero.conditions = conditions(zero.conditions);
                certificate.zero = Some(zero);
            }
            Self::Patch { name, rgb } => {
                certificate.patches.retain(|patch| patch.name != *name);
                certificate.patches.push(Patch {
                    name: name.clone(),
                    sensor: reflectance_factor(file, records),
                    rgb: *rgb,
                });
                // Too few patches yet are no fault.
                certificate.colour = Colour::measure(&certificate.patches).ok().map(|colour| Colour {
                    conditions: conditions(colour.conditions.clone()),
                    ..colour
                });
            }
        }
        certificate.check(file).map_err(failed)?;
        Ok(certificate)
    }

    /// What a certificate was made under, with when, in which run and on what.
    fn conditions(&self, records: &[Record], of: Conditions) -> Conditions {
        let header = records.iter().find_map(|record| match record {
            Record::Header(header) => Some((header.started.clone(), header.run.clone())),
            _ => None,
        });
        let (made, run) = header.unwrap_or_default();
        Conditions {
            made,
            run,
            standard: self.name().to_owned(),
            ..of
        }
    }
}

/// Whether the arms keep clear of each other's shadow wherever they may come to rest for a pose, as plans demand.
fn readable(file: &RigFile, pose: Pose) -> bool {
    !file.shadowed(file.nearest(pose), [2.0 * file.motion.near_rad; 2])
}

/// Mean reflectance factor of what lies on the stage, in the sensor's own colours.
fn reflectance_factor(file: &RigFile, records: &[Record]) -> [f64; 3] {
    let seen: Vec<[f64; 3]> = measurements(records, file)
        .iter()
        .filter(|m| m.reading.accepted && m.reading.sweep == Sweep::Reference)
        .filter_map(|m| Some(m.raw?.to_array()))
        .collect();
    let sum = |c: usize| seen.iter().map(|f| f[c]).sum::<f64>();
    [0, 1, 2].map(|c| sum(c) / seen.len() as f64 * std::f64::consts::PI)
}

/// Overlapping exposures of every gain at a certified geometry, by the rig file's responsivity.
fn ladder(file: &RigFile, at: &Certified) -> Vec<Visit> {
    let pose = file.nearest(at.pose);
    let cosine = file.calibration.filling.arm(pose).rad().cos();
    let rates = (0..3)
        .map(|c| file.calibration.responsivity[c] * at.reflectance_factor[c] / std::f64::consts::PI * cosine);
    let brightest = rates.fold(0.0, f64::max);
    let [shortest, longest] = [
        file.photometer.integration_min_us,
        file.photometer.integration_max_us,
    ];
    let rung = |gain: Gain, share: f64| {
        let us = share * f64::from(file.photometer.full_scale) / (gain.factor() * brightest);
        let us = us.round() as u32;
        (shortest..=longest).contains(&us).then_some(Visit {
            sweep: Sweep::Repeat,
            pose,
            exposure: Some((gain as u8, us)),
        })
    };
    Gain::ALL
        .into_iter()
        .flat_map(|gain| RUNGS.into_iter().filter_map(move |share| rung(gain, share)))
        .flat_map(|visit| [visit; RUNG_REPEATS])
        .collect()
}

/// Poses count by count across the mirror direction, the sensor standing.
fn scan(file: &RigFile, sensor_deg: f64) -> impl Iterator<Item = Pose> {
    let sensor = file.nearest(Pose::from_deg(-sensor_deg, sensor_deg)).sensor;
    let step = file.arms[0].axis.resolution_rad();
    let n = (MIRROR_SPAN_DEG.to_radians() / step).floor() as i32;
    (-n..=n).map(move |i| Pose {
        light: ArmAngle::from_rad(-sensor.rad() + f64::from(i) * step),
        sensor,
    })
}
