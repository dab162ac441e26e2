use std::fmt::Write as _;

use brdf::Brdf;
use glam::DVec3;

use crate::colour::{channels_of_spectrum, rgb_of_xyz};
use crate::coordinates::{ANGLES, folded};
use crate::lattice::Lattice;
use crate::refinement::{even, fitted};
use crate::text::{angle_deg, lines, number, numbers, reflectance, shortened, text, written_rgb};
use crate::{Error, Export, Format, Place, Tolerance};

/// Text in the manner of ASTM E1392 and E2387, as libbsdf and Cornell's measurements have it.
pub(crate) const FORMAT: Format = Format {
    name: "astm",
    extension: "astm",
    about: "Text in the manner of ASTM E1392 and E2387: header, then θ_i, φ_i, θ_s, φ_s in rad over the full circle and R, G, B \
            in 1/sr. Keeps what is known of the measurement in its header; loses what lies between the nodes, and refuses \
            narrow lobes, which no grid of θ_s and φ_s resolves.",
    tolerance: Tolerance::TABLE,
    write,
    recognises: |bytes| {
        let start = String::from_utf8_lossy(&bytes[..bytes.len().min(1 << 16)]).into_owned();
        start
            .lines()
            .any(|line| line.trim_start().starts_with("VARS") && line.contains("theta_"))
    },
    read,
};

/// Most rows.
const NODES: usize = 300_000;
/// Names of the four angles, which every file has.
const ANGLE_NAMES: [&str; 4] = ["theta_i", "phi_i", "theta_s", "phi_s"];

fn write(export: &Export<'_>) -> Result<Vec<u8>, Error> {
    let zenith = || even(0.0, 89.0_f64.to_radians(), 6);
    let start = [zenith(), zenith(), even(0.0, std::f64::consts::PI, 6)];
    // Both halves of the circle are written: programs take a half one for all there is.
    let table = fitted(ANGLES, start, export.brdf, &FORMAT.tolerance, NODES / 2);
    let [i, s, phi] = table.axes();
    let circle: Vec<(f64, usize)> = (0..phi.len())
        .rev()
        .map(|c| (-phi[c], c))
        .chain((1..phi.len()).map(|c| (phi[c], c)))
        .collect();
    let mut out = String::from("ASTM E1392 style BRDF, angles in rad, BRDF in 1/sr\n");
    for (name, value) in export.metadata.lines() {
        let _ = writeln!(out, "{} {value}", name.to_uppercase());
    }
    let _ = writeln!(out, "NUM_POINTS {}", i.len() * s.len() * circle.len());
    let _ = writeln!(out, "VARS {},R,G,B", ANGLE_NAMES.join(","));
    for (a, theta_i) in i.iter().enumerate() {
        for (b, theta_s) in s.iter().enumerate() {
            for (phi_s, c) in &circle {
                let rgb = written_rgb(table.node([a, b, *c]), ",");
                let _ = writeln!(out, "{theta_i:.7},0,{theta_s:.7},{phi_s:.7},{rgb}");
            }
        }
    }
    Ok(out.into_bytes())
}

/// What the columns behind the angles hold.
enum Columns {
    Grey,
    Rgb,
    Xyz,
    /// Share of each column in red, green and blue.
    Spectrum(Vec<DVec3>),
}

impl Columns {
    fn named(names: &[&str], line: u64) -> Result<Self, Error> {
        let upper: Vec<String> = names.iter().map(|name| name.trim().to_uppercase()).collect();
        match upper.iter().map(String::as_str).collect::<Vec<_>>()[..] {
            ["R", "G", "B"] => return Ok(Self::Rgb),
            ["X", "Y", "Z"] => return Ok(Self::Xyz),
            [_] => return Ok(Self::Grey),
            _ => {}
        }
        let nm = |name: &String| name.strip_suffix("NM").map(|nm| number(nm, line)).transpose();
        let nm: Option<Vec<f64>> = upper.iter().map(nm).collect::<Result<_, _>>()?;
        match nm {
            Some(nm) if !nm.is_empty() && nm.is_sorted_by(|a, b| a < b) => {
                Ok(Self::Spectrum(channels_of_spectrum(&nm)))
            }
            _ => Err(Error::malformed(
                Place::Line(line),
                format!("columns {}", shortened(&names.join(","))),
                "R,G,B, or X,Y,Z, or wavelengths in ascending order such as 450nm,550nm, or one column",
            )),
        }
    }

    fn rgb(&self, values: &[f64]) -> DVec3 {
        match (self, values) {
            (Self::Rgb, &[r, g, b]) => DVec3::new(r, g, b),
            (Self::Xyz, &[x, y, z]) => rgb_of_xyz(DVec3::new(x, y, z)),
            (Self::Spectrum(weights), values) => {
                let sum: DVec3 = weights
                    .iter()
                    .zip(values)
                    .map(|(weight, value)| *weight * *value)
                    .sum();
                sum.max(DVec3::ZERO)
            }
            (_, values) => DVec3::splat(values.first().copied().unwrap_or_default()),
        }
    }
}

fn read(bytes: &[u8]) -> Result<Box<dyn Brdf>, Error> {
    let mut lines = lines(text(bytes)?);
    let Head {
        points,
        columns,
        width,
    } = Head::read(&mut lines)?;
    let mut nodes = Vec::new();
    let mut azimuth = None;
    for (line, text) in lines.filter(|(_, text)| !text.is_empty()) {
        let refuse =
            |found: String, allowed: String| Err(Error::malformed(Place::Line(line), found, allowed));
        let row = numbers(text.split(','), line)?;
        if row.len() != width {
            return refuse(
                format!("{} numbers", row.len()),
                format!("{width} numbers, as VARS says"),
            );
        }
        let (angles, values) = row.split_at(ANGLE_NAMES.len());
        if (angles[1] - *azimuth.get_or_insert(angles[1])).abs() > 1e-6 {
            let found = format!("φ_i of {} rad where the rows before have another", angles[1]);
            return refuse(found, "one φ_i: an isotropic specimen".to_owned());
        }
        let values: Vec<f64> = values
            .iter()
            .map(|&value| reflectance(value, line))
            .collect::<Result<_, _>>()?;
        nodes.push((relative(angles, line)?, columns.rgb(&values)));
    }
    if let Some((line, points)) = points.filter(|(_, points)| *points != nodes.len() as f64) {
        let allowed = format!("the number of rows, which is {}", nodes.len());
        return Err(Error::malformed(
            Place::Line(line),
            format!("NUM_POINTS {points}"),
            allowed,
        ));
    }
    let names = ["theta_i", "theta_s", "phi_s"];
    Ok(Box::new(Lattice::from_nodes(ANGLES, names, &nodes, None)?))
}

/// θ_i, θ_s and the azimuth between them, of the four angles of a row in rad.
fn relative(angles: &[f64], line: u64) -> Result<[f64; 3], Error> {
    let zenith = |angle: f64, what| angle_deg(angle.to_degrees(), [0.0, 90.0], what, line);
    let turn = angle_deg(
        (angles[3] - angles[1]).to_degrees(),
        [-720.0, 720.0],
        "φ_s − φ_i",
        line,
    )?;
    Ok([zenith(angles[0], "θ_i")?, zenith(angles[2], "θ_s")?, folded(turn)])
}

/// What the header says of the rows.
struct Head {
    /// How many there are, with the line that says so.
    points: Option<(u64, f64)>,
    columns: Columns,
    /// Numbers of a row.
    width: usize,
}

impl Head {
    /// Reads up to the line VARS, which is the last one of the header.
    fn read<'a>(lines: &mut impl Iterator<Item = (u64, &'a str)>) -> Result<Self, Error> {
        let mut points = None;
        for (line, text) in lines {
            let (key, value) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
            if key == "NUM_POINTS" {
                points = Some((line, number(value, line)?));
            }
            if key != "VARS" {
                continue;
            }
            let names: Vec<&str> = value.split(',').map(str::trim).collect();
            let split = names.split_at_checked(ANGLE_NAMES.len());
            let Some((_, rest)) = split.filter(|(angles, _)| *angles == ANGLE_NAMES) else {
                let found = format!("columns {}", shortened(value));
                let allowed = format!("{} and then those of the BRDF", ANGLE_NAMES.join(","));
                return Err(Error::malformed(Place::Line(line), found, allowed));
            };
            return Ok(Self {
                points,
                columns: Columns::named(rest, line)?,
                width: names.len(),
            });
        }
        let allowed = "a line VARS with the names of the columns";
        Err(Error::malformed(
            Place::Field("VARS".into()),
            "no such line",
            allowed,
        ))
    }
}
