use std::fmt::Write as _;

use brdf::{Brdf, Spherical};
use glam::DVec3;

use crate::colour::{rgb_of_xyz, xyz_of_rgb};
use crate::coordinates::MIRROR;
use crate::lattice::Lattice;
use crate::tar::{archive, members};
use crate::text::{angle_deg, lines, number, numbers, reflectance, text, written};
use crate::zemax::about_mirror;
use crate::{Error, Export, Format, Place, Tolerance};

/// The text of pab Advanced Technologies' gonio-photometers, of which Radiance makes its BSDF files.
pub(crate) const FORMAT: Format = Format {
    name: "pab-opto",
    extension: "tar",
    about: "Archive of pab-opto Mountain text, a file for each angle of incidence with CIE XYZ: `pabopto2bsdf`, `bsdf2klems` and \
            `bsdf2ttree` make Radiance and WINDOW XML of them. Radiance fits lobes to them, which loses a few percent more.",
    tolerance: Tolerance::TABLE,
    write,
    recognises: |bytes| {
        let first = members(bytes).next();
        first.is_some_and(|member| member.is_ok_and(|(_, content)| content.starts_with(b"#sample_name")))
    },
    read,
};

/// Most directions of all files together.
const NODES: usize = 60_000;
/// A direction nearer to the mirror direction than this, rad, has no azimuth about it.
const DEGENERATE_RAD: f64 = 1e-6;

fn write(export: &Export<'_>) -> Result<Vec<u8>, Error> {
    let table = about_mirror(export.brdf, &FORMAT.tolerance, NODES);
    let [incidence, azimuth, radial] = table.axes();
    let mut files = Vec::new();
    for (a, &theta_i) in incidence.iter().enumerate() {
        let name = crate::text::shortened(&export.metadata.specimen);
        let mut out = format!(
            "#sample_name \"{}\"\n#format: theta phi BRDF\n",
            name.replace('"', "'")
        );
        for (name, value) in export.metadata.lines() {
            let _ = writeln!(out, "# {name}: {value}");
        }
        let degrees = theta_i.to_degrees();
        let _ = writeln!(
            out,
            "#intheta {degrees:.6}\n#inphi 0\n#upphi 90\n#colorimetry: CIE-XYZ"
        );
        for (b, &azimuth) in azimuth.iter().enumerate() {
            for (c, &radial) in radial.iter().enumerate() {
                let (_, exitant) = (MIRROR.directions)([theta_i, azimuth, radial]);
                if exitant.z <= 1e-6 || (radial == 0.0 && b > 0) {
                    continue;
                }
                // There the light comes from azimuth 180°; here from 0.
                let place = Spherical::from_direction(DVec3::new(-exitant.x, -exitant.y, exitant.z));
                let value = xyz_of_rgb(table.node([a, b, c]))
                    .to_array()
                    .map(written)
                    .join(" ");
                let phi = place.phi.to_degrees();
                let _ = writeln!(out, "{:.10} {phi:.10} {value}", place.theta.to_degrees());
                if azimuth > 1e-6 && azimuth < std::f64::consts::PI - 1e-6 {
                    let _ = writeln!(out, "{:.10} {:.10} {value}", place.theta.to_degrees(), -phi);
                }
            }
        }
        files.push((format!("theta_{degrees:06.3}.txt"), out.into_bytes()));
    }
    Ok(archive(&files))
}

fn read(bytes: &[u8]) -> Result<Box<dyn Brdf>, Error> {
    let mut nodes = Vec::new();
    for member in members(bytes) {
        let (name, content) = member?;
        file(content, &mut nodes).map_err(|error| match error {
            Error::Malformed {
                place,
                found,
                allowed,
            } => Error::malformed(Place::Field(format!("{name}, {place}")), found, allowed),
            error => error,
        })?;
    }
    // In the mirror direction itself there is no azimuth about it: its value is that of all.
    let mut azimuths: Vec<f64> = nodes.iter().map(|([_, azimuth, _], _)| *azimuth).collect();
    azimuths.sort_unstable_by(f64::total_cmp);
    azimuths.dedup_by(|b, a| *b - *a < DEGENERATE_RAD);
    let centres: Vec<_> = nodes
        .iter()
        .filter(|([_, _, radial], _)| *radial <= DEGENERATE_RAD)
        .copied()
        .collect();
    // Bounded by the nodes there are, since every azimuth is one of a node and most files have one centre.
    if centres.len().saturating_mul(azimuths.len()) <= 8 * nodes.len() {
        let around = |([theta, _, radial], value): ([f64; 3], DVec3)| {
            azimuths
                .iter()
                .map(move |&azimuth| ([theta, azimuth, radial], value))
        };
        nodes.extend(centres.into_iter().flat_map(around).collect::<Vec<_>>());
    }
    let names = ["intheta", "azimuth", "radial"];
    Ok(Box::new(Lattice::from_nodes(
        MIRROR,
        names,
        &nodes,
        Some([1, 2, 0]),
    )?))
}

/// Adds the directions of one file.
fn file(bytes: &[u8], nodes: &mut Vec<([f64; 3], DVec3)>) -> Result<(), Error> {
    let (mut theta_i, mut phi_i, mut xyz) = (None, 0.0, false);
    for (line, text) in lines(text(bytes)?) {
        if let Some(comment) = text.strip_prefix('#') {
            let (key, value) = comment
                .trim()
                .split_once(char::is_whitespace)
                .unwrap_or((comment, ""));
            match key.trim_end_matches(':') {
                "intheta" => theta_i = Some(angle_deg(number(value, line)?, [0.0, 90.0], "intheta", line)?),
                "inphi" => phi_i = angle_deg(number(value, line)?, [-360.0, 360.0], "inphi", line)?,
                "colorimetry" => xyz = value.trim() == "CIE-XYZ",
                _ => {}
            }
            continue;
        }
        if text.is_empty() {
            continue;
        }
        let row = numbers(text.split_whitespace(), line)?;
        let Some(theta_i) = theta_i else {
            return Err(Error::malformed(
                Place::Line(line),
                "numbers",
                "a line #intheta before them",
            ));
        };
        let value = match (row.as_slice(), xyz) {
            (&[_, _, x, y, z], true) => rgb_of_xyz(DVec3::new(x, y, z)),
            (&[_, _, value], false) => DVec3::splat(value),
            _ => {
                let allowed = if xyz { "5 numbers" } else { "3 numbers" };
                return Err(Error::malformed(
                    Place::Line(line),
                    format!("{} numbers", row.len()),
                    allowed,
                ));
            }
        };
        let place = Spherical {
            theta: angle_deg(row[0], [0.0, 90.0], "theta", line)?,
            phi: angle_deg(row[1], [-360.0, 360.0], "phi", line)?,
        };
        // Along the normal itself the light would have lost its azimuth.
        let incident = Spherical {
            theta: f64::max(theta_i, 1e-9),
            phi: phi_i,
        };
        let [theta, azimuth, radial] = (MIRROR.of)(incident.direction(), place.direction());
        let azimuth = if radial > DEGENERATE_RAD { azimuth } else { 0.0 };
        let value = value.to_array().map(|value| reflectance(value, line));
        let [r, g, b] = value;
        nodes.push(([theta, azimuth, radial], DVec3::new(r?, g?, b?)));
    }
    Ok(())
}
