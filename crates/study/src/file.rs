use std::ops::RangeInclusive;
use std::path::Path;

use brdf::Fitted;
use pdv::{Distribution, Draw};
use serde::Deserialize;

use crate::{Error, Material, Plane, Study, VirtualArc};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStudy {
    materials: RawMaterials,
    plane: RawPlane,
    arc: RawArc,
    compare: RawCompare,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum RawMaterials {
    One(String),
    Many(Vec<String>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlane {
    theta_r_deg: Vec<f64>,
    readings: usize,
    distribution: Distribution,
    light_max_deg: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawArc {
    readings: usize,
    theta_max_deg: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCompare {
    pairs: u64,
    theta_max_deg: f64,
    seed: u64,
}

const READINGS: RangeInclusive<usize> = 1..=2000;

impl Study {
    /// Reads a study file.
    ///
    /// # Errors
    /// The file cannot be read, or as for [`Study::parse`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|source| Error::Io {
            what: "read",
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Checks the text of a study file; `file` names it in errors.
    ///
    /// # Errors
    /// An unknown or missing key, a wrong type, a value out of range, or a material that is not known.
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        let raw: RawStudy = toml::from_str(text).map_err(|error| Error::Syntax {
            file: file.to_owned(),
            message: error.to_string(),
        })?;
        let check = Check { file };
        if raw.plane.theta_r_deg.is_empty() {
            return Err(check.range("plane.theta_r_deg", "empty", "at least one angle"));
        }
        for theta in &raw.plane.theta_r_deg {
            check.number(
                "plane.theta_r_deg",
                *theta,
                (0.0..90.0).contains(theta),
                "0 … below 90",
            )?;
        }
        let (plane, arc, compare) = (raw.plane, raw.arc, raw.compare);
        let quarter = 0.0..=90.0;
        check.number(
            "plane.readings",
            plane.readings,
            READINGS.contains(&plane.readings),
            "1 … 2000",
        )?;
        check.number(
            "plane.light_max_deg",
            plane.light_max_deg,
            quarter.contains(&plane.light_max_deg),
            "0 … 90",
        )?;
        check.number(
            "arc.readings",
            arc.readings,
            READINGS.contains(&arc.readings),
            "1 … 2000",
        )?;
        check.number(
            "arc.theta_max_deg",
            arc.theta_max_deg,
            quarter.contains(&arc.theta_max_deg),
            "0 … 90",
        )?;
        check.number(
            "compare.pairs",
            compare.pairs,
            (1..=10_000_000_000).contains(&compare.pairs),
            "1 … 1e10",
        )?;
        let theta_max = compare.theta_max_deg;
        check.number(
            "compare.theta_max_deg",
            theta_max,
            theta_max > 0.0 && theta_max <= 90.0,
            "above 0 … 90",
        )?;
        Ok(Self {
            materials: check.materials(raw.materials)?,
            theta_r: plane.theta_r_deg.iter().map(|deg| deg.to_radians()).collect(),
            plane: Plane {
                readings: plane.readings,
                distribution: plane.distribution,
                light_max: plane.light_max_deg.to_radians(),
            },
            arc: VirtualArc {
                readings: arc.readings,
                theta_max: arc.theta_max_deg.to_radians(),
            },
            draw: Draw {
                pairs: compare.pairs,
                theta_max: theta_max.to_radians(),
                seed: compare.seed,
            },
        })
    }
}

struct Check<'a> {
    file: &'a str,
}

impl Check<'_> {
    fn range(&self, key: &'static str, value: impl ToString, allowed: &'static str) -> Error {
        Error::Range {
            file: self.file.to_owned(),
            key,
            value: value.to_string(),
            allowed,
        }
    }

    fn number(
        &self,
        key: &'static str,
        value: impl ToString,
        good: bool,
        allowed: &'static str,
    ) -> Result<(), Error> {
        if good {
            Ok(())
        } else {
            Err(self.range(key, value, allowed))
        }
    }

    fn materials(&self, raw: RawMaterials) -> Result<Vec<Material>, Error> {
        let names = match raw {
            RawMaterials::One(all) if all == "all" => {
                Fitted::all().map(|(name, _)| name.to_owned()).collect()
            }
            RawMaterials::One(name) => vec![name],
            RawMaterials::Many(names) => names,
        };
        if names.is_empty() {
            return Err(self.range("materials", "empty", "\"all\" or at least one name"));
        }
        let known = |name: String| match brdf::specimen(&name) {
            Ok(brdf) => Ok(Material { name, brdf }),
            Err(source) => Err(Error::Material {
                file: self.file.to_owned(),
                source,
            }),
        };
        names.into_iter().map(known).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHIPPED: &str = include_str!("../../../config/studies/paper.toml");

    fn error(from: &str, to: &str) -> String {
        assert!(SHIPPED.contains(from), "{from} is not in the shipped file");
        match Study::parse(&SHIPPED.replacen(from, to, 1), "study.toml") {
            Ok(_) => panic!("{to} was accepted"),
            Err(error) => format!(
                "{error}: {:?}",
                std::error::Error::source(&error).map(ToString::to_string)
            ),
        }
    }

    #[test]
    fn the_shipped_file_is_the_papers_evaluation() {
        let study = Study::parse(SHIPPED, "paper.toml").unwrap();
        assert_eq!(study.materials.len(), 100);
        assert_eq!(study.theta_r.len(), 4);
        assert_eq!(study.draw.pairs, 3_600_000);
        assert_eq!(study.plane.deviations(1.0).len(), 90);
        assert_eq!(study.arc.thetas().len(), 90);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let text = error("[plane]", "[plane]\nspeed = 3");
        assert!(
            text.contains("study.toml") && text.contains("speed") && text.contains("line"),
            "{text}"
        );
        assert!(error("[45.0,", "[95.0,").contains("plane.theta_r_deg is 95, allowed is 0 … below 90"));
        assert!(error("pairs = 3_600_000", "pairs = 0").contains("compare.pairs is 0, allowed is 1 … 1e10"));
        assert!(error("materials = \"all\"", "materials = [\"chrom\"]").contains("did you mean chrome"));
        assert!(error("materials = \"all\"", "materials = []").contains("at least one name"));
        assert!(error("distribution = \"capped\"", "distribution = \"steep\"").contains("steep"));
    }
}
