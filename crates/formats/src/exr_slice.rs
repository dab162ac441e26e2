use std::io::Cursor;

use brdf::{Brdf, HalfDifference, Spherical};
use exr::meta::MetaData;
use exr::prelude::{
    AttributeValue, Encoding, Image, Layer, LayerAttributes, LineOrder, ReadChannels, ReadLayers,
    SpecificChannels, Text, Vec2, WritableImage, read as read_exr,
};
use glam::{DVec2, DVec3};

use crate::lattice::Lattice;
use crate::text::{LARGEST, number};
use crate::{Error, Export, Format, Place, Tolerance};

/// The slice of PDV coordinates, as a run directory has it.
pub(crate) const PDV: Format = Format {
    name: "exr",
    extension: "exr",
    about: "Picture (OpenEXR, f32) of the slice over θ_r (rows) and d_p (columns) at φ_p = 0. Loses whatever changes with φ_p: \
            read back, it is constant along it.",
    tolerance: Tolerance::ANY,
    write: |export| write(export, &PDV_SLICE),
    recognises: |bytes| is_slice(bytes, &PDV_SLICE),
    read: |bytes| read(bytes, &PDV_SLICE),
};

/// The slice that BRDF Explorer shows.
pub(crate) const HALF_DIFFERENCE: Format = Format {
    name: "exr-half-difference",
    extension: "exr",
    about: "Picture (OpenEXR, f32) of the slice over θ_h (columns, as MERL has them) and θ_d (rows, 89° at the top) at φ_d = \
            90°, which BRDF Explorer shows. Loses whatever changes with φ_d: read back, it is constant along it.",
    tolerance: Tolerance::ANY,
    write: |export| write(export, &HALF_DIFFERENCE_SLICE),
    recognises: |bytes| is_slice(bytes, &HALF_DIFFERENCE_SLICE),
    read: |bytes| read(bytes, &HALF_DIFFERENCE_SLICE),
};

/// A plane through the pairs of directions.
struct Slice {
    /// Names of the header attributes with the value of every column and of every row.
    names: [&'static str; 2],
    /// What is the same in the whole slice, as a header attribute.
    fixed: (&'static str, &'static str),
    columns: fn() -> Vec<f64>,
    rows: fn() -> Vec<f64>,
    /// Directions by column and row; `None` where there are none.
    directions: fn(f64, f64) -> Option<(DVec3, DVec3)>,
    /// Column and row of directions, and 0.
    of: fn(DVec3, DVec3) -> [f64; 3],
}

const PDV_SLICE: Slice = Slice {
    names: ["d_p", "theta_r_deg"],
    fixed: ("phi_p_deg", "0"),
    // Quadratic, so that the lobe has most of them.
    columns: || (0..256).map(|n| 2.0 * (f64::from(n) / 255.0).powi(2)).collect(),
    rows: || (0..90).map(f64::from).collect(),
    directions: |d_p, theta_r_deg| {
        let exitant = Spherical {
            theta: theta_r_deg.to_radians(),
            phi: 0.0,
        }
        .direction();
        let x = d_p - exitant.x;
        let z_squared = (1.0 - x) * (1.0 + x);
        (z_squared > 0.0).then(|| (DVec3::new(x, 0.0, z_squared.sqrt()), exitant))
    },
    of: |incident, exitant| {
        let deviation: DVec2 = incident.truncate() + exitant.truncate();
        [
            deviation.length(),
            Spherical::from_direction(exitant).theta.to_degrees(),
            0.0,
        ]
    },
};

const HALF_DIFFERENCE_SLICE: Slice = Slice {
    names: ["theta_h_deg", "theta_d_deg"],
    fixed: ("phi_d_deg", "90"),
    columns: || (0..90).map(|n| 90.0 * (f64::from(n) / 90.0).powi(2)).collect(),
    rows: || (0..90).rev().map(f64::from).collect(),
    directions: |theta_h_deg, theta_d_deg| {
        let pair = HalfDifference {
            theta_h: theta_h_deg.to_radians(),
            theta_d: theta_d_deg.to_radians(),
            phi_d: std::f64::consts::FRAC_PI_2,
        };
        Some(pair.directions())
    },
    of: |incident, exitant| {
        let angles = HalfDifference::from_directions(incident, exitant);
        [angles.theta_h.to_degrees(), angles.theta_d.to_degrees(), 0.0]
    },
};

/// Most pixels of a picture.
const MOST_PIXELS: usize = 1 << 24;

fn library(error: exr::error::Error) -> Error {
    Error::Library {
        library: "exr",
        source: Box::new(error),
    }
}

fn write(export: &Export<'_>, slice: &Slice) -> Result<Vec<u8>, Error> {
    let (columns, rows) = ((slice.columns)(), (slice.rows)());
    let mut header = LayerAttributes::default();
    let list = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let mut attributes = vec![
        (slice.names[0], list(&columns)),
        (slice.names[1], list(&rows)),
        (slice.fixed.0, slice.fixed.1.to_owned()),
        ("unit", "1/sr".to_owned()),
    ];
    attributes.extend(export.metadata.lines());
    for (name, value) in attributes {
        // The header holds plain letters only.
        let plain: String = value
            .chars()
            .map(|c| if c.is_ascii() { c } else { '?' })
            .collect();
        if let (Some(name), Some(value)) = (Text::new_or_none(name), Text::new_or_none(plain)) {
            header.other.insert(name, AttributeValue::Text(value));
        }
    }
    let pixel = |at: Vec2<usize>| {
        let pair = (slice.directions)(columns[at.x()], rows[at.y()]);
        let f = pair.map_or(DVec3::ZERO, |(incident, exitant)| {
            export.brdf.eval(incident, exitant)
        });
        let f = f.as_vec3();
        (f.x, f.y, f.z)
    };
    let encoding = Encoding {
        line_order: LineOrder::Increasing,
        ..Encoding::FAST_LOSSLESS
    };
    let size = (columns.len(), rows.len());
    let layer = Layer::new(size, header, encoding, SpecificChannels::rgb(pixel));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(library)?;
    Ok(bytes.into_inner())
}

/// Whether it is a picture whose header says what its columns and rows are.
fn is_slice(bytes: &[u8], slice: &Slice) -> bool {
    bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) && header(bytes).is_ok_and(|meta| axes(&meta, slice).is_ok())
}

fn header(bytes: &[u8]) -> Result<MetaData, Error> {
    MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(library)
}

/// Values of columns and rows by the header.
fn axes(meta: &MetaData, slice: &Slice) -> Result<[Vec<f64>; 2], Error> {
    let place = |name: &str| Place::Field(name.to_owned());
    let Some(header) = meta.headers.first() else {
        return Err(Error::malformed(place("header"), "no picture", "one picture"));
    };
    let (width, height) = (header.layer_size.x(), header.layer_size.y());
    if width.saturating_mul(height) > MOST_PIXELS {
        let allowed = format!("at most {MOST_PIXELS} pixels");
        return Err(Error::malformed(
            place("dataWindow"),
            format!("{width} × {height} pixels"),
            allowed,
        ));
    }
    let axis = |name: &str, count: usize| {
        let value = header.own_attributes.other.get(&Text::from(name));
        let Some(AttributeValue::Text(text)) = value else {
            return Err(Error::malformed(
                place(name),
                "no such attribute",
                "a text with a number for each",
            ));
        };
        let text = text.to_string();
        let numbers: Vec<f64> = text
            .split_whitespace()
            .map(|word| number(word, 0))
            .collect::<Result<_, _>>()?;
        let ordered = numbers.is_sorted_by(|a, b| a < b) || numbers.is_sorted_by(|a, b| a > b);
        match numbers.len() == count && ordered {
            true => Ok(numbers),
            false => Err(Error::malformed(
                place(name),
                "another list",
                format!("{count} numbers in order"),
            )),
        }
    };
    Ok([axis(slice.names[0], width)?, axis(slice.names[1], height)?])
}

fn read(bytes: &[u8], slice: &Slice) -> Result<Box<dyn Brdf>, Error> {
    let [mut columns, mut rows] = axes(&header(bytes)?, slice)?;
    let image = read_exr()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(library)?;
    let channel = |name: &str| {
        let found = image
            .layer_data
            .channel_data
            .list
            .iter()
            .find(|channel| channel.name.eq(name));
        let samples: Option<Vec<f64>> = found.map(|channel| {
            let values = channel.sample_data.values_as_f32();
            values.map(|value| f64::from(value).clamp(0.0, LARGEST)).collect()
        });
        let whole = samples.filter(|samples| samples.len() == columns.len() * rows.len());
        let missing = || {
            Error::malformed(
                Place::Field(name.to_owned()),
                "no such channel",
                "a number for each pixel",
            )
        };
        whole.ok_or_else(missing)
    };
    let (r, g, b) = (channel("R")?, channel("G")?, channel("B")?);
    let width = columns.len();
    let (left, up) = (columns.first() > columns.last(), rows.first() > rows.last());
    let mut values = Vec::with_capacity(r.len());
    for x in 0..width {
        for y in 0..rows.len() {
            let x = if left { width - 1 - x } else { x };
            let y = if up { rows.len() - 1 - y } else { y };
            let at = y * width + x;
            let value = DVec3::new(r[at], g[at], b[at]);
            values.push(DVec3::select(value.is_nan_mask(), DVec3::ZERO, value));
        }
    }
    columns.sort_unstable_by(f64::total_cmp);
    rows.sort_unstable_by(f64::total_cmp);
    Ok(Box::new(Lattice::new(
        slice.of,
        [columns, rows, vec![0.0]],
        values,
    )))
}
