use brdf::Brdf;
use pdv::{Density, Distribution, Pdv};

use super::{Evaluation, Row};
use crate::figure::{Axis, COLOURS, Curve, Figure, Mark, SeriesLabelPosition};
use crate::{Error, Material};

/// The two materials of figure 2, one glossy and one diffuse.
const SLICES: [&str; 2] = ["alum-bronze", "blue-rubber"];
/// θ_r of figure 2, degrees.
const SLICE_DEG: f64 = 45.0;

/// Figures 2, 3 and 7 with the names of their files.
///
/// # Errors
/// A material cannot be reconstructed.
pub(crate) fn all(evaluation: &Evaluation, rows: &[Row]) -> Result<Vec<(String, Figure)>, Error> {
    let mut figures = Vec::new();
    for name in SLICES {
        let brdf = brdf::specimen(name).map_err(|source| Error::Material {
            file: "figure 2".to_owned(),
            source,
        })?;
        let material = Material::new(name, brdf);
        figures.push((format!("figure2-{name}"), slice(evaluation, &material)?));
    }
    figures.push(("figure3-density".to_owned(), density()));
    figures.push(("figure3-samples".to_owned(), samples(evaluation)));
    figures.push(("figure7".to_owned(), errors(evaluation, rows)));
    Ok(figures)
}

/// ln(1 + f), mean of the channels, over the index of d_p, at φ_p = 0.
fn slice(evaluation: &Evaluation, material: &Material) -> Result<Figure, Error> {
    let theta_r = SLICE_DEG.to_radians();
    let deviations = evaluation.nodes.deviations();
    let values = |brdf: &dyn Brdf| -> Vec<(f64, f64)> {
        let at = |(i, &d_p): (usize, &f64)| {
            let (incident, exitant) = Pdv::in_plane(theta_r, d_p).directions()?;
            Some((
                i as f64,
                (brdf.eval(incident, exitant).element_sum() / 3.0).ln_1p(),
            ))
        };
        deviations.iter().enumerate().filter_map(at).collect()
    };
    let mut curves = vec![Curve::new(
        "reference",
        COLOURS[8],
        Mark::Line,
        values(&material.brdf),
    )];
    for (model, colour) in evaluation
        .reconstruct(material)?
        .iter()
        .zip(COLOURS.iter().copied().cycle())
    {
        let name = format!("from the plane at {:.0}°", model.theta_r().to_degrees());
        curves.push(Curve::new(&name, colour, Mark::Dashed, values(model)));
    }
    let high = curves
        .iter()
        .flat_map(|c| &c.points)
        .fold(0.0, |high, p| f64::max(high, p.1));
    Ok(Figure {
        title: format!("Figure 2: {} at θ_r = {SLICE_DEG}°, φ_p = 0°", material.name),
        x: Axis {
            label: "index of d_p",
            log: false,
            ends: [0.0, deviations.len() as f64],
        },
        y: Axis {
            label: "ln(1 + f), f in 1/sr",
            log: false,
            ends: [0.0, 1.05 * high],
        },
        legend: SeriesLabelPosition::UpperRight,
        curves,
    })
}

/// E of Eq. 1, normalised.
fn density() -> Figure {
    let bins = Density::stored().bins();
    let sum: f64 = bins.iter().sum();
    let points: Vec<(f64, f64)> = bins
        .iter()
        .enumerate()
        .skip(1)
        .map(|(j, e)| (j as f64 * Density::WIDTH, e / sum))
        .filter(|(_, e)| *e > 0.0)
        .collect();
    let low = points.iter().fold(f64::INFINITY, |low, p| low.min(p.1));
    let high = bins[0] / sum;
    Figure {
        title: "Figure 3: mean of the materials over d_p (Eq. 1, normalised)".to_owned(),
        x: Axis {
            label: "d_p",
            log: true,
            ends: [Density::WIDTH, 2.0],
        },
        y: Axis {
            label: "E, share of the sum",
            log: true,
            ends: [low / 1.5, 1.5 * high],
        },
        legend: SeriesLabelPosition::LowerLeft,
        curves: vec![Curve::new("", COLOURS[0], Mark::Line, points)],
    }
}

/// Where each distribution puts the values of d_p.
fn samples(evaluation: &Evaluation) -> Figure {
    let curve = |(name, distribution, colour)| {
        let nodes = super::Nodes {
            distribution,
            ..evaluation.nodes
        };
        let points = nodes
            .deviations()
            .into_iter()
            .enumerate()
            .map(|(i, d_p)| (i as f64, d_p));
        Curve::new(name, colour, Mark::Line, points.collect())
    };
    let distributions = [
        ("paper: Eq. 1 as it stands", Distribution::Paper, COLOURS[1]),
        ("capped: the default", Distribution::Capped, COLOURS[0]),
        ("uniform", Distribution::Uniform, COLOURS[7]),
    ];
    Figure {
        title: "Figure 3: nodes of d_p".to_owned(),
        x: Axis {
            label: "index of the node",
            log: false,
            ends: [0.0, evaluation.nodes.d_p as f64],
        },
        y: Axis {
            label: "d_p",
            log: false,
            ends: [0.0, 2.0],
        },
        legend: SeriesLabelPosition::UpperLeft,
        curves: distributions.map(curve).to_vec(),
    }
}

/// Eq. 4 of every material, a line for each angle; materials in the order of the first angle's error.
fn errors(evaluation: &Evaluation, rows: &[Row]) -> Figure {
    let angles: Vec<f64> = evaluation
        .theta_r
        .iter()
        .map(|theta_r| theta_r.to_degrees())
        .collect();
    let of = |degrees: f64| {
        rows.iter()
            .filter(move |row| (row.theta_r_deg - degrees).abs() < 1e-6)
    };
    let percent = |row: &Row| row.eq4.map_or(f64::NAN, |eq4| 100.0 * eq4);
    let mut order: Vec<usize> = (0..evaluation.materials.len()).collect();
    let shown: Vec<f64> = of(evaluation.shown.to_degrees()).map(percent).collect();
    order.sort_by(|&a, &b| shown[a].total_cmp(&shown[b]));
    let mut curves = Vec::new();
    for (&degrees, colour) in angles.iter().zip(COLOURS.iter().copied().cycle()) {
        let errors: Vec<f64> = of(degrees).map(percent).collect();
        let points = order
            .iter()
            .enumerate()
            .map(|(place, &m)| (place as f64, errors[m]));
        curves.push(Curve::new(
            &format!("{degrees:.0}°"),
            colour,
            Mark::Line,
            points.collect(),
        ));
    }
    let black = rows
        .first()
        .and_then(|row| row.eq4_black)
        .map_or(f64::NAN, |eq4| 100.0 * eq4);
    let ends = (0.0, order.len().max(2) as f64 - 1.0);
    curves.push(Curve::new(
        "black",
        COLOURS[8],
        Mark::Dashed,
        vec![(ends.0, black), (ends.1, black)],
    ));
    let values = || {
        curves
            .iter()
            .flat_map(|c| &c.points)
            .map(|p| p.1)
            .filter(|v| *v > 0.0)
    };
    let (low, high) = (
        values().fold(f64::INFINITY, f64::min),
        values().fold(0.0, f64::max),
    );
    Figure {
        title: "Figure 7: Eq. 4 of each material".to_owned(),
        x: Axis {
            label: "materials, in the order of their error where the spheres are shown",
            log: false,
            ends: [ends.0, ends.1],
        },
        y: Axis {
            label: "Eq. 4 in %; it shrinks with the root of N",
            log: true,
            ends: [low / 1.3, 1.3 * high],
        },
        legend: SeriesLabelPosition::UpperLeft,
        curves,
    }
}
