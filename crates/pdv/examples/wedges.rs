//! What readings of the specimen on wedges are worth: error of a plan with and without them, noise-free.
//!
//! `cargo run --release -p pdv --example wedges -- FOLDER… [--spheres]`: each FOLDER holds MERL files (`*.binary`), or measured
//! readings at scattered directions as the example `scattered` takes them (`*.csv`), each with six columns.
//!
//! Of MERL files every plan of a list is read, by a perfect instrument whose arms reach 85° and come no closer than 5°.
//! Printed are the mean MALE over all pairs below 80° in 1e-5, over how many materials it fell against the plan in the plane
//! with as many readings, and with `--spheres` the mean PSNR of lit spheres in dB, and the largest that any material lost.
//!
//! Of scattered readings the model is made of all planes of at least twelve readings, and once more without one at the
//! normal. Of those out of the plane the eight nearest to what wedges of 20° and 45° would read correct it, with their own
//! angles; it is judged by the others.

use std::path::{Path, PathBuf};

use brdf::{Brdf, HalfDifference, MerlTable, Spherical};
use glam::DVec3;
use pdv::metric::{Tally, spheres};
use pdv::{Corrected, Distribution, Draw, Observation, Placement, Planes, WedgeReading, compare, spread};
use rayon::prelude::*;

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// The arms come no closer and go no further, degrees.
const SEPARATION_DEG: f64 = 5.0;
const LIMIT_DEG: f64 = 85.0;
/// A count of the light's servo, rad.
const COUNT_RAD: f64 = std::f64::consts::TAU / 4096.0;

/// Readings on a wedge: its tilt, the middle of the arms and half of what lies between them, degrees.
type OnWedge = (f64, f64, &'static [f64]);

const NO_WEDGE: &[OnWedge] = &[];
const ONE_WEDGE: &[OnWedge] = &[(37.0, 20.0, &[10.0, 25.0, 40.0, 55.0])];
const TWO_WEDGES: &[OnWedge] = &[
    (20.0, 0.0, &[10.0, 30.0, 55.0, 75.0]),
    (45.0, 0.0, &[10.0, 30.0, 55.0, 75.0]),
];
/// For readings that are there already, to 80°.
const AMONG_SCATTERED: &[OnWedge] = &[
    (20.0, 0.0, &[10.0, 30.0, 50.0, 65.0]),
    (45.0, 0.0, &[10.0, 30.0, 50.0, 65.0]),
];

/// What is read.
struct Plan {
    /// θ_r of each plane, degrees, and its readings.
    planes: &'static [(f64, usize)],
    arc: usize,
    wedges: &'static [OnWedge],
}

const fn plan(planes: &'static [(f64, usize)], arc: usize, wedges: &'static [OnWedge]) -> Plan {
    Plan { planes, arc, wedges }
}

/// Plans of the same number of readings follow each other, the first of them what the others are compared with.
const PLANS: [Plan; 16] = [
    plan(&[(45.0, 12)], 4, NO_WEDGE),
    plan(&[(35.0, 11)], 5, NO_WEDGE),
    plan(&[(20.0, 9), (45.0, 9), (70.0, 8)], 6, NO_WEDGE),
    plan(&[(15.0, 14), (60.0, 14)], 4, NO_WEDGE),
    plan(&[(20.0, 14), (45.0, 14), (70.0, 14)], 6, NO_WEDGE),
    plan(&[(15.0, 21), (60.0, 21)], 6, NO_WEDGE),
    plan(&[(20.0, 12), (45.0, 11), (70.0, 11)], 6, TWO_WEDGES),
    plan(&[(15.0, 19), (60.0, 19)], 6, ONE_WEDGE),
    plan(&[(15.0, 17), (60.0, 17)], 6, TWO_WEDGES),
    plan(&[(20.0, 30), (45.0, 30), (70.0, 30)], 6, NO_WEDGE),
    plan(&[(10.0, 30), (45.0, 29), (70.0, 29)], 8, NO_WEDGE),
    plan(&[(10.0, 27), (45.0, 27), (70.0, 26)], 8, TWO_WEDGES),
    plan(&[(0.0, 42), (30.0, 42), (60.0, 42), (80.0, 42)], 12, NO_WEDGE),
    plan(&[(10.0, 43), (35.0, 43), (60.0, 42), (75.0, 42)], 10, NO_WEDGE),
    plan(&[(10.0, 42), (35.0, 42), (60.0, 41), (75.0, 41)], 10, ONE_WEDGE),
    plan(&[(10.0, 41), (35.0, 41), (60.0, 40), (75.0, 40)], 10, TWO_WEDGES),
];

impl Plan {
    fn readings(&self) -> usize {
        let across: usize = self.planes.iter().map(|(_, readings)| readings).sum();
        across
            + self.arc
            + self
                .wedges
                .iter()
                .map(|(_, _, deltas)| deltas.len())
                .sum::<usize>()
    }

    fn about(&self) -> String {
        let plane = |(deg, readings): &(f64, usize)| format!("{deg}° × {readings}");
        let planes: Vec<String> = self.planes.iter().map(plane).collect();
        let wedge = |(tilt, _, deltas): &OnWedge| format!(", {} on {tilt}°", deltas.len());
        let wedges: String = self.wedges.iter().map(wedge).collect();
        format!("{} + {}{wedges}", planes.join(", "), self.arc)
    }

    /// What a perfect instrument makes of a material.
    fn model(&self, brdf: &dyn Brdf) -> Result<Corrected, pdv::Error> {
        let across: Vec<_> = self.planes.iter().map(|&plane| across(brdf, plane)).collect();
        let from = SEPARATION_DEG / 2.0;
        let step = (LIMIT_DEG - from) / (self.arc.max(2) - 1) as f64;
        let along: Vec<_> = (0..self.arc)
            .filter_map(|n| Observation::of(brdf, (from + step * n as f64).to_radians(), 0.0))
            .collect();
        let on_wedges: Vec<_> = arms(self.wedges)
            .filter_map(|(on, light, sensor)| WedgeReading::of(brdf, &on, light, sensor))
            .collect();
        let planes = Planes::from_observations(&across, &along)?;
        Ok(Corrected::new(Box::new(planes), &on_wedges))
    }
}

/// A plane with the sensor at an angle in degrees, and so many readings.
fn across(brdf: &dyn Brdf, (deg, readings): (f64, usize)) -> Vec<Observation> {
    let theta_r = deg.to_radians();
    let deviation = |deg: f64| deg.to_radians().sin() + theta_r.sin();
    let ranges = [
        deviation(-LIMIT_DEG)..=deviation(deg - SEPARATION_DEG),
        deviation((deg + SEPARATION_DEG).min(LIMIT_DEG))..=deviation(LIMIT_DEG),
    ];
    let spread = spread(Distribution::Lobe, theta_r, &ranges, readings, COUNT_RAD);
    let read = |&d: &f64| Observation::of(brdf, theta_r, d);
    spread.deviations.iter().filter_map(read).collect()
}

/// Placement, and where light and sensor stand, rad.
fn arms(wedges: &[OnWedge]) -> impl Iterator<Item = (Placement, f64, f64)> {
    wedges.iter().flat_map(|&(tilt_deg, m, deltas)| {
        let on = Placement {
            tilt: tilt_deg.to_radians(),
            ..Placement::FLAT
        };
        let stand = move |&delta: &f64| (on, (m - delta).to_radians(), (m + delta).to_radians());
        deltas.iter().map(stand)
    })
}

/// MALE and PSNR of one material by one plan.
#[derive(Clone, Copy)]
struct Found {
    male: f64,
    psnr_db: f64,
}

fn judge(path: &Path, with_spheres: bool) -> Result<Vec<Found>, Failure> {
    let truth = MerlTable::read(path)?;
    let draw = Draw {
        pairs: 50_000,
        ..Draw::default()
    };
    let models: Vec<Corrected> = PLANS
        .iter()
        .map(|plan| plan.model(&truth))
        .collect::<Result<_, _>>()?;
    let estimates: Vec<&dyn Brdf> = models.iter().map(|model| model as &dyn Brdf).collect();
    let psnr_db: Vec<f64> = if with_spheres {
        spheres(&truth, &estimates)
            .iter()
            .map(|found| found.psnr_db)
            .collect()
    } else {
        vec![f64::NAN; estimates.len()]
    };
    let males = compare(&truth, &estimates, &draw)
        .into_iter()
        .map(|found| found.overall.male.unwrap_or(f64::NAN));
    Ok(males
        .zip(psnr_db)
        .map(|(male, psnr_db)| Found { male, psnr_db })
        .collect())
}

fn mean(of: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = of.len() as f64;
    of.sum::<f64>() / count
}

fn print(folder: &Path, materials: &[Vec<Found>], with_spheres: bool) {
    println!("{}: {} materials", folder.display(), materials.len());
    for (n, plan) in PLANS.iter().enumerate() {
        let first = PLANS
            .iter()
            .position(|other| other.readings() == plan.readings())
            .unwrap_or(n);
        let better = materials.iter().filter(|of| of[n].male < of[first].male).count();
        let male = 1e5 * mean(materials.iter().map(|of| of[n].male));
        let change = 100.0 * (male / (1e5 * mean(materials.iter().map(|of| of[first].male))) - 1.0);
        let mut line = format!(
            "{:4} readings: {:48} MALE {male:6.1} ({change:+5.1} %, better for {better})",
            plan.readings(),
            plan.about()
        );
        if with_spheres {
            let lost = |of: &Vec<Found>| of[first].psnr_db - of[n].psnr_db;
            let most = materials.iter().map(lost).fold(0.0, f64::max);
            let psnr = mean(materials.iter().map(|of| of[n].psnr_db));
            line += &format!("  PSNR {psnr:.2} dB, at most {most:.1} lost");
        }
        println!("{line}");
    }
}

/// A measured reading out of or in the plane.
#[derive(Clone, Copy)]
struct Row {
    incident: DVec3,
    exitant: DVec3,
    rgb: DVec3,
}

/// The rows of a file of scattered readings, in the order light, sensor, azimuth in degrees, red, green, blue.
fn rows(text: &str) -> Result<Vec<Row>, Failure> {
    let lines = text.lines().filter(|line| !line.starts_with('#')).skip(1);
    let row = |line: &str| -> Result<Row, Failure> {
        let numbers: Vec<f64> = line.split(',').map(str::parse).collect::<Result<_, _>>()?;
        let [light, sensor, azimuth, r, g, b] = numbers[..] else {
            return Err(format!("\"{line}\" has not six columns").into());
        };
        let [theta_i, theta_o, phi] = [light, sensor, azimuth].map(f64::to_radians);
        Ok(Row {
            incident: Spherical { theta: theta_i, phi }.direction(),
            exitant: Spherical {
                theta: theta_o,
                phi: 0.0,
            }
            .direction(),
            rgb: DVec3::new(r, g, b),
        })
    };
    lines.map(row).collect()
}

impl Row {
    fn in_plane(&self) -> bool {
        self.incident.y.abs() < 0.009 * self.incident.truncate().length().max(1e-9)
            || self.incident.z.max(self.exitant.z) > 1.0 - 1e-7
    }

    /// As one of a plane with its light at θ_r, since of these the light stands still.
    fn observation(&self) -> Observation {
        let of = |direction: DVec3| direction.x.signum() * direction.truncate().length();
        // At the normal every azimuth is that of the mirror.
        let light = if self.incident.z > 1.0 - 1e-7 {
            0.0
        } else {
            of(self.incident)
        };
        let theta_r = self.incident.z.acos();
        let sensor = if light > 0.0 {
            of(self.exitant)
        } else {
            -of(self.exitant)
        };
        Observation {
            theta_r,
            deviation: sensor + theta_r.sin(),
            rgb: self.rgb,
        }
    }
}

/// Largest zenith angle, degrees, of the readings by which a model is judged.
const LIMITS_DEG: [f64; 2] = [65.0, 80.0];

/// MALE of the model of all planes and of that without a plane at the normal: for each limit without and with the eight.
type Scattered = [[[f64; 2]; 2]; 2];

fn judge_scattered(path: &Path) -> Result<Scattered, Failure> {
    let rows = rows(&std::fs::read_to_string(path)?)?;
    let (within, beyond): (Vec<Row>, Vec<Row>) = rows.iter().partition(|row| row.in_plane());
    let mut within: Vec<Observation> = within.iter().map(Row::observation).collect();
    within.sort_by(|a, b| a.theta_r.total_cmp(&b.theta_r));
    let planes: Vec<Vec<Observation>> = within
        .chunk_by(|a, b| b.theta_r - a.theta_r < 1.8e-3)
        .filter(|plane| plane.len() >= 12)
        .map(<[Observation]>::to_vec)
        .collect();
    let leaning = planes.iter().filter(|plane| plane[0].theta_r > 0.1).cloned();
    let without_normal: Vec<Vec<Observation>> = leaning.collect();
    Ok([
        without_and_with(&planes, &beyond)?,
        without_and_with(&without_normal, &beyond)?,
    ])
}

/// MALE to each limit, of a model of planes and of the same corrected by readings out of them.
fn without_and_with(planes: &[Vec<Observation>], beyond: &[Row]) -> Result<[[f64; 2]; 2], Failure> {
    let mut taken = Vec::new();
    for (on, light, sensor) in arms(AMONG_SCATTERED) {
        let Some((incident, exitant)) = on.pair(light, sensor) else {
            continue;
        };
        let wanted = HalfDifference::from_directions(incident, exitant);
        let far = |row: &Row| {
            let at = HalfDifference::from_directions(row.incident, row.exitant);
            // f is the same with φ_d or −φ_d, and half a turn on.
            let phi = |of: HalfDifference| of.phi_d.sin().abs().asin();
            let across = wanted.theta_h.sin() * wanted.theta_d.sin() * (phi(at) - phi(wanted));
            (at.theta_h - wanted.theta_h)
                .hypot(at.theta_d - wanted.theta_d)
                .hypot(across)
        };
        let free = (0..beyond.len()).filter(|n| !taken.contains(n));
        taken.extend(free.min_by(|&a, &b| far(&beyond[a]).total_cmp(&far(&beyond[b]))));
    }
    let readings: Vec<WedgeReading> = taken
        .iter()
        .map(|&n| WedgeReading {
            incident: beyond[n].incident,
            exitant: beyond[n].exitant,
            rgb: beyond[n].rgb,
        })
        .collect();
    let plain = Planes::from_observations(planes, &[])?;
    let corrected = Corrected::new(Box::new(plain.clone()), &readings);
    let male = |model: &dyn Brdf, limit_deg: f64| {
        let mut tally = Tally::new();
        let below = |row: &Row| row.incident.z.min(row.exitant.z) > limit_deg.to_radians().cos();
        for (_, row) in beyond
            .iter()
            .enumerate()
            .filter(|(n, row)| !taken.contains(n) && below(row))
        {
            let found = model.eval(row.incident, row.exitant);
            for c in 0..3 {
                tally.add(row.rgb[c].max(0.0), found[c], row.incident.z, row.exitant.z);
            }
        }
        tally.metrics(1, 1).male.unwrap_or(f64::NAN)
    };
    Ok(LIMITS_DEG.map(|limit| [male(&plain, limit), male(&corrected, limit)]))
}

fn print_scattered(folder: &Path, materials: &[Scattered]) {
    println!(
        "{}: {} materials of scattered readings, MALE out of the plane",
        folder.display(),
        materials.len()
    );
    for (set, name) in ["all planes", "without a plane at the normal"]
        .into_iter()
        .enumerate()
    {
        for (n, limit) in LIMITS_DEG.into_iter().enumerate() {
            let at = |with: usize| 1e5 * mean(materials.iter().map(|of| of[set][n][with]));
            let better = materials
                .iter()
                .filter(|of| of[set][n][1] < of[set][n][0])
                .count();
            println!(
                "{name}, to {limit}°: {:.1}, corrected {:.1} ({:+.1} %, better for {better})",
                at(0),
                at(1),
                100.0 * (at(1) / at(0) - 1.0)
            );
        }
    }
}

fn files(folder: &Path, extension: &str) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|found| found == extension) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn main() -> Result<(), Failure> {
    let (options, folders): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|arg| arg.starts_with("--"));
    let with_spheres = match options.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => false,
        ["--spheres"] => true,
        _ => return Err("the only option is --spheres".into()),
    };
    if folders.is_empty() {
        return Err("needed are folders of MERL files, or of scattered readings".into());
    }
    for folder in folders.iter().map(Path::new) {
        let tables = files(folder, "binary")?;
        if !tables.is_empty() {
            let found = tables
                .par_iter()
                .map(|path| judge(path, with_spheres))
                .collect::<Result<Vec<_>, _>>()?;
            print(folder, &found, with_spheres);
        }
        let scattered = files(folder, "csv")?;
        if !scattered.is_empty() {
            let found = scattered
                .par_iter()
                .map(|path| judge_scattered(path))
                .collect::<Result<Vec<_>, _>>()?;
            print_scattered(folder, &found);
        }
    }
    Ok(())
}
