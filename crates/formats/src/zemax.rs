use std::f64::consts::PI;
use std::fmt::Write as _;

use brdf::Brdf;
use glam::DVec3;

use crate::colour::{rgb_of_xyz, xyz_of_rgb};
use crate::coordinates::{MIRROR, folded};
use crate::lattice::Lattice;
use crate::refinement::{even, fitted};
use crate::text::{angle_deg, lines, number, reflectance, shortened, text, written};
use crate::{Error, Export, Format, Place, Tolerance, albedo};

/// The BSDF data interchange file of Radiant Imaging, which Zemax OpticStudio reads.
pub(crate) const FORMAT: Format = Format {
    name: "zemax",
    extension: "bsdf",
    about: "BSDF data interchange text of Radiant and Zemax: CIE XYZ over angle of incidence and the place about the mirror \
            direction, azimuth 0 towards the normal, with the total scatter of each angle. Programs may ignore colour. Loses \
            readings and what lies between the nodes.",
    tolerance: Tolerance::TABLE,
    write,
    recognises: |bytes| {
        let start = String::from_utf8_lossy(&bytes[..bytes.len().min(1 << 16)]).into_owned();
        start.lines().any(|line| line.starts_with("ScatterRadial"))
    },
    read,
};

/// Most nodes.
const NODES: usize = 250_000;
/// Keywords of the lists of angles.
const LISTS: [&str; 3] = ["AngleOfIncidence", "ScatterAzimuth", "ScatterRadial"];
/// Keyword of each block of numbers.
const BLOCKS: [&str; 3] = ["TristimulusX", "TristimulusY", "TristimulusZ"];

/// A table about the mirror direction with nodes where a BRDF needs them.
pub(crate) fn about_mirror(brdf: &dyn Brdf, tolerance: &Tolerance, most: usize) -> Lattice {
    let radial = (0..=20).map(|n| (f64::from(n) / 20.0).powi(2) * PI).collect();
    let start = [even(0.0, 89.0_f64.to_radians(), 6), even(0.0, PI, 4), radial];
    fitted(MIRROR, start, brdf, tolerance, most)
}

fn write(export: &Export<'_>) -> Result<Vec<u8>, Error> {
    let table = about_mirror(export.brdf, &FORMAT.tolerance, NODES);
    let mut out = String::from("# BSDF data; beyond the horizon values go on as at the horizon\n");
    for (name, value) in export.metadata.lines() {
        let _ = writeln!(out, "# {name}: {value}");
    }
    out.push_str("Source Measured\nSymmetry PlaneSymmetrical\nSpectralContent XYZ\nScatterType BRDF\nSampleRotation 1\n0\n");
    for (name, axis) in LISTS.iter().zip(table.axes()) {
        let words: Vec<String> = axis
            .iter()
            .map(|angle| format!("{:.6}", angle.to_degrees()))
            .collect();
        let _ = writeln!(out, "{name} {}\n{}", axis.len(), words.join(" "));
    }
    let [incidence, azimuth, radial] = table.axes();
    let total: Vec<DVec3> = incidence
        .iter()
        .map(|&theta| xyz_of_rgb(albedo(export.brdf, theta)))
        .collect();
    for (channel, block) in BLOCKS.iter().enumerate() {
        let _ = writeln!(out, "\n{block}\nDataBegin");
        for (a, total) in total.iter().enumerate() {
            let _ = writeln!(out, "TIS {:.6}", total[channel]);
            for b in 0..azimuth.len() {
                let value = |c| written(xyz_of_rgb(table.node([a, b, c]))[channel]);
                let row: Vec<String> = (0..radial.len()).map(value).collect();
                let _ = writeln!(out, "{}", row.join(" "));
            }
        }
        out.push_str("DataEnd\n");
    }
    Ok(out.into_bytes())
}

/// The words of a file with the lines on which they stand, without comments.
struct Words<'a> {
    words: std::vec::IntoIter<(u64, &'a str)>,
    /// The line of the last word that was read.
    line: u64,
}

impl<'a> Words<'a> {
    fn new(bytes: &'a [u8]) -> Result<Self, Error> {
        let lines = lines(text(bytes)?).filter(|(_, line)| !line.starts_with('#'));
        let words: Vec<_> = lines
            .flat_map(|(n, line)| line.split_whitespace().map(move |word| (n, word)))
            .collect();
        Ok(Self {
            words: words.into_iter(),
            line: 1,
        })
    }

    fn next(&mut self, allowed: &str) -> Result<&'a str, Error> {
        match self.words.next() {
            Some((line, word)) => {
                self.line = line;
                Ok(word)
            }
            None => Err(Error::malformed(
                Place::Line(self.line),
                "the end of the file",
                allowed,
            )),
        }
    }

    fn number(&mut self) -> Result<f64, Error> {
        let word = self.next("a number")?;
        number(word, self.line)
    }

    /// One of some words.
    fn one_of(&mut self, allowed: &[&'static str]) -> Result<&'static str, Error> {
        let word = self.next(&allowed.join(", "))?;
        let known = allowed.iter().find(|known| **known == word).copied();
        known.ok_or_else(|| self.refuse(word, &allowed.join(", ")))
    }

    /// How many numbers follow and the numbers.
    fn list(&mut self) -> Result<Vec<f64>, Error> {
        let count = self.number()?;
        // Each number takes at least a word: what is left bounds how many there can be.
        if count.fract() != 0.0 || !(1.0..=self.words.len() as f64).contains(&count) {
            let allowed = format!(
                "a whole number from 1 to the {} words that follow",
                self.words.len()
            );
            return Err(self.refuse(&format!("a list of {count}"), &allowed));
        }
        (0..count as usize).map(|_| self.number()).collect()
    }

    /// A list of ascending angles in degrees from 0, in rad.
    fn angles(&mut self, what: &str, high_deg: f64) -> Result<Vec<f64>, Error> {
        let degrees = self.list()?;
        if !degrees.is_sorted_by(|a, b| a < b) {
            return Err(self.refuse(&format!("{what} out of order"), "ascending angles"));
        }
        degrees
            .into_iter()
            .map(|degrees| angle_deg(degrees, [0.0, high_deg], what, self.line))
            .collect()
    }

    fn refuse(&self, found: &str, allowed: &str) -> Error {
        Error::malformed(
            Place::Line(self.line),
            format!("\"{}\"", shortened(found)),
            allowed,
        )
    }
}

fn read(bytes: &[u8]) -> Result<Box<dyn Brdf>, Error> {
    let mut words = Words::new(bytes)?;
    let ([incidence, azimuth, radial], xyz) = head(&mut words)?;
    let colours = colours(&mut words, incidence.len(), azimuth.len() * radial.len(), xyz)?;
    let angles = incidence.iter().flat_map(|&a| {
        let radial = &radial;
        let about = azimuth.iter().map(|&b| folded(b));
        about.flat_map(move |b| radial.iter().map(move |&c| [a, b, c]))
    });
    let nodes: Vec<([f64; 3], DVec3)> = angles.zip(colours).collect();
    Ok(Box::new(Lattice::from_nodes(MIRROR, LISTS, &nodes, None)?))
}

/// Reads up to the keyword of the first block: the three lists of angles in rad, and whether the blocks are CIE XYZ.
fn head(words: &mut Words<'_>) -> Result<([Vec<f64>; 3], bool), Error> {
    let mut axes: [Option<Vec<f64>>; 3] = Default::default();
    let mut turn_deg = 360.0;
    let xyz = loop {
        let key = words.next("Monochrome or TristimulusX")?;
        match key {
            "Source" => _ = words.one_of(&["Measured", "Generated", "Simulated"])?,
            "Symmetry" => {
                turn_deg = match words.one_of(&["PlaneSymmetrical", "ASymmetrical"])? {
                    "PlaneSymmetrical" => 180.0,
                    _ => 360.0,
                }
            }
            "SpectralContent" => _ = words.one_of(&["Monochrome", "XYZ"])?,
            "ScatterType" => _ = words.one_of(&["BRDF"])?,
            "SampleRotation" => {
                if words.list()?.len() > 1 {
                    return Err(words.refuse("several rotations", "one rotation: an isotropic specimen"));
                }
            }
            "Monochrome" => break false,
            "TristimulusX" => break true,
            _ => {
                let Some(axis) = LISTS.iter().position(|list| *list == key) else {
                    return Err(words.refuse(key, "a keyword of the format"));
                };
                axes[axis] = Some(words.angles(key, [90.0, turn_deg, 180.0][axis])?);
            }
        }
    };
    match axes {
        [Some(incidence), Some(azimuth), Some(radial)] => Ok(([incidence, azimuth, radial], xyz)),
        _ => {
            let place = Place::Line(words.line);
            Err(Error::malformed(
                place,
                "a list of angles is missing",
                LISTS.join(", "),
            ))
        }
    }
}

/// Reads the blocks behind the first one's keyword: linear RGB in the order of the file.
fn colours(words: &mut Words<'_>, incidence: usize, about: usize, xyz: bool) -> Result<Vec<DVec3>, Error> {
    let blocks: &[&'static str] = if xyz { &BLOCKS } else { &["Monochrome"] };
    let mut colours: Vec<DVec3> = Vec::new();
    for (channel, block) in blocks.iter().enumerate() {
        if channel > 0 {
            words.one_of(&[block])?;
        }
        words.one_of(&["DataBegin"])?;
        for a in 0..incidence {
            words.one_of(&["TIS"])?;
            words.number()?;
            for b in 0..about {
                let number = words.number()?;
                let value = reflectance(number, words.line)?;
                match channel {
                    0 => colours.push(DVec3::splat(value)),
                    _ => colours[a * about + b][channel] = value,
                }
            }
        }
        words.one_of(&["DataEnd"])?;
    }
    if xyz {
        colours
            .iter_mut()
            .for_each(|colour| *colour = rgb_of_xyz(*colour));
    }
    Ok(colours)
}
