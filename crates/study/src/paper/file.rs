use std::ops::RangeInclusive;

use pdv::{Distribution, Draw};
use serde::Deserialize;

use super::{Evaluation, Nodes};
use crate::check::Check;
use crate::material::Names;
use crate::{Error, Kind};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStudy {
    #[serde(rename = "study")]
    _kind: Kind,
    materials: Names,
    grid: RawGrid,
    plane: RawPlane,
    compare: RawCompare,
    spheres: RawSpheres,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawGrid {
    theta_r: usize,
    d_p: usize,
    distribution: Distribution,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlane {
    theta_r_deg: Vec<f64>,
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

const NODES: RangeInclusive<usize> = 2..=2000;

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
        let RawGrid {
            theta_r,
            d_p,
            distribution,
        } = raw.grid;
        check.number("grid.theta_r", theta_r, NODES.contains(&theta_r), "2 … 2000")?;
        check.number("grid.d_p", d_p, NODES.contains(&d_p), "2 … 2000")?;
        for deg in &raw.plane.theta_r_deg {
            let node = deg * theta_r as f64 / 90.0;
            let good = (0.0..90.0).contains(deg) && (node - node.round()).abs() < 1e-9;
            let allowed = "a node of the grid: a multiple of 90/grid.theta_r, 0 … below 90";
            check.number("plane.theta_r_deg", *deg, good, allowed)?;
        }
        let compare = &raw.compare;
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
            nodes: Nodes {
                theta_r,
                d_p,
                distribution,
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
        let nodes = study.nodes;
        let (d_p, thetas) = (nodes.deviations(), nodes.thetas().collect::<Vec<_>>());
        assert_eq!((thetas.len(), d_p.len()), (90, 90));
        assert_eq!((d_p[0], d_p[89]), (0.0, 2.0));
        // Every plane stands at a node of the arc.
        for theta_r in study.theta_r {
            assert!(
                thetas.iter().any(|theta| (theta - theta_r).abs() < 1e-12),
                "{theta_r}"
            );
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let text = error("[plane]", "[plane]\nspeed = 3");
        assert!(
            text.contains("study.toml") && text.contains("speed") && text.contains("line"),
            "{text}"
        );
        assert!(error("[45.0,", "[95.0,").contains("plane.theta_r_deg is 95, allowed is a node of the grid"));
        assert!(
            error("[45.0,", "[44.5,").contains("plane.theta_r_deg is 44.5, allowed is a node of the grid")
        );
        assert!(error("d_p = 90", "d_p = 1").contains("grid.d_p is 1, allowed is 2 … 2000"));
        assert!(error("pairs = 3_600_000", "pairs = 0").contains("compare.pairs is 0, allowed is 1 … 1e10"));
        assert!(error("materials = \"all\"", "materials = [\"chrom\"]").contains("did you mean chrome"));
        assert!(error("materials = \"all\"", "materials = []").contains("at least one name"));
        assert!(error("distribution = \"capped\"", "distribution = \"steep\"").contains("steep"));
    }
}
