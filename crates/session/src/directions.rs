//! A job file, and the histogram of directions that its `[scene]` may name.

use std::io;
use std::ops::Range;
use std::path::{Component, Path};

use exr::prelude::{ReadChannels, ReadLayers, read as read_exr};
use serde::Deserialize;
use sweep::SweepError;
use toml::Spanned;

use crate::SessionError;
use crate::run_request::read;

/// Cells along either zenith angle: 5° each.
const BINS: usize = 18;
const RIGHT_DEG: f64 = 90.0;
const KEY: &str = "scene.directions";

/// What of a job file names another file. Whatever else is in it, or wrong with it, is not looked at here.
#[derive(Deserialize)]
struct Naming {
    scene: Option<NamingScene>,
}

#[derive(Deserialize)]
struct NamingScene {
    directions: Option<Spanned<toml::Value>>,
}

/// Weights of pairs of directions by their zenith angles: the light's by row, the viewer's by column.
struct Histogram([[f64; BINS]; BINS]);

/// Text of a job file that says all that a run needs: the histogram of directions that it names is written out in it.
///
/// The histogram lies in the folder of the job file, or below. It is a table (CSV) with the columns `theta_i_deg`,
/// `theta_o_deg` and `weight`, a row for each pair or bin; or a picture (EXR) of weights, in its channel Y, else R, else
/// its first, with θ_i from 0 to 90° from left to right, and θ_o from top to bottom. It is kept in cells of 5° × 5°.
///
/// # Errors
/// A file that cannot be read; a name that leads out of the folder; weights or angles that are not what is allowed.
pub fn job_text(path: &Path) -> Result<String, SessionError> {
    let mut text = read("job file", path, config::read_text)?;
    // What is wrong with it is told by who reads all of it.
    let named = toml::from_str::<Naming>(&text).ok();
    let Some(directions) = named.and_then(|job| job.scene?.directions) else {
        return Ok(text);
    };
    let toml::Value::String(name) = directions.get_ref() else {
        return Ok(text);
    };
    let refuse = |why: &str| {
        refusal(
            &path.to_string_lossy(),
            Some(line(&text, &directions.span())),
            KEY,
            why,
        )
    };
    let name = Path::new(name);
    if !name.components().all(|part| matches!(part, Component::Normal(_))) {
        return Err(refuse(
            "leads out of the folder of the job file, allowed is a file in it or below",
        ));
    }
    let file = path.parent().unwrap_or(Path::new("")).join(name);
    let histogram = match name.extension().and_then(|extension| extension.to_str()) {
        Some("csv") => Histogram::from_csv(&file)?,
        Some("exr") => Histogram::from_exr(&file)?,
        _ => {
            return Err(refuse(
                "no table and no picture by its name, allowed are .csv and .exr",
            ));
        }
    };
    let cells = histogram.cells();
    if cells.is_empty() {
        return Err(refuse("all its weights are 0, allowed is one above at least"));
    }
    text.replace_range(directions.span(), &format!("[{cells}]"));
    Ok(text)
}

impl Histogram {
    fn empty() -> Self {
        Self([[0.0; BINS]; BINS])
    }

    /// Adds a pair; `None` where the angles are not within 0 … 90, or the weight is no number from 0 on.
    fn add(&mut self, theta_deg: [f64; 2], weight: f64) -> Option<()> {
        let sound = |theta_deg: &f64| (0.0..=RIGHT_DEG).contains(theta_deg);
        if !theta_deg.iter().all(sound) || !weight.is_finite() || weight < 0.0 {
            return None;
        }
        let [i, o] =
            theta_deg.map(|theta_deg| ((theta_deg / RIGHT_DEG * BINS as f64) as usize).min(BINS - 1));
        self.0[i][o] += weight;
        Some(())
    }

    fn from_csv(path: &Path) -> Result<Self, SessionError> {
        #[derive(Deserialize)]
        struct Row {
            theta_i_deg: f64,
            theta_o_deg: f64,
            weight: f64,
        }
        let name = path.to_string_lossy();
        let text = read("histogram of directions", path, config::read_text)?;
        let mut histogram = Self::empty();
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        // The header is line 1.
        for (row, line) in reader.deserialize().zip(2..) {
            let row: Row = row.map_err(|error| {
                refusal(
                    &name,
                    Some(line),
                    "theta_i_deg, theta_o_deg, weight",
                    &error.to_string(),
                )
            })?;
            let added = histogram.add([row.theta_i_deg, row.theta_o_deg], row.weight);
            added.ok_or_else(|| {
                let why = "allowed are angles within 0 … 90 and weights from 0 on";
                refusal(&name, Some(line), "angles, weight", why)
            })?;
        }
        Ok(histogram)
    }

    fn from_exr(path: &Path) -> Result<Self, SessionError> {
        let wrong = |error: exr::error::Error| io::Error::new(io::ErrorKind::InvalidData, error);
        let image = read("histogram of directions", path, |path| {
            let first = read_exr()
                .no_deep_data()
                .largest_resolution_level()
                .all_channels();
            first
                .first_valid_layer()
                .all_attributes()
                .from_file(path)
                .map_err(wrong)
        })?;
        let layer = &image.layer_data;
        let list = &layer.channel_data.list;
        let named = |name: &str| list.iter().find(|channel| channel.name.eq(name));
        let channel = named("Y").or(named("R")).or(list.first());
        let name = path.to_string_lossy();
        let refuse = |key: &str, why: &str| refusal(&name, None, key, why);
        let weights = channel.ok_or_else(|| refuse("channels", "none, allowed is at least one"))?;
        let (width, height) = (layer.size.width(), layer.size.height());
        let mut histogram = Self::empty();
        for (n, weight) in weights.sample_data.values_as_f32().enumerate() {
            let middle = |n: usize, of: usize| (n as f64 + 0.5) / of as f64 * RIGHT_DEG;
            let (x, y) = (n % width, n / width);
            let added = histogram.add([middle(x, width), middle(y, height)], f64::from(weight));
            added.ok_or_else(|| {
                refuse(
                    &format!("pixel {x}, {y}"),
                    &format!("{weight}, allowed are weights from 0 on"),
                )
            })?;
        }
        Ok(histogram)
    }

    /// Every cell with a weight, as job files write them.
    fn cells(&self) -> String {
        let edge = |n: usize| n as f64 * RIGHT_DEG / BINS as f64;
        let cell = |i: usize, o: usize| {
            let weight = self.0[i][o];
            let [i0, i1, o0, o1] = [i, i + 1, o, o + 1].map(edge);
            (weight > 0.0).then(|| format!("[{i0:?}, {i1:?}, {o0:?}, {o1:?}, {weight:?}]"))
        };
        let cells = (0..BINS).flat_map(|i| (0..BINS).filter_map(move |o| cell(i, o)));
        cells.collect::<Vec<_>>().join(", ")
    }
}

fn line(text: &str, span: &Range<usize>) -> usize {
    text[..span.start].matches('\n').count() + 1
}

fn refusal(file: &str, line: Option<usize>, key: &str, why: &str) -> SessionError {
    SessionError::Job(SweepError::File {
        file: file.to_owned(),
        line,
        key: key.to_owned(),
        why: why.to_owned(),
    })
}
