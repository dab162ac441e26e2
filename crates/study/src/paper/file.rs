use std::ops::RangeInclusive;

use pdv::{Distribution, Draw};
use serde::Deserialize;

use super::{Evaluation, Plane, VirtualArc};
use crate::check::Check;
use crate::material::Names;
use crate::{Error, Kind};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStudy {
    #[serde(rename = "study")]
    _kind: Kind,
    materials: Names,
    plane: RawPlane,
    arc: RawArc,
    compare: RawCompare,
    spheres: RawSpheres,
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSpheres {
    materials: Names,
    theta_r_deg: f64,
}

const READINGS: RangeInclusive<usize> = 1..=2000;

impl Evaluation {
    /// Reads the text of a study file; `file` names it in errors. A `quick` one has a hundredth of the pairs.
    ///
    /// # Errors
    /// An unknown or missing key, a wrong type, a value out of range, or a material that is not known.
    pub fn parse(text: &str, file: &str, quick: bool) -> Result<Self, Error> {
        let check = Check { file };
        let raw: RawStudy = check.parse(text)?;
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
        let (plane, arc, compare) = (&raw.plane, &raw.arc, &raw.compare);
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
        let shown = raw.spheres.theta_r_deg;
        check.number(
            "spheres.theta_r_deg",
            shown,
            raw.plane.theta_r_deg.contains(&shown),
            "one of plane.theta_r_deg",
        )?;
        Ok(Self {
            materials: raw.materials.materials(file)?,
            spheres: raw.spheres.materials.materials(file)?,
            shown: shown.to_radians(),
            theta_r: raw.plane.theta_r_deg.iter().map(|deg| deg.to_radians()).collect(),
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
                pairs: if quick {
                    compare.pairs.div_ceil(100)
                } else {
                    compare.pairs
                },
                theta_max: theta_max.to_radians(),
                seed: compare.seed,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHIPPED: &str = include_str!("../../../../config/studies/paper.toml");

    fn error(from: &str, to: &str) -> String {
        assert!(SHIPPED.contains(from), "{from} is not in the shipped file");
        match Evaluation::parse(&SHIPPED.replacen(from, to, 1), "study.toml", false) {
            Ok(_) => panic!("{to} was accepted"),
            Err(error) => format!(
                "{error}: {:?}",
                std::error::Error::source(&error).map(ToString::to_string)
            ),
        }
    }

    #[test]
    fn the_shipped_file_is_the_papers_evaluation() {
        let study = Evaluation::parse(SHIPPED, "paper.toml", false).unwrap();
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
