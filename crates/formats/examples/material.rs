//! Writes a specimen in a format, or tells its values, for whoever reads the file by other means.
//!
//! `material SPECIMEN FORMAT FILE` writes; the figures go to stdout. `material SPECIMEN` reads ω_i and ω_o (six numbers)
//! from each line of stdin and prints red, green and blue in sr⁻¹; so does `material read FILE`, of a file's BRDF.

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

use formats::{Export, Format};
use glam::DVec3;

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("material: {error}");
            ExitCode::from(2)
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [specimen, format, file] => {
            let brdf = brdf::specimen(specimen)?;
            let exported = Format::named(format)?.export(&Export::of(&brdf, specimen))?;
            std::fs::write(file, &exported.bytes)?;
            println!(
                "{specimen} {format} {} bytes; {}",
                exported.bytes.len(),
                exported.fidelity
            );
            Ok(())
        }
        ["read", file] => answer(formats::read(Path::new(file))?.1.as_ref()),
        [specimen] => answer(&brdf::specimen(specimen)?),
        _ => Err("usage: material SPECIMEN [FORMAT FILE], or material read FILE".into()),
    }
}

fn answer(brdf: &dyn brdf::Brdf) -> Result<(), Box<dyn Error>> {
    for line in std::io::stdin().lines() {
        let numbers: Vec<f64> = line?
            .split_whitespace()
            .map(str::parse)
            .collect::<Result<_, _>>()?;
        let [ix, iy, iz, ox, oy, oz] = numbers[..] else {
            return Err(format!("six numbers a line, not {}", numbers.len()).into());
        };
        let value = brdf.eval(DVec3::new(ix, iy, iz), DVec3::new(ox, oy, oz));
        println!("{:?} {:?} {:?}", value.x, value.y, value.z);
    }
    Ok(())
}
