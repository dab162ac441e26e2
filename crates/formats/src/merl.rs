use brdf::{Brdf, MerlTable};
use glam::DVec3;

use crate::{Error, Export, Format, Tolerance};

/// The table of the MERL database (Matusik et al. 2003): 90 × 90 × 180 nodes of half and difference angles.
pub(crate) const FORMAT: Format = Format {
    name: "merl",
    extension: "binary",
    about: "Table of the MERL database over half and difference angles, f64, 35 MB, read by most renderers. Keeps RGB and \
            where nothing is known; loses readings, wavelengths and uncertainty.",
    tolerance: Tolerance::ANY,
    write,
    recognises: |bytes| bytes.len() as u64 == MerlTable::FILE_BYTES || bytes.starts_with(&HEADER),
    read,
};

/// 90, 90 and 180 as int32, little-endian.
const HEADER: [u8; 12] = [90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0];

fn write(export: &Export<'_>) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    let table = MerlTable::fill(&Marked(export.brdf));
    match table.write_to(&mut bytes) {
        Ok(()) => Ok(bytes),
        Err(error) => Err(Error::Library {
            library: "brdf",
            source: Box::new(error),
        }),
    }
}

fn read(bytes: &[u8]) -> Result<Box<dyn Brdf>, Error> {
    Ok(Box::new(MerlTable::read_from(bytes).map_err(Error::Merl)?))
}

/// A BRDF with −1, as MERL marks what is not valid, where it rests on nothing.
struct Marked<'a>(&'a dyn Brdf);

impl Brdf for Marked<'_> {
    fn eval(&self, incident: DVec3, exitant: DVec3) -> DVec3 {
        match self.0.valid(incident, exitant) {
            true => self.0.eval(incident, exitant),
            false => DVec3::NEG_ONE,
        }
    }
}
