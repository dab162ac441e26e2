use std::f64::consts::{FRAC_PI_2, PI};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use formats::ScatteredReading;
use pdv::{Observation, Planes};

use crate::family::family;
use crate::{Error, Material};

/// How far the azimuth of a reading in the plane may be from 0 or 180°, rad.
const IN_PLANE: f64 = 0.009;
/// Zenith angles closer than this, rad, belong to one plane; a direction nearer to the normal has no azimuth.
const SAME: f64 = 1.8e-3;
const NORMAL: f64 = 1.8e-4;
/// The least readings that make a plane.
const LEAST: usize = 12;

/// Extension of files of scattered readings.
const SCATTERED: &str = "csv";

/// The materials of a file or of a folder's files, in the order of their names: BRDF files of any format that can be read,
/// and CSV files of scattered readings.
///
/// # Errors
/// A file or folder that cannot be read, a file of no format, or readings of which no specimen can be made.
pub(crate) fn materials(path: &Path) -> Result<Vec<Material>, Error> {
    files(path)?.iter().map(|file| material(file)).collect()
}

/// The file itself, or all files in a folder, by name.
fn files(path: &Path) -> Result<Vec<PathBuf>, Error> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let io = |source| Error::Io {
        what: "list",
        path: path.to_owned(),
        source,
    };
    let entries: Vec<_> = std::fs::read_dir(path)
        .map_err(io)?
        .collect::<Result<_, _>>()
        .map_err(io)?;
    let mut files: Vec<PathBuf> = entries
        .iter()
        .map(std::fs::DirEntry::path)
        .filter(|p| p.is_file())
        .collect();
    files.sort();
    Ok(files)
}

fn material(path: &Path) -> Result<Material, Error> {
    let name = path
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let scattered = path.extension().is_some_and(|extension| extension == SCATTERED);
    let mut material = match ScatteredReading::read(path) {
        Ok(readings) if scattered => of_readings(name, readings)?,
        // A table of another format may have that extension, too.
        _ => {
            let (_, brdf) = formats::read(path).map_err(|source| Error::File {
                path: path.to_owned(),
                source: Box::new(source),
            })?;
            Material::new(name, Arc::from(brdf))
        }
    };
    let folder = path.parent().and_then(Path::file_name);
    if let (None, Some(folder)) = (family(&material.name), folder) {
        material.family = folder.to_string_lossy().into_owned();
    }
    Ok(material)
}

/// A material of scattered readings. On the simulated stage lies what the readings in the plane say, which are dense
/// there; everything is judged at the readings themselves.
fn of_readings(name: String, readings: Vec<ScatteredReading>) -> Result<Material, Error> {
    let swapped: Vec<ScatteredReading> = readings.iter().map(|reading| reading.swapped()).collect();
    // Whichever arm stands still within a plane.
    let count = |planes: &Vec<Vec<Observation>>| planes.iter().map(Vec::len).sum::<usize>();
    let [still, moving] = [planes(&readings), planes(&swapped)];
    let planes = if count(&moving) > count(&still) {
        moving
    } else {
        still
    };
    let stage = Planes::from_observations(&planes, &[]).map_err(|source| Error::Scattered {
        material: name.clone(),
        source,
    })?;
    Ok(Material {
        known: Some(readings.into()),
        ..Material::new(name, Arc::new(stage))
    })
}

/// The readings in the plane by the zenith angle of the sensor, of those that have enough of them.
fn planes(readings: &[ScatteredReading]) -> Vec<Vec<Observation>> {
    let mut in_plane: Vec<(f64, Observation)> = readings
        .iter()
        .filter_map(|reading| Some((reading.sensor, observation(reading)?)))
        .collect();
    in_plane.sort_by(|a, b| a.0.total_cmp(&b.0));
    in_plane
        .chunk_by(|a, b| b.0 - a.0 < SAME)
        .filter(|plane| plane.len() >= LEAST)
        .map(|plane| plane.iter().map(|(_, observation)| *observation).collect())
        .collect()
}

/// A reading as one in the plane of the arms; `None` out of it.
fn observation(reading: &ScatteredReading) -> Option<Observation> {
    let azimuth = reading.azimuth.rem_euclid(2.0 * PI);
    let mirror_side = (azimuth - PI).abs() <= IN_PLANE || reading.light.min(reading.sensor) < NORMAL;
    let same_side = azimuth <= IN_PLANE || 2.0 * PI - azimuth <= IN_PLANE;
    let light = match (mirror_side, same_side) {
        (true, _) => -reading.light,
        (_, true) => reading.light,
        _ => return None,
    };
    let grazing = light.abs() >= FRAC_PI_2 || reading.sensor >= FRAC_PI_2;
    (!grazing).then(|| Observation {
        theta_r: reading.sensor,
        // Of the mirror direction the difference of the sines would be rounded.
        deviation: match (light + reading.sensor).abs() < NORMAL {
            true => 0.0,
            false => light.sin() + reading.sensor.sin(),
        },
        rgb: reading.rgb,
    })
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use brdf::{Brdf, Fitted};
    use glam::DVec3;

    use super::*;

    /// Readings of a material with the light at a few angles, all along the plane and some out of it.
    fn text(material: &Fitted) -> String {
        let mut text = "theta_i_deg,theta_o_deg,dphi_deg,f_r,f_g,f_b\n".to_owned();
        let mut add = |light: f64, sensor: f64, azimuth: f64| {
            let reading = ScatteredReading {
                light: light.to_radians(),
                sensor: sensor.to_radians(),
                azimuth: azimuth.to_radians(),
                rgb: DVec3::ZERO,
            };
            let (incident, exitant) = reading.directions();
            let f = material.eval(incident, exitant);
            writeln!(text, "{light},{sensor},{azimuth},{},{},{}", f.x, f.y, f.z).expect("text grows");
        };
        for light in [0.0, 20.0, 40.0, 60.0] {
            for sensor in 0..80 {
                add(light, f64::from(sensor), 180.0);
                if light > 0.0 {
                    add(light, f64::from(sensor), 0.0);
                }
            }
            add(light, 35.0, 90.0);
        }
        text
    }

    #[test]
    fn a_folder_holds_tables_and_scattered_readings() {
        let folder = tempfile::tempdir().unwrap();
        let gold = Fitted::named("gold-paint").unwrap();
        std::fs::write(folder.path().join("paint.csv"), text(&gold)).unwrap();
        brdf::MerlTable::fill(&gold)
            .write(&folder.path().join("gold.binary"))
            .unwrap();
        let found = materials(folder.path()).unwrap();
        let names: Vec<&str> = found.iter().map(|material| material.name.as_str()).collect();
        assert_eq!(names, ["gold", "paint"]);
        assert!(found[0].known.is_none());
        assert_eq!(found[1].known.as_ref().unwrap().len(), 7 * 80 + 4);
        // What lies on the stage is as the readings say, in their planes and between them.
        let at = |light: f64, sensor: f64| {
            let [light, sensor] = [light, sensor].map(|deg| arm(deg.to_radians()));
            (found[1].brdf.eval(light, sensor) / gold.eval(light, sensor) - 1.0)
                .abs()
                .max_element()
        };
        assert!(at(-40.0, 41.0) < 0.02, "{}", at(-40.0, 41.0));
        assert!(at(-30.0, 50.0) < 0.1, "{}", at(-30.0, 50.0));
    }

    fn arm(rad: f64) -> DVec3 {
        DVec3::new(rad.sin(), 0.0, rad.cos())
    }

    #[test]
    fn a_file_of_no_format_and_readings_without_a_plane_are_refused_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("notes.txt");
        std::fs::write(&path, "shopping").unwrap();
        let error = materials(&path).err().expect("no BRDF");
        assert!(error.to_string().contains("notes.txt"), "{error}");
        let path = folder.path().join("few.csv");
        std::fs::write(&path, "a,b,c,d,e,f\n10,20,90,1,1,1\n").unwrap();
        let error = materials(&path).err().expect("no plane");
        assert!(error.to_string().contains("few"), "{error}");
    }
}
