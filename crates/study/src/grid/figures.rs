use super::front::{Point, front};
use super::outcome::{ADAPTIVE, Outcome};
use super::summary::{FROM_S, Summary, TO_S};
use crate::figure::{Axis, COLOURS, Curve, Figure, Mark, SeriesLabelPosition};
use crate::statistics::Band;

/// Colour of the plans that are made on the way.
const ADAPTIVE_COLOUR: [u8; 3] = [20, 20, 20];

/// The plots of a study, with their names.
pub(crate) fn figures(outcome: &Outcome<'_>, summary: &Summary) -> Vec<(&'static str, Figure)> {
    let male = |point: &Point| point.male;
    let rel = |point: &Point| point.median_rel;
    vec![
        (
            "male-against-time",
            figure(
                outcome,
                "MALE against rig time",
                "MALE, median over the materials",
                male,
            ),
        ),
        (
            "median-rel-against-time",
            figure(
                outcome,
                "Median relative error against rig time",
                "median relative error, median over the materials",
                rel,
            ),
        ),
        ("planes-against-time", by_planes(outcome, summary)),
    ]
}

/// The own front with its band, and every baseline.
fn figure(outcome: &Outcome<'_>, title: &str, label: &'static str, of: impl Fn(&Point) -> Band) -> Figure {
    let own = outcome.own();
    let all: Vec<(f64, f64)> = outcome
        .approaches
        .iter()
        .filter(|approach| approach.own)
        .flat_map(|approach| &approach.points)
        .map(|point| (point.rig_s, of(point).median))
        .collect();
    let mut curves = vec![Curve::new("", [150, 190, 225], Mark::Dots, all)];
    let mut colours = COLOURS.iter().skip(1).copied().cycle();
    for approach in outcome.approaches.iter().filter(|approach| !approach.own) {
        let steps = steps(&front(&approach.points), &of);
        let colour = colours.next().expect("it goes round");
        curves.push(Curve {
            band: if approach.name == "separable at 70°" {
                steps.1
            } else {
                Vec::new()
            },
            ..Curve::new(&approach.name, colour, Mark::Line, steps.0)
        });
    }
    let level = |name: &str, colour, model: &str| {
        let y = of(&outcome.baseline(model)?).median;
        Some(Curve::new(
            name,
            colour,
            Mark::Dashed,
            vec![(FROM_S / 2.0, y), (TO_S, y)],
        ))
    };
    curves.extend(level("black", [0, 0, 0], "black"));
    for (n, colour) in [(5, [190, 190, 190]), (10, [140, 140, 140]), (20, [90, 90, 90])] {
        let name = format!("PCA, {n} readings out of plane");
        curves.extend(level(&name, colour, &format!("pca-{n}")));
    }
    let on_the_way = outcome
        .adaptive
        .iter()
        .map(|point| (point.rig_s, of(point).median));
    curves.push(Curve::new(
        ADAPTIVE,
        ADAPTIVE_COLOUR,
        Mark::Dots,
        on_the_way.collect(),
    ));
    let (line, band) = steps(&own, &of);
    curves.push(Curve {
        band,
        ..Curve::new(
            "goniod: best model and plan (10–90 %)",
            COLOURS[0],
            Mark::Line,
            line,
        )
    });
    let values = || {
        curves
            .iter()
            .flat_map(|c| c.points.iter().map(|p| p.1).chain(c.band.iter().map(|b| b.1)))
    };
    let low = values().filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
    let high = values().fold(0.0, f64::max);
    Figure {
        title: title.to_owned(),
        x: time(),
        y: Axis {
            label,
            log: true,
            // Room for the legend below the curves.
            ends: [low / 8.0, 1.3 * high],
        },
        legend: SeriesLabelPosition::LowerLeft,
        curves,
    }
}

/// The front of the own models for each number of planes, with the floor that more time does not pass.
fn by_planes(outcome: &Outcome<'_>, summary: &Summary) -> Figure {
    // A snake stands for itself.
    let count = |planes: &str| match planes.starts_with("snake") {
        true => 0,
        false => planes.split(' ').count(),
    };
    let own: Vec<&Point> = outcome
        .approaches
        .iter()
        .filter(|approach| approach.own)
        .flat_map(|approach| &approach.points)
        .collect();
    let mut numbers: Vec<usize> = own.iter().map(|point| count(&point.planes_deg)).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let mut curves = Vec::new();
    for (number, colour) in numbers.into_iter().zip(COLOURS.iter().copied().cycle()) {
        let some = own
            .iter()
            .copied()
            .filter(|point| count(&point.planes_deg) == number);
        let (points, band) = steps(&front(some), |point| point.male);
        let name = match number {
            0 => "snakes".to_owned(),
            1 => "1 plane".to_owned(),
            n => format!("{n} planes"),
        };
        curves.push(Curve {
            band,
            ..Curve::new(&name, colour, Mark::Line, points)
        });
        let floor = summary
            .floors
            .iter()
            .filter(|line| count(&line.planes_deg) == number)
            .filter(|line| !matches!(line.approach.as_str(), "separable" | "bivariate"))
            .map(|line| line.male_median)
            .fold(f64::INFINITY, f64::min);
        let line = vec![(FROM_S / 2.0, floor), (TO_S, floor)];
        // Of a snake no floor was asked for.
        if floor.is_finite() {
            curves.push(Curve::new("", colour, Mark::Dashed, line));
        }
    }
    let values = || {
        curves
            .iter()
            .flat_map(|c| c.points.iter().map(|p| p.1).chain(c.band.iter().map(|b| b.2)))
    };
    let low = values().filter(|v| v.is_finite()).fold(f64::INFINITY, f64::min);
    let high = values().filter(|v| v.is_finite()).fold(0.0, f64::max);
    Figure {
        title: "Planes: MALE against rig time; dashed, the floor of a perfect instrument".to_owned(),
        x: time(),
        y: Axis {
            label: "MALE, median over the materials",
            log: true,
            ends: [low / 1.5, 1.3 * high],
        },
        legend: SeriesLabelPosition::UpperRight,
        curves,
    }
}

fn time() -> Axis {
    Axis {
        label: "simulated seconds of the rig",
        log: true,
        ends: [FROM_S / 2.0, TO_S],
    }
}

/// What is had within each time: steps of a front, and of the band over the materials.
#[expect(
    clippy::type_complexity,
    reason = "points of a line and of a band, as a curve has them"
)]
fn steps(front: &[&Point], of: impl Fn(&Point) -> Band) -> (Vec<(f64, f64)>, Vec<(f64, f64, f64)>) {
    let (mut line, mut band) = (Vec::new(), Vec::new());
    for (i, point) in front.iter().enumerate() {
        let until = front.get(i + 1).map_or(TO_S, |next| next.rig_s);
        let value = of(point);
        for seconds in [point.rig_s, until] {
            line.push((seconds, value.median));
            band.push((seconds, value.p10, value.p90));
        }
    }
    (line, band)
}
