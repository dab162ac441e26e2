use std::path::Path;
use std::sync::Arc;

use anyhow::Context;
use brdf::Brdf;
use formats::{Export, FORMATS, Format};

use crate::export::write;

/// Reads a BRDF from a file of any format, or takes a specimen that a text names, and writes it in a format: that of a
/// name, else the one to which the target's extension belongs.
///
/// # Errors
/// The file is in no known format or damaged; several formats have the extension, or none; the format does not hold the
/// BRDF; the target cannot be written.
pub(crate) fn convert(from: &str, to: &Path, name: Option<&str>) -> anyhow::Result<()> {
    let format = match name {
        Some(name) => Format::named(name)?,
        None => by_extension(to)?,
    };
    let path = Path::new(from);
    let (specimen, brdf): (&str, Arc<dyn Brdf>) = if path.is_file() {
        let (_, brdf) = formats::read(path)?;
        (
            path.file_stem()
                .and_then(|stem| stem.to_str())
                .unwrap_or_default(),
            brdf.into(),
        )
    } else {
        (from, brdf::specimen(from)?)
    };
    write(format, &Export::of(&brdf, specimen), Some(to))
}

/// The only format with the extension of a path.
fn by_extension(path: &Path) -> anyhow::Result<&'static Format> {
    let extension = path
        .extension()
        .and_then(|extension| extension.to_str())
        .unwrap_or_default();
    let names = |formats: &[&Format]| {
        formats
            .iter()
            .map(|format| format.name)
            .collect::<Vec<_>>()
            .join(", ")
    };
    let found: Vec<&Format> = FORMATS
        .iter()
        .filter(|format| format.extension == extension)
        .collect();
    match found[..] {
        [format] => Ok(format),
        [] => Err(anyhow::anyhow!(
            "no format has the extension \"{extension}\"; --format takes {}",
            names(&FORMATS.iter().collect::<Vec<_>>())
        )),
        _ => Err(anyhow::anyhow!(
            "several formats have the extension \"{extension}\": {}",
            names(&found)
        )),
    }
    .context("choose one with --format")
}
