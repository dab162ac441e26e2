use std::fmt::Write as _;

use brdf::Brdf;
use glam::DVec3;

use crate::principled::Principled;
use crate::text::{lines, number, shortened, text};
use crate::{Error, Export, Fidelity, Format, Place, Tolerance};

/// A MaterialX document with a surface of OpenPBR.
pub(crate) const FORMAT: Format = Format {
    name: "materialx",
    extension: "mtlx",
    about: "MaterialX document with a surface of OpenPBR: base colour, metalness, roughness and index of refraction, fitted. Six \
            numbers look like the specimen and measure nothing: how far they are from it stands in the file.",
    tolerance: Tolerance::ANY,
    write,
    recognises: |bytes| {
        String::from_utf8_lossy(&bytes[..bytes.len().min(1 << 16)]).contains("<open_pbr_surface")
    },
    read,
};

fn write(export: &Export<'_>) -> Result<Vec<u8>, Error> {
    let fit = Principled::fitted(export.brdf);
    // Two hyphens would end a comment.
    let comment = |text: &str| text.replace("--", "- -");
    let mut out =
        String::from("<?xml version=\"1.0\"?>\n<materialx version=\"1.39\" colorspace=\"lin_rec709\">\n");
    for (name, value) in export.metadata.lines() {
        let _ = writeln!(out, "  <!-- {name}: {} -->", comment(&value));
    }
    let _ = writeln!(
        out,
        "  <!-- fit: {} -->",
        comment(&Fidelity::between(export.brdf, &fit).to_string())
    );
    let [r, g, b] = fit.base.to_array();
    out.push_str("  <open_pbr_surface name=\"specimen_surface\" type=\"surfaceshader\">\n");
    let _ = writeln!(
        out,
        "    <input name=\"base_color\" type=\"color3\" value=\"{r:.6}, {g:.6}, {b:.6}\" />"
    );
    for (name, value) in [
        ("base_metalness", fit.metalness),
        ("specular_roughness", fit.roughness),
        ("specular_ior", fit.ior),
    ] {
        let _ = writeln!(
            out,
            "    <input name=\"{name}\" type=\"float\" value=\"{value:.6}\" />"
        );
    }
    out.push_str(
        "  </open_pbr_surface>\n  <surfacematerial name=\"specimen\" type=\"material\">\n    <input name=\"surfaceshader\" \
         type=\"surfaceshader\" nodename=\"specimen_surface\" />\n  </surfacematerial>\n</materialx>\n",
    );
    Ok(out.into_bytes())
}

/// Reads the inputs of the first surface of OpenPBR; each stands on a line of its own.
fn read(bytes: &[u8]) -> Result<Box<dyn Brdf>, Error> {
    let mut fit = Principled {
        base: DVec3::splat(0.8),
        metalness: 0.0,
        roughness: 0.3,
        ior: 1.5,
    };
    let mut inside = false;
    for (line, text) in lines(text(bytes)?) {
        if text.contains("</open_pbr_surface>") && inside {
            return Ok(Box::new(fit));
        }
        inside |= text.contains("<open_pbr_surface");
        let attribute = |key: &str| {
            let (_, rest) = text.split_once(&format!(" {key}=\""))?;
            rest.split_once('"').map(|(value, _)| value)
        };
        let (true, Some(name), Some(value)) = (
            inside && text.starts_with("<input"),
            attribute("name"),
            attribute("value"),
        ) else {
            continue;
        };
        let one = |value: &str, [low, high]: [f64; 2]| {
            let number = number(value, line)?;
            match (low..=high).contains(&number) {
                true => Ok(number),
                false => {
                    let found = format!("{} of {number}", shortened(name));
                    Err(Error::malformed(
                        Place::Line(line),
                        found,
                        format!("{low} … {high}"),
                    ))
                }
            }
        };
        match name {
            "base_color" => {
                let parts: Vec<f64> = value
                    .split(',')
                    .map(|part| one(part, [0.0, 1.0]))
                    .collect::<Result<_, _>>()?;
                let &[r, g, b] = parts.as_slice() else {
                    let found = format!("{} numbers", parts.len());
                    return Err(Error::malformed(Place::Line(line), found, "red, green and blue"));
                };
                fit.base = DVec3::new(r, g, b);
            }
            "base_metalness" => fit.metalness = one(value, [0.0, 1.0])?,
            "specular_roughness" => fit.roughness = one(value, [0.0, 1.0])?,
            "specular_ior" => fit.ior = one(value, [1.0, 100.0])?,
            // What else a surface has is not looked at.
            _ => {}
        }
    }
    let allowed = "an element open_pbr_surface that is closed";
    Err(Error::malformed(
        Place::Field("open_pbr_surface".into()),
        "none",
        allowed,
    ))
}
