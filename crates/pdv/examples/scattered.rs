//! Makes a model of readings at scattered directions and says how far it is from other readings, by every metric.
//!
//! `cargo run --release -p pdv --example scattered -- READINGS.csv TRUTH.csv [--model planes|bivariate|separable|auto]
//! [--swap] [--least READINGS] [--json]`
//!
//! Both files are CSV with a header line and six columns: the zenith angle of the light and that of the sensor in
//! degrees, the azimuth between them in degrees (180 is the mirror's side, 0 that of retro-reflection), and the
//! reflectance in red, green and blue in sr⁻¹. Lines that begin with `#` are passed over.
//!
//! Of the readings those in one plane with the normal are used, where the azimuth is within 0.5° of 0 or 180 or an angle
//! below 0.01°; the others are counted. Readings in the mirror direction are the arc. All with the same sensor angle, to
//! 0.1°, are a plane, if they are at least three or as many as `--least` says; `--swap` takes the light's angle instead,
//! for instruments whose sensor moves while the light stands still, since light and sensor may be swapped. Every row of
//! the truth that is above the horizon is compared, in the plane or out of it. The truth may be the readings' own file.
//!
//! ```text
//! $ cargo run --release -p pdv --example scattered -- readings.csv truth.csv --model planes
//! readings: 3 planes at 20.0, 45.0, 70.0° with 42 readings, an arc of 6; 0 out of the plane and 0 of no use
//! model: the reciprocal model of 6 sides of planes and an arc, with the shape …
//!                      all        red      green       blue
//! male            0.000403   0.000391   0.000377   0.000442
//! …
//! ```

use std::fmt::Write as _;
use std::path::Path;

use brdf::Spherical;
use glam::DVec3;
use pdv::metric::{Channels, Metrics, Tally};
use pdv::{Auto, Bivariate, Model, Observation, Planes, Separable};
use serde::Serialize;

type Failure = Box<dyn std::error::Error>;

/// How far azimuths may be from the plane, and angles from each other within a plane, degrees.
const IN_PLANE_DEG: f64 = 0.5;
const SAME_DEG: f64 = 0.1;
/// A direction nearer to the normal than this, degrees, has no azimuth.
const NORMAL_DEG: f64 = 0.01;

/// A row of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    light_deg: f64,
    sensor_deg: f64,
    azimuth_deg: f64,
    rgb: DVec3,
}

impl Row {
    /// Light and sensor exchanged.
    fn swapped(self) -> Self {
        Self {
            light_deg: self.sensor_deg,
            sensor_deg: self.light_deg,
            ..self
        }
    }

    /// The signed angle of the light from the normal, degrees, with the sensor at a positive one; `None` out of the
    /// plane.
    fn light_in_plane_deg(&self) -> Option<f64> {
        let azimuth = self.azimuth_deg.rem_euclid(360.0);
        let near = |of: f64| (azimuth - of).abs() <= IN_PLANE_DEG;
        if near(180.0) || self.light_deg.min(self.sensor_deg) < NORMAL_DEG {
            Some(-self.light_deg)
        } else if near(0.0) || near(360.0) {
            Some(self.light_deg)
        } else {
            None
        }
    }

    fn observation(&self) -> Option<Observation> {
        let theta_r = self.sensor_deg.to_radians();
        let light = self.light_in_plane_deg()?.to_radians();
        // −α and θ_r alike are the mirror direction; the difference of the sines would be rounded.
        let deviation = if self.mirror() {
            0.0
        } else {
            light.sin() + theta_r.sin()
        };
        Some(Observation {
            theta_r,
            deviation,
            rgb: self.rgb,
        })
    }

    fn mirror(&self) -> bool {
        self.light_in_plane_deg()
            .is_some_and(|light| (light + self.sensor_deg).abs() < NORMAL_DEG)
    }

    /// Unit vectors to the light and to the sensor.
    fn directions(&self) -> [DVec3; 2] {
        [(self.light_deg, self.azimuth_deg), (self.sensor_deg, 0.0)].map(|(theta, phi)| {
            Spherical {
                theta: theta.to_radians(),
                phi: phi.to_radians(),
            }
            .direction()
        })
    }
}

/// The rows of a text; an error names the line.
fn rows(text: &str) -> Result<Vec<Row>, String> {
    let lines = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty());
    let row = |(n, line): (usize, &str)| {
        let numbers: Result<Vec<f64>, _> = line.split(',').map(|cell| cell.trim().parse()).collect();
        let numbers =
            numbers.map_err(|_| format!("line {}: \"{line}\" has a cell that is no number", n + 1))?;
        let [light_deg, sensor_deg, azimuth_deg, r, g, b] = numbers[..] else {
            return Err(format!("line {}: {} cells, needed are 6", n + 1, numbers.len()));
        };
        Ok(Row {
            light_deg,
            sensor_deg,
            azimuth_deg,
            rgb: DVec3::new(r, g, b),
        })
    };
    let rows: Vec<Row> = lines
        .filter(|(_, line)| !line.starts_with('#'))
        .skip(1)
        .map(row)
        .collect::<Result<_, _>>()?;
    if rows.is_empty() {
        return Err("no line but the header".to_owned());
    }
    Ok(rows)
}

/// Readings by the sweeps to which they belong.
struct Sorted {
    planes: Vec<Vec<Observation>>,
    arc: Vec<Observation>,
    out_of_plane: usize,
    unused: usize,
}

impl Sorted {
    fn new(rows: &[Row], least: usize) -> Self {
        let mut in_plane: Vec<(f64, Observation)> = Vec::new();
        let mut arc = Vec::new();
        for row in rows {
            let Some(observation) = row.observation() else {
                continue;
            };
            in_plane.push((row.sensor_deg, observation));
            if row.mirror() {
                arc.push(observation);
            }
        }
        let out_of_plane = rows.len() - in_plane.len();
        in_plane.sort_by(|a, b| a.0.total_cmp(&b.0));
        let groups = in_plane.chunk_by(|a, b| b.0 - a.0 < SAME_DEG);
        let planes: Vec<Vec<Observation>> = groups
            .filter(|group| group.len() >= least)
            .map(|group| group.iter().map(|(_, observation)| *observation).collect())
            .collect();
        let grouped = |o: &Observation| planes.iter().flatten().any(|p| p == o);
        let unused = in_plane
            .iter()
            .filter(|(_, o)| !grouped(o) && o.deviation != 0.0)
            .count();
        Self {
            planes,
            arc,
            out_of_plane,
            unused,
        }
    }

    fn about(&self) -> String {
        let degrees = |plane: &Vec<Observation>| format!("{:.1}", plane[0].theta_r.to_degrees());
        format!(
            "{} planes at {}° with {} readings, an arc of {}; {} out of the plane and {} of no use",
            self.planes.len(),
            self.planes.iter().map(degrees).collect::<Vec<_>>().join(", "),
            self.planes.iter().map(Vec::len).sum::<usize>(),
            self.arc.len(),
            self.out_of_plane,
            self.unused
        )
    }

    /// The model of that name.
    fn model(&self, name: &str) -> Result<Box<dyn Model>, Failure> {
        let (planes, arc) = (&self.planes, &self.arc);
        Ok(match name {
            "planes" => Box::new(Planes::from_observations(planes, arc)?),
            "bivariate" => Box::new(Bivariate::from_observations(planes, arc)?),
            "separable" => Box::new(Separable::from_observations(
                planes.first().map_or(&[], Vec::as_slice),
                arc,
            )?),
            "auto" => Box::new(Auto::from_observations(planes, arc)?),
            _ => {
                return Err(
                    format!("no model \"{name}\", there are planes, bivariate, separable and auto").into(),
                );
            }
        })
    }
}

/// All metrics, channels pooled and each by itself.
#[derive(Serialize)]
struct Found {
    #[serde(flatten)]
    overall: Metrics,
    channels: Channels,
}

/// How far a model is from the rows of the truth that are above the horizon; negative readings count as 0.
fn compare(model: &dyn Model, truth: &[Row]) -> Found {
    let mut tallies = [(); 3].map(|()| Tally::new());
    for row in truth {
        let [incident, exitant] = row.directions();
        if !(incident.z > 0.0 && exitant.z > 0.0 && row.rgb.is_finite()) {
            continue;
        }
        let found = model.eval(incident, exitant).to_array();
        let read = row.rgb.max(DVec3::ZERO).to_array();
        for ((tally, f), g) in tallies.iter_mut().zip(read).zip(found) {
            tally.add(f, g, incident.z, exitant.z);
        }
    }
    let (overall, channels) = Tally::of_channels(&tallies, truth.len() as u64);
    Found { overall, channels }
}

impl Found {
    /// For people: one metric a line.
    fn lines(&self) -> String {
        type Pick = fn(&Metrics) -> Option<f64>;
        const ROWS: [(&str, Pick); 7] = [
            ("male", |m| m.male),
            ("median_rel", |m| m.median_rel),
            ("p95_rel", |m| m.p95_rel),
            ("rel_rms", |m| m.rel_rms),
            ("log_rel_rmse", |m| m.log_rel_rmse),
            ("eq4", |m| m.eq4),
            ("eq4_black", |m| m.eq4_black),
        ];
        let columns = [
            &self.overall,
            &self.channels.r,
            &self.channels.g,
            &self.channels.b,
        ];
        let mut text = format!(
            "{:<13}{:>11}{:>11}{:>11}{:>11}\n",
            "", "all", "red", "green", "blue"
        );
        for (name, pick) in ROWS {
            let cells =
                columns.map(|m| pick(m).map_or_else(|| "-".to_owned(), |value| format!("{value:.6}")));
            let [all, red, green, blue] = cells;
            let _ = writeln!(text, "{name:<13}{all:>11}{red:>11}{green:>11}{blue:>11}");
        }
        let _ = writeln!(
            text,
            "over {} readings, {:.1} % left out",
            self.overall.pairs,
            100.0 * self.overall.left_out
        );
        text
    }
}

/// What to do, as it is asked for.
struct Asked {
    files: Vec<String>,
    model: String,
    swap: bool,
    least: usize,
    json: bool,
}

impl Asked {
    fn new(args: impl Iterator<Item = String>) -> Result<Self, Failure> {
        let mut asked = Self {
            files: Vec::new(),
            model: "planes".to_owned(),
            swap: false,
            least: 3,
            json: false,
        };
        let mut args = args;
        while let Some(arg) = args.next() {
            match arg.as_str() {
                "--model" => asked.model = args.next().ok_or("--model needs a name")?,
                "--swap" => asked.swap = true,
                "--least" => asked.least = args.next().ok_or("--least needs a number")?.parse()?,
                "--json" => asked.json = true,
                _ => asked.files.push(arg),
            }
        }
        Ok(asked)
    }

    /// What is to be printed.
    fn answer(&self) -> Result<String, Failure> {
        let [readings, truth] = &self.files[..] else {
            return Err("two files are needed: readings and truth".into());
        };
        let read = |path: &String| -> Result<Vec<Row>, Failure> {
            let text =
                std::fs::read_to_string(Path::new(path)).map_err(|error| format!("{path}: {error}"))?;
            let rows = rows(&text).map_err(|error| format!("{path}: {error}"))?;
            Ok(if self.swap {
                rows.into_iter().map(Row::swapped).collect()
            } else {
                rows
            })
        };
        let sorted = Sorted::new(&read(readings)?, self.least);
        let model = sorted.model(&self.model)?;
        let found = compare(model.as_ref(), &read(truth)?);
        if self.json {
            return Ok(serde_json::to_string_pretty(&found)? + "\n");
        }
        Ok(format!(
            "readings: {}\nmodel: {}\n{}",
            sorted.about(),
            model.about(),
            found.lines()
        ))
    }
}

fn main() -> Result<(), Failure> {
    print!("{}", Asked::new(std::env::args().skip(1))?.answer()?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use brdf::{Brdf, Fitted};

    /// Rows of a material in planes at some sensor angles and along the mirror arc, as a text.
    fn text(material: &Fitted, planes_deg: &[f64], out_of_plane: usize) -> String {
        let mut text = "# made for a test\nlight_deg,sensor_deg,azimuth_deg,r,g,b\n".to_owned();
        let mut add = |light_deg: f64, sensor_deg: f64, azimuth_deg: f64| {
            let mut row = Row {
                light_deg,
                sensor_deg,
                azimuth_deg,
                rgb: DVec3::ZERO,
            };
            let [incident, exitant] = row.directions();
            row.rgb = material.eval(incident, exitant);
            let [r, g, b] = row.rgb.to_array();
            let _ = writeln!(text, "{light_deg},{sensor_deg},{azimuth_deg},{r},{g},{b}");
        };
        for &sensor in planes_deg {
            for n in 0..=16 {
                let light = f64::from(n) * 5.0;
                add(light, sensor, 180.0);
                if (light - sensor).abs() > 4.0 && light > 0.0 {
                    add(light, sensor, 0.0);
                }
            }
        }
        for n in 0..=10 {
            add(f64::from(n) * 8.0, f64::from(n) * 8.0, 180.0);
        }
        for n in 1..=out_of_plane {
            let even = |step: f64| (n as f64 * step).fract();
            add(80.0 * even(0.819), 80.0 * even(0.671), 1.0 + 178.0 * even(0.55));
        }
        text
    }

    fn found(model: &str, planes_deg: &[f64], swap: bool) -> Found {
        let gold = Fitted::named("gold-paint").unwrap();
        let swapped = |text: String| -> Vec<Row> {
            let rows = rows(&text).unwrap().into_iter();
            if swap {
                rows.map(Row::swapped).collect()
            } else {
                rows.collect()
            }
        };
        let sorted = Sorted::new(&swapped(text(&gold, planes_deg, 7)), 3);
        assert_eq!(
            (sorted.planes.len(), sorted.out_of_plane),
            (planes_deg.len(), 7),
            "{}",
            sorted.about()
        );
        compare(
            sorted.model(model).unwrap().as_ref(),
            &swapped(text(&gold, &[], 2000)),
        )
    }

    #[test]
    fn any_model_is_made_of_scattered_readings() {
        for (model, bar) in [
            ("planes", 0.006),
            ("auto", 0.006),
            ("bivariate", 0.03),
            ("separable", 0.2),
        ] {
            let found = found(model, &[20.0, 45.0, 70.0], false);
            let male = found.overall.male.unwrap();
            assert!(male < bar, "{model} is {male} off");
            assert!(found.overall.pairs > 1900 && found.lines().contains("log_rel_rmse"));
        }
    }

    /// Readings against themselves, with the light standing still: the same by reciprocity.
    #[test]
    fn swapping_light_and_sensor_changes_nothing_for_a_reciprocal_material() {
        let gold = Fitted::named("gold-paint").unwrap();
        let there = rows(&text(&gold, &[20.0, 70.0], 0)).unwrap();
        let back: Vec<Row> = there.iter().copied().map(Row::swapped).collect();
        assert_eq!(
            Sorted::new(&back, 12).planes.len(),
            0,
            "the light stands still in these planes"
        );
        let again: Vec<Row> = back.into_iter().map(Row::swapped).collect();
        assert_eq!(again, there);
        let male = |truth: &[Row]| {
            let model = Sorted::new(&there, 12).model("planes").unwrap();
            compare(model.as_ref(), truth).overall.male.unwrap()
        };
        assert!(male(&there) < 2e-3, "{}", male(&there));
    }

    #[test]
    fn an_error_names_the_line() {
        assert!(
            rows("a,b,c,d,e,f\n1,2,3,4,5,6\n1,2,x,4,5,6")
                .unwrap_err()
                .starts_with("line 3")
        );
        assert!(rows("a\n1,2,3").unwrap_err().contains("3 cells, needed are 6"));
        assert!(rows("header alone").is_err());
        let none = Asked::new(std::iter::empty()).unwrap().answer().unwrap_err();
        assert!(none.to_string().contains("two files"));
    }

    #[test]
    fn json_has_the_keys_of_eval() {
        let found = serde_json::to_value(found("planes", &[45.0], false)).unwrap();
        for key in [
            "male",
            "median_rel",
            "p95_rel",
            "rel_rms",
            "log_rel_rmse",
            "eq4",
            "eq4_black",
        ] {
            assert!(
                found[key].is_number() && found["channels"]["b"][key].is_number(),
                "{key}"
            );
        }
    }
}
