use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use report::Picture;

use super::Evaluation;
use crate::{Error, Material, write};

/// Luminance of linear sRGB (IEC 61966-2-1).
const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);
/// Pixels between pictures.
const GAP: usize = 6;
/// Luminance difference that is shown white, in units of a white diffuser facing the key light.
const WHITE: f64 = 0.25;

/// Writes figure 8: for each material its lit sphere, the one of its reconstruction and their difference in luminance
/// as PNG and EXR, and all of them as figure8.png, which is returned.
///
/// # Errors
/// A material cannot be reconstructed, or the medium refuses.
pub(crate) fn write(evaluation: &Evaluation, directory: &Path) -> Result<Vec<u8>, Error> {
    let rows: Vec<[Picture; 3]> = evaluation
        .spheres
        .par_iter()
        .map(|material| row(evaluation, material))
        .collect::<Result<_, _>>()?;
    let mut sheet: Vec<[Vec<u8>; 3]> = Vec::new();
    for (material, [reference, estimate, difference]) in evaluation.spheres.iter().zip(&rows) {
        let name = &material.name;
        let shown = [
            reference.tone_mapped(report::SPHERE_EXPOSURE),
            estimate.tone_mapped(report::SPHERE_EXPOSURE),
            heat(difference),
        ];
        for (kind, (picture, pixels)) in [
            ("reference", (reference, &shown[0])),
            ("reconstruction", (estimate, &shown[1])),
            ("difference", (difference, &shown[2])),
        ] {
            let file = format!("figure8-{name}-{kind}");
            exr(&directory.join(format!("{file}.exr")), picture)?;
            let size = (picture.width as u32, picture.height() as u32);
            write::file(
                directory,
                &format!("{file}.png"),
                &crate::figure::png(size, pixels)?,
            )?;
        }
        sheet.push(shown);
    }
    let side = rows.first().map_or(1, |row| row[0].width);
    let png = contact(&sheet, side)?;
    write::file(directory, "figure8.png", &png)?;
    Ok(png)
}

fn row(evaluation: &Evaluation, material: &Material) -> Result<[Picture; 3], Error> {
    let models = evaluation.reconstruct(material)?;
    let off = |theta_r: f64| (theta_r - evaluation.shown).abs();
    let model = models
        .iter()
        .min_by(|a, b| off(a.theta_r()).total_cmp(&off(b.theta_r())));
    let model = model.expect("a study has at least one angle");
    let (reference, estimate) = (report::sphere(&material.brdf), report::sphere(model));
    let pixels = reference.pixels.iter().zip(&estimate.pixels);
    let difference = Picture {
        width: reference.width,
        pixels: pixels
            .map(|(f, g)| DVec3::splat((*g - *f).dot(LUMINANCE)))
            .collect(),
    };
    Ok([reference, estimate, difference])
}

/// How far two luminances are apart, as the paper shows it: dark blue is none, white is much.
fn heat(difference: &Picture) -> Vec<u8> {
    let colour = |pixel: &DVec3| {
        let t = (pixel.x.abs() * report::SPHERE_EXPOSURE / WHITE).min(1.0).sqrt();
        let ramp = [
            DVec3::new(10.0, 15.0, 70.0),
            DVec3::new(30.0, 120.0, 200.0),
            DVec3::new(255.0, 220.0, 80.0),
            DVec3::new(255.0, 255.0, 255.0),
        ];
        let at = t * 3.0;
        let below = (at as usize).min(2);
        let mixed = ramp[below].lerp(ramp[below + 1], at - below as f64);
        mixed.to_array().map(|c| c.round() as u8)
    };
    difference.pixels.iter().flat_map(colour).collect()
}

/// Two materials a row, three pictures each.
fn contact(sheet: &[[Vec<u8>; 3]], side: usize) -> Result<Vec<u8>, Error> {
    let (columns, rows) = (6, sheet.len().div_ceil(2));
    let (width, height) = (columns * (side + GAP) + GAP, rows * (side + GAP) + GAP);
    let mut pixels = vec![255; 3 * width * height];
    for (i, pictures) in sheet.iter().enumerate() {
        for (k, picture) in pictures.iter().enumerate() {
            let left = GAP + (3 * (i % 2) + k) * (side + GAP);
            let top = GAP + (i / 2) * (side + GAP);
            for (y, line) in picture.chunks_exact(3 * side).enumerate() {
                let at = 3 * ((top + y) * width + left);
                pixels[at..at + line.len()].copy_from_slice(line);
            }
        }
    }
    Ok(crate::figure::png((width as u32, height as u32), &pixels)?)
}

fn exr(path: &Path, picture: &Picture) -> Result<(), Error> {
    let io = |source| Error::Io {
        what: "write",
        path: path.to_owned(),
        source,
    };
    let mut file = BufWriter::new(File::create(path).map_err(io)?);
    let attributes = [("unit", "radiance; 1/sr times irradiance")];
    picture.write_exr(&mut file, &attributes).map_err(io)
}
