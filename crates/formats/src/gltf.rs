use brdf::Brdf;
use glam::DVec3;
use serde_json::{Value, json};

use crate::principled::Principled;
use crate::{Error, Export, Fidelity, Format, Place, Tolerance};

/// A material of glTF 2.0.
pub(crate) const FORMAT: Format = Format {
    name: "gltf",
    extension: "gltf",
    about: "Material of glTF 2.0: base colour, metalness, roughness and KHR_materials_ior, fitted. Six numbers look like the \
            specimen and measure nothing: how far they are from it stands in the file.",
    tolerance: Tolerance::ANY,
    write,
    recognises: |bytes| {
        let start = String::from_utf8_lossy(&bytes[..bytes.len().min(1 << 16)]).into_owned();
        start.trim_start().starts_with('{') && start.contains("pbrMetallicRoughness")
    },
    read,
};

fn write(export: &Export<'_>) -> Result<Vec<u8>, Error> {
    let fit = Principled::fitted(export.brdf);
    let [r, g, b] = fit.base.to_array();
    let known: serde_json::Map<String, Value> = export
        .metadata
        .lines()
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value.into()))
        .collect();
    let file = json!({
        "asset": { "version": "2.0", "generator": concat!("goniod ", env!("CARGO_PKG_VERSION")) },
        "extensionsUsed": ["KHR_materials_ior"],
        "materials": [{
            "name": export.metadata.specimen,
            "pbrMetallicRoughness": {
                "baseColorFactor": [r, g, b, 1.0],
                "metallicFactor": fit.metalness,
                "roughnessFactor": fit.roughness,
            },
            "extensions": { "KHR_materials_ior": { "ior": fit.ior } },
            "extras": { "goniod": known, "fit": Fidelity::between(export.brdf, &fit).to_string() },
        }],
    });
    Ok(format!("{file:#}\n").into_bytes())
}

fn read(bytes: &[u8]) -> Result<Box<dyn Brdf>, Error> {
    let file: Value = serde_json::from_slice(bytes).map_err(|error| {
        let place = Place::Line(error.line() as u64);
        Error::malformed(place, error.to_string(), "JSON")
    })?;
    let number = |pointer: &str, default: f64, [low, high]: [f64; 2]| {
        let full = format!("/materials/0{pointer}");
        let value = file.pointer(&full).map_or(Some(default), Value::as_f64);
        value.filter(|value| (low..=high).contains(value)).ok_or_else(|| {
            let found = file.pointer(&full).map(Value::to_string).unwrap_or_default();
            Error::malformed(
                Place::Field(full),
                crate::text::shortened(&found),
                format!("a number of {low} … {high}"),
            )
        })
    };
    if file.pointer("/materials/0").is_none() {
        return Err(Error::malformed(
            Place::Field("materials".into()),
            "no material",
            "at least one",
        ));
    }
    let base = |n: usize| {
        number(
            &format!("/pbrMetallicRoughness/baseColorFactor/{n}"),
            1.0,
            [0.0, 1.0],
        )
    };
    Ok(Box::new(Principled {
        base: DVec3::new(base(0)?, base(1)?, base(2)?),
        metalness: number("/pbrMetallicRoughness/metallicFactor", 1.0, [0.0, 1.0])?,
        roughness: number("/pbrMetallicRoughness/roughnessFactor", 1.0, [0.0, 1.0])?,
        ior: number("/extensions/KHR_materials_ior/ior", 1.5, [1.0, 100.0])?,
    }))
}
