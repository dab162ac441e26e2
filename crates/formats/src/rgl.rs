//! Tensor files of RGL: what Mitsuba calls `measured`, what pbrt-v4 and powitacq read.

mod bake;
mod facets;
mod loss;
mod measured;
mod slice;
mod tensor;
mod warp;

use brdf::Brdf;

use crate::{Error, Export, Format, Tolerance};

/// What a tensor file must hold: MALE is what refinement works towards.
const TOLERANCE: Tolerance = Tolerance {
    male: 0.0005,
    median: 0.01,
    p95: 0.05,
    albedo: 0.01,
    peak: 0.05,
};

/// The tensor file with red, green and blue.
pub(crate) const RGB: Format = Format {
    name: "rgl-rgb",
    extension: "bsdf",
    about: "Tensor file of RGL (Dupuy and Jakob 2018) with RGB, up to 5 MB, with importance sampling built in; for Mitsuba's \
            `measured` in its RGB variants and powitacq_rgb. Keeps 0.0005 of MALE or is refused; loses readings.",
    tolerance: TOLERANCE,
    write: |export| write(export, bake::Channels::Rgb),
    recognises: |bytes| is_tensor(bytes) && has_field(bytes, b"rgb"),
    read,
};

/// The tensor file with spectra.
pub(crate) const SPECTRAL: Format = Format {
    name: "rgl-spectral",
    extension: "bsdf",
    about: "Tensor file of RGL with spectra at the three wavelengths of the channels, linear between them; for Mitsuba's \
            `measured` in its spectral variants, pbrt-v4 and powitacq. As rgl-rgb.",
    tolerance: TOLERANCE,
    write: |export| write(export, bake::Channels::Spectral),
    recognises: is_tensor,
    read,
};

fn is_tensor(bytes: &[u8]) -> bool {
    bytes.starts_with(tensor::MAGIC)
}

/// Whether the list of fields, which stands at the start, names one.
fn has_field(bytes: &[u8], name: &[u8]) -> bool {
    tensor::Tensor::read(bytes).is_ok_and(|tensor| tensor.has(name))
}

fn write(export: &Export<'_>, channels: bake::Channels) -> Result<Vec<u8>, Error> {
    bake::bake(export, channels)
}

fn read(bytes: &[u8]) -> Result<Box<dyn Brdf>, Error> {
    Ok(Box::new(measured::Measured::read(bytes)?))
}
