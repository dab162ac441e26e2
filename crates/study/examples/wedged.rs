//! Says what readings on wedges are worth on a rig with all its imperfections.
//!
//! `cargo run --release -p study --example wedged -- FOLDER… [--every N]`
//!
//! Every material (or every N-th) of the folders, BRDF files of any format, is captured on the simulated rig as it is shipped:
//! flat, with 48 readings and with 40, and with six of the arc and one of a plane on wedges of 20° and 45°. Of these seven six
//! correct the model of the 40, the first of the arc hardly, since it lies nearly in a plane with the normal; the last is beyond 80°. Printed
//! are MALE over all pairs below 80° in 1e-5 of the model of the 48, of that of the 40 and of the corrected one, by material and
//! in the mean, with what the readings say of it.

use std::path::PathBuf;

use brdf::Brdf;
use pdv::{Corrected, Draw, Placement, compare};
use rayon::prelude::*;
use report::{Sweeps, measurements, wedge_readings};
use rig::RigFile;
use study::{Capture, Material};
use sweep::Job;

type Failed = Box<dyn std::error::Error + Send + Sync>;

/// Flat, without wedges and with wedges to follow.
const FLAT: [&str; 2] = [
    "[[plane]]\ntheta_r_deg = 15\nreadings = 21\ndistribution = \"lobe\"\n[[plane]]\ntheta_r_deg = 60\nreadings = 21\n\
     distribution = \"lobe\"\n[arc]\nreadings = 6\n",
    "[[plane]]\ntheta_r_deg = 15\nreadings = 17\ndistribution = \"lobe\"\n[[plane]]\ntheta_r_deg = 60\nreadings = 17\n\
     distribution = \"lobe\"\n[arc]\nreadings = 6\n",
];
/// A job needs a plane; its one reading is in the mirror direction as well.
const ON_WEDGE: &str = "[[plane]]\ntheta_r_deg = 55\nreadings = 1\n[arc]\nreadings = 6\n";
const TILTS_DEG: [f64; 2] = [20.0, 45.0];

/// MALE in 1e-5: of 48 readings, of 40, and of those corrected.
type Found = [f64; 3];

fn captured(
    text: &str,
    rig: &RigFile,
    material: &Material,
) -> Result<(Job, Vec<report::Measurement>), Failed> {
    let job = Job::parse(text, "the job")?;
    let records = Capture::new(&job, rig, material.brdf.clone())?.records;
    Ok((job, measurements(&records, rig)))
}

fn judge(material: &Material, seed: i64) -> Result<Found, Failed> {
    let mut rig = RigFile::parse(RigFile::BUILT_IN, "the rig file".as_ref())?;
    rig.sim.insert("seed".to_owned(), seed.into());
    let mut readings = Vec::new();
    for tilt_deg in TILTS_DEG {
        let mut placed = rig.clone();
        let place = toml::Table::from_iter([("tilt_deg".to_owned(), tilt_deg.into())]);
        placed.sim.insert("place".to_owned(), place.into());
        let (_, all) = captured(ON_WEDGE, &placed, material)?;
        let on = Placement {
            tilt: tilt_deg.to_radians(),
            ..Placement::FLAT
        };
        readings.extend(wedge_readings(&all, &on, rig.calibration.filling));
    }
    let model = |text: &str| -> Result<Box<dyn pdv::Model>, Failed> {
        let (job, all) = captured(text, &rig, material)?;
        Ok(Sweeps::new(&job, &all).model(&job)?)
    };
    let [many, fewer] = [model(FLAT[0])?, model(FLAT[1])?];
    let corrected = Corrected::new(model(FLAT[1])?, &readings);
    let draw = Draw {
        pairs: 50_000,
        ..Draw::default()
    };
    let estimates: [&dyn Brdf; 3] = [many.as_ref(), fewer.as_ref(), &corrected];
    let found = compare(material.brdf.as_ref(), &estimates, &draw);
    let males = [0, 1, 2].map(|n| 1e5 * found[n].overall.male.unwrap_or(f64::NAN));
    let [many, fewer, with] = males;
    println!(
        "{}: {many:.1}, {fewer:.1}, corrected {with:.1}; {:?}",
        material.name,
        corrected.check()
    );
    Ok(males)
}

fn main() -> Result<(), Failed> {
    let (mut folders, mut every) = (Vec::new(), 1);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--every" => {
                let number = args.next().ok_or("--every needs a number")?;
                every = number.parse::<usize>()?.max(1);
            }
            _ => folders.push(PathBuf::from(arg)),
        }
    }
    if folders.is_empty() {
        return Err("needed are folders of BRDF files".into());
    }
    for folder in &folders {
        let materials = Material::read_all(folder)?;
        let materials: Vec<&Material> = materials.iter().step_by(every).collect();
        let found = materials
            .par_iter()
            .enumerate()
            .map(|(n, material)| judge(material, n as i64 + 1))
            .collect::<Result<Vec<Found>, Failed>>()?;
        let mean = |n: usize| found.iter().map(|of| of[n]).sum::<f64>() / found.len() as f64;
        let better = found.iter().filter(|of| of[2] < of[0]).count();
        println!(
            "{}: {} materials, 48 readings {:.1}, 40 {:.1}, 40 and twelve on wedges {:.1}, better than the 48 for {better}",
            folder.display(),
            found.len(),
            mean(0),
            mean(1),
            mean(2)
        );
    }
    Ok(())
}
