//! BRDF file formats: one file a format, all in the list [`FORMATS`].
//!
//! A BRDF goes in as an [`Export`] and comes out as bytes that were read back and compared with it: [`Format::export`].
//! A file that does not give back what was written, within the format's [`Tolerance`], is refused with its figures.
//! Reading ([`read`]) recognises a file by its content and gives a [`brdf::Brdf`].
//!
//! Reflectance is linear RGB in sr⁻¹, angles are in rad unless a name says otherwise. Specimens are isotropic: a file of
//! one that is not is refused. The crate knows nothing of how a BRDF was measured or reconstructed.
//!
//! ```
//! use formats::{Export, Format};
//!
//! let paint = brdf::Fitted::named("blue-rubber").unwrap();
//! let format = Format::named("ssdd")?;
//! let file = format.export(&Export::of(&paint, "blue rubber"))?;
//! assert!(file.fidelity.median < 0.01);
//! let again = (format.read)(&file.bytes)?;
//! # let _ = again;
//! # Ok::<(), formats::Error>(())
//! ```

mod astm;
mod colour;
mod coordinates;
mod csv_long;
mod error;
mod export;
mod exr_slice;
mod fidelity;
mod format;
mod gltf;
mod lattice;
mod materialx;
mod merl;
mod pab_opto;
mod principled;
mod refinement;
mod rgl;
mod scattered;
mod ssdd;
mod tar;
mod text;
mod zemax;

pub use error::{Error, Place};
pub use export::{Export, Metadata, Reading};
pub use fidelity::{Fidelity, albedo};
pub use format::{Exported, Format, Reader, Tolerance, read, recognise};
pub use scattered::ScatteredReading;

/// Every format, in the order in which files are recognised. A new one is a file of this crate and a line here.
pub static FORMATS: [Format; 12] = [
    merl::FORMAT,
    csv_long::FORMAT,
    rgl::RGB,
    rgl::SPECTRAL,
    astm::FORMAT,
    zemax::FORMAT,
    ssdd::FORMAT,
    pab_opto::FORMAT,
    exr_slice::PDV,
    exr_slice::HALF_DIFFERENCE,
    materialx::FORMAT,
    gltf::FORMAT,
];

/// The page for people, whose example is compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/formats.md")]
struct Page;
