use std::collections::HashMap;
use std::fmt::Write as _;

use brdf::Brdf;
use glam::DVec3;

use crate::colour::{channels_of_spectrum, rgb_of_xyz};
use crate::coordinates::{ANGLES, Coordinates, HALF_DIFFERENCE, RECIPROCAL};
use crate::lattice::Lattice;
use crate::refinement::half_difference;
use crate::text::{LARGEST, angle_deg, lines, numbers, reflectance, shortened, text, written_rgb};
use crate::{Error, Export, Format, Place, Tolerance};

/// Surface scattering distribution data, the exchange format of libbsdf and BSDF Processor, version 0.2.
pub(crate) const FORMAT: Format = Format {
    name: "ssdd",
    extension: "ssdd",
    about: "Surface scattering distribution data of libbsdf, text over half and difference angles with nodes where the \
            specimen needs them. Keeps lobes best of all text formats; loses readings and uncertainty.",
    tolerance: Tolerance::TABLE,
    write,
    recognises: |bytes| {
        bytes.starts_with(b"VERSION 0.") && contains(&bytes[..bytes.len().min(1 << 16)], b"DATA_TYPE")
    },
    read,
};

/// Most nodes.
const NODES: usize = 200_000;

/// Whether a part of a file occurs in another.
fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

fn write(export: &Export<'_>) -> Result<Vec<u8>, Error> {
    let (table, reciprocal) = half_difference(export.brdf, &FORMAT.tolerance, NODES);
    let list = |angles: &[f64]| {
        let words: Vec<String> = angles
            .iter()
            .map(|angle| format!("{:.6}", angle.to_degrees()))
            .collect();
        words.join(" ")
    };
    let [h, d, phi] = table.axes();
    let mut out = format!("VERSION 0.2\nSOFTWARE goniod-{}\n", env!("CARGO_PKG_VERSION"));
    for (name, value) in export.metadata.lines() {
        let _ = writeln!(out, "# {name}: {value}");
    }
    out.push_str(
        "
DATA_TYPE brdf
COLOR_MODEL rgb
PARAM_TYPE half_difference_coordinate_system
",
    );
    let reduction = if reciprocal { " reciprocity" } else { "" };
    let _ = writeln!(out, "REDUCTION_TYPE bilateral_symmetry{reduction}");
    for (n, axis) in [(0, h), (2, d), (3, phi)] {
        let _ = writeln!(out, "PARAM{n}_LIST {}", list(axis));
    }
    let _ = writeln!(out, "NAME {}", shortened(&export.metadata.specimen));
    out.push_str("SOURCE_TYPE measured\nDATA ascii\n");
    for c in 0..phi.len() {
        for b in 0..d.len() {
            for a in 0..h.len() {
                out.push_str(&written_rgb(table.node([a, b, c]), " "));
                out.push('\n');
            }
        }
    }
    Ok(out.into_bytes())
}

/// The lines of a file's only data block before its numbers: key to line and value.
type Meta<'a> = HashMap<&'a str, (u64, &'a str)>;

fn read(bytes: &[u8]) -> Result<Box<dyn Brdf>, Error> {
    let (meta, start) = meta(bytes)?;
    let word = |key: &'static str, allowed: &'static str| {
        let missing = || Error::malformed(Place::Field(key.into()), "no such line", allowed);
        meta.get(key).copied().ok_or_else(missing)
    };
    let expect = |key: &'static str, allowed: &'static str| {
        let (line, value) = word(key, allowed)?;
        match allowed.split(", ").any(|allowed| allowed == value) {
            true => Ok(value),
            false => Err(Error::malformed(
                Place::Line(line),
                format!("{key} {}", shortened(value)),
                allowed,
            )),
        }
    };
    expect("DATA_TYPE", "brdf")?;
    let colour = expect("COLOR_MODEL", "monochrome, rgb, xyz, spectrum")?;
    let kind = expect(
        "PARAM_TYPE",
        "half_difference_coordinate_system, spherical_coordinate_system",
    )?;
    let coordinates = match kind {
        "half_difference_coordinate_system" => match meta.get("REDUCTION_TYPE") {
            Some((_, reduction)) if reduction.contains("reciprocity") => RECIPROCAL,
            _ => HALF_DIFFERENCE,
        },
        _ => ANGLES,
    };
    let list = |key: &'static str, high: f64| {
        let (line, value) = word(key, "a list of angles in degrees")?;
        let degrees = numbers(value.split_whitespace(), line)?;
        if !degrees.is_sorted_by(|a, b| a < b) {
            return Err(Error::malformed(
                Place::Line(line),
                format!("{key} out of order"),
                "ascending angles",
            ));
        }
        degrees
            .into_iter()
            .map(|degrees| angle_deg(degrees, [0.0, high], key, line))
            .collect()
    };
    if let Some((line, value)) = meta
        .get("PARAM1_LIST")
        .filter(|(_, value)| value.split_whitespace().count() > 1)
    {
        let found = format!("PARAM1_LIST {}", shortened(value));
        return Err(Error::malformed(
            Place::Line(*line),
            found,
            "one angle: an isotropic specimen",
        ));
    }
    let axes: [Vec<f64>; 3] = [
        list("PARAM0_LIST", 90.0)?,
        list("PARAM2_LIST", 90.0)?,
        list("PARAM3_LIST", 360.0)?,
    ];
    let weights = match colour {
        "spectrum" => {
            let (line, value) = word("WAVELENGTH_LIST", "a list of wavelengths in nm")?;
            channels_of_spectrum(&numbers(value.split_whitespace(), line)?)
        }
        "monochrome" => vec![DVec3::ONE],
        _ => vec![DVec3::X, DVec3::Y, DVec3::Z],
    };
    let values = match expect("DATA", "ascii, binary")? {
        "binary" => binary(bytes, start, weights.len())?,
        _ => ascii(bytes, weights.len())?,
    };
    let colours: Vec<DVec3> = values
        .chunks_exact(weights.len())
        .map(|values| {
            let sum: DVec3 = weights
                .iter()
                .zip(values)
                .map(|(weight, value)| *weight * *value)
                .sum();
            if colour == "xyz" {
                rgb_of_xyz(sum)
            } else {
                sum.max(DVec3::ZERO)
            }
        })
        .collect();
    table(coordinates, axes, &colours)
}

/// Brings the values, the first angle fastest, into a table; azimuths of the other half circle fall on those of the first.
fn table(coordinates: Coordinates, axes: [Vec<f64>; 3], colours: &[DVec3]) -> Result<Box<dyn Brdf>, Error> {
    let counts = axes.each_ref().map(Vec::len);
    // Each list stands in the file with at least a byte a number, so that the product cannot overflow.
    let count = counts.iter().product::<usize>();
    if count != colours.len() {
        let found = format!("{} colours", colours.len());
        let [a, b, c] = counts;
        let allowed = format!("{count}, one for each of {a} × {b} × {c} parameters");
        return Err(Error::malformed(Place::Field("DATA".into()), found, allowed));
    }
    let nodes: Vec<([f64; 3], DVec3)> = colours
        .iter()
        .enumerate()
        .map(|(n, &colour)| {
            let [a, b, c] = [
                n % counts[0],
                n / counts[0] % counts[1],
                n / counts[0] / counts[1],
            ];
            let phi = crate::coordinates::folded(axes[2][c]);
            let [_, _, [_, high]] = coordinates.range;
            let phi = if phi > high {
                std::f64::consts::PI - phi
            } else {
                phi
            };
            ([axes[0][a], axes[1][b], phi], colour)
        })
        .collect();
    Ok(Box::new(Lattice::from_nodes(
        coordinates,
        ["PARAM0", "PARAM2", "PARAM3"],
        &nodes,
        None,
    )?))
}

/// Reads the lines up to DATA; where the numbers start is told in bytes.
fn meta(bytes: &[u8]) -> Result<(Meta<'_>, usize), Error> {
    let mut meta = Meta::new();
    let mut at = 0;
    for (number, line) in (1..).zip(bytes.split_inclusive(|&byte| byte == b'\n')) {
        at += line.len();
        let line =
            text(line).map_err(|_| Error::malformed(Place::Line(number), "no UTF-8", "text in UTF-8"))?;
        let line = line.split("# ").next().unwrap_or_default().trim();
        let (key, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        if key.is_empty() {
            continue;
        }
        if meta.insert(key, (number, value.trim())).is_some() {
            let found = format!("a second {}", shortened(key));
            return Err(Error::malformed(Place::Line(number), found, "each key once"));
        }
        if key == "DATA" {
            return Ok((meta, at));
        }
    }
    Err(Error::malformed(
        Place::Field("DATA".into()),
        "no such line",
        "DATA ascii or DATA binary",
    ))
}

fn ascii(bytes: &[u8], channels: usize) -> Result<Vec<f64>, Error> {
    let mut values = Vec::new();
    let data = lines(text(bytes)?)
        .skip_while(|(_, line)| !line.starts_with("DATA "))
        .skip(1);
    for (line, text) in data {
        let text = text.split('#').next().unwrap_or_default().trim();
        if text.is_empty() {
            continue;
        }
        let row = numbers(text.split_whitespace(), line)?;
        if row.len() != channels {
            let found = format!("{} numbers", row.len());
            return Err(Error::malformed(
                Place::Line(line),
                found,
                format!("{channels}, one colour"),
            ));
        }
        for value in row {
            values.push(reflectance(value, line)?);
        }
    }
    Ok(values)
}

/// 32-bit floating-point numbers, little-endian, to the end of the file.
fn binary(bytes: &[u8], start: usize, channels: usize) -> Result<Vec<f64>, Error> {
    let (words, rest) = bytes[start..].as_chunks::<4>();
    if !rest.is_empty() || words.len() % channels != 0 {
        let found = format!("{} bytes behind DATA", bytes.len() - start);
        let allowed = format!("a multiple of {}", 4 * channels);
        return Err(Error::malformed(Place::Byte(start as u64), found, allowed));
    }
    let value = |(n, word): (usize, &[u8; 4])| {
        let value = f64::from(f32::from_le_bytes(*word));
        match value.is_finite() && value <= LARGEST {
            true => Ok(value.max(0.0)),
            false => {
                let at = Place::Byte((start + 4 * n) as u64);
                Err(Error::malformed(
                    at,
                    value.to_string(),
                    format!("a number up to {LARGEST:e}"),
                ))
            }
        }
    };
    words.iter().enumerate().map(value).collect()
}
