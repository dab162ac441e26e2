use std::path::Path;

use serde::Serialize;

use super::front::{Family, Line, Point, adaptive, families, front, points, within};
use super::{Grid, GridRow, Source};
use crate::figure::{Axis, COLOURS, Curve, Figure, Mark, SeriesLabelPosition};
use crate::page::Page;
use crate::{Error, ledger, write};

/// Seconds of rig time over which the fronts are compared.
const FROM_S: f64 = 10.0;
const TO_S: f64 = 600.0;

/// What the plans are called that are made on the way, and their colour.
const ADAPTIVE: &str = "planned on the way";
const ADAPTIVE_COLOUR: [u8; 3] = [20, 20, 20];

/// A baseline against the program's own front.
#[derive(Clone, Debug, Serialize)]
struct Against {
    baseline: String,
    /// Least of baseline over own front, in the median of MALE, over all times from 10 s to 10 min; below 1 the
    /// baseline wins somewhere.
    least_ratio: f64,
    /// Where that is, s of rig time.
    at_s: f64,
}

/// PCA, which no rig in one plane can run, against the program's own front.
#[derive(Clone, Debug, Serialize)]
struct Pca {
    readings: usize,
    male_mean: f64,
    male_median: f64,
    median_rel: f64,
    /// Seconds of rig time from which the own front lies below it; `None`: nowhere.
    beaten_from_s: Option<f64>,
}

/// summary.json.
#[derive(Clone, Debug, Serialize)]
struct Summary {
    materials: usize,
    captures: usize,
    baselines: Vec<Against>,
    pca: Vec<Pca>,
    front: Vec<Line>,
    floors: Vec<Line>,
}

/// Writes everything that follows from the rows of a grid, and says what it found.
pub(crate) fn write(grid: &Grid, rows: &[GridRow], directory: &Path) -> Result<String, Error> {
    let study = Study::new(rows);
    let summary = study.summary(grid, rows);
    let csv = |name: &str, lines: &[Line]| -> Result<(), Error> {
        let text = ledger::text(lines, true).map_err(Error::Write)?;
        write::file(directory, name, &text)
    };
    let text = ledger::text(rows, true).map_err(Error::Write)?;
    write::file(directory, "study.csv", &text)?;
    csv("front.csv", &study.lines())?;
    csv("floor.csv", &summary.floors)?;
    let json = serde_json::to_vec_pretty(&summary).map_err(|error| Error::Write(error.into()))?;
    write::file(directory, "summary.json", &json)?;
    let mut page = Page::new("Error against run time");
    let words = study.words(&summary);
    page.text(&words);
    for (name, figure) in study.figures(&summary) {
        let svg = figure.svg()?;
        write::file(directory, &format!("{name}.svg"), svg.as_bytes())?;
        write::file(directory, &format!("{name}.png"), &figure.png()?)?;
        page.figure(&svg, &figure.title);
    }
    page.heading("The front: what no other plan reaches in less time");
    page.table(&table(&summary.front));
    page.heading("Floors: the same models from 360 + 360 readings of a perfect instrument");
    page.table(&table(&summary.floors));
    page.heading("Log-relative PCA, readings anywhere on the hemisphere, without noise");
    page.table(&pca_table(&summary.pca));
    write::file(directory, "index.html", page.html().as_bytes())?;
    Ok(words)
}

/// Rows, sorted out.
struct Study<'a> {
    rows: &'a [GridRow],
    families: Vec<Family>,
    floors: Vec<Point>,
    adaptive: Vec<Point>,
}

impl<'a> Study<'a> {
    fn new(rows: &'a [GridRow]) -> Self {
        let mut floors = points(rows, Source::Floor);
        floors.sort_by(|a, b| b.male.median.total_cmp(&a.male.median));
        Self {
            rows,
            families: families(rows),
            floors,
            adaptive: adaptive(rows),
        }
    }

    /// The front of all own models together.
    fn own(&self) -> Vec<&Point> {
        front(
            self.families
                .iter()
                .filter(|family| family.own)
                .flat_map(|family| &family.points),
        )
    }

    fn baseline(&self, model: &str) -> Option<Point> {
        points(self.rows, Source::Baseline)
            .into_iter()
            .find(|point| point.model == model)
    }

    /// Every family's front, the own one first.
    fn lines(&self) -> Vec<Line> {
        let own = self.own();
        let mut lines: Vec<Line> = own.iter().map(|point| point.line("front")).collect();
        for family in &self.families {
            lines.extend(front(&family.points).iter().map(|point| point.line(&family.name)));
        }
        lines.extend(self.adaptive.iter().map(|point| point.line(ADAPTIVE)));
        lines
    }

    fn summary(&self, grid: &Grid, rows: &[GridRow]) -> Summary {
        let own = self.own();
        let mut baselines: Vec<Against> = self
            .families
            .iter()
            .filter(|family| !family.own)
            .filter_map(|family| against(&family.name, &front(&family.points), &own))
            .collect();
        if let Some(mut black) = self.baseline("black") {
            black.rig_s = 0.0;
            baselines.extend(against("black", &[&black], &own));
        }
        let pca = grid.pca.iter().filter_map(|&n| {
            let point = self.baseline(&format!("pca-{n}"))?;
            Some(Pca {
                readings: n,
                male_mean: point.male.mean,
                male_median: point.male.median,
                median_rel: point.median_rel.median,
                beaten_from_s: own
                    .iter()
                    .find(|own| own.male.median < point.male.median)
                    .map(|own| own.rig_s),
            })
        });
        Summary {
            materials: grid.materials.len(),
            captures: grid.materials.len() * grid.plans.len(),
            baselines,
            pca: pca.collect(),
            front: own.iter().map(|point| point.line(&point.model)).collect(),
            floors: self.floors.iter().map(|point| point.line(&point.model)).collect(),
        }
        .with_rows(rows)
    }

    fn words(&self, summary: &Summary) -> String {
        let mut text = format!(
            "{} materials, {} captures on the simulated rig with all its imperfections. Errors are medians over the materials.\n",
            summary.materials, summary.captures
        );
        let own = self.own();
        for seconds in [10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0] {
            if let Some(point) = within(&own, seconds) {
                text += &format!(
                    "{seconds:4.0} s: MALE {:.5} (10–90 %: {:.5} … {:.5}), median relative error {:.2} %: {} of {}\n",
                    point.male.median,
                    point.male.p10,
                    point.male.p90,
                    100.0 * point.median_rel.median,
                    point.model,
                    point.plan()
                );
            }
        }
        for point in &self.adaptive {
            let Some(fixed) = within(&own, point.rig_s) else {
                continue;
            };
            text += &format!(
                "{ADAPTIVE}, {:.0} s of {} s: MALE {:.5}, {:.2} times that of the best fixed plan of no more time\n",
                point.rig_s,
                point.budget_s.unwrap_or_default(),
                point.male.median,
                point.male.median / fixed.male.median
            );
        }
        for against in &summary.baselines {
            let word = match against.least_ratio > 1.0 {
                true => "is above the front everywhere from 10 s to 10 min",
                false => "IS NOT ABOVE the front everywhere from 10 s to 10 min",
            };
            text += &format!(
                "{}: {word}; at least {:.2} times its MALE (at {:.0} s)\n",
                against.baseline, against.least_ratio, against.at_s
            );
        }
        for pca in &summary.pca {
            let word = match pca.beaten_from_s {
                Some(seconds) => format!("the front is below it from {seconds:.0} s on"),
                None => "it is below the front at every time".to_owned(),
            };
            text += &format!(
                "log-relative PCA of {} readings out of the plane: MALE {:.5}, median relative error {:.2} %; {word}\n",
                pca.readings,
                pca.male_median,
                100.0 * pca.median_rel
            );
        }
        text
    }

    fn figures(&self, summary: &Summary) -> Vec<(&'static str, Figure)> {
        let male = |point: &Point| point.male;
        let rel = |point: &Point| point.median_rel;
        vec![
            (
                "male-against-time",
                self.figure("MALE against rig time", "MALE, median over the materials", male),
            ),
            (
                "median-rel-against-time",
                self.figure(
                    "Median relative error against rig time",
                    "median relative error, median over the materials",
                    rel,
                ),
            ),
            ("planes-against-time", self.by_planes(summary)),
        ]
    }

    /// The own front with its band, and every baseline.
    fn figure(
        &self,
        title: &str,
        label: &'static str,
        of: impl Fn(&Point) -> crate::statistics::Band,
    ) -> Figure {
        let own = self.own();
        let all: Vec<(f64, f64)> = self
            .families
            .iter()
            .filter(|family| family.own)
            .flat_map(|family| &family.points)
            .map(|point| (point.rig_s, of(point).median))
            .collect();
        let mut curves = vec![Curve::new("", [150, 190, 225], Mark::Dots, all)];
        let mut colours = COLOURS.iter().skip(1).copied().cycle();
        for family in self.families.iter().filter(|family| !family.own) {
            let steps = steps(&front(&family.points), &of);
            let colour = colours.next().expect("it goes round");
            curves.push(Curve {
                band: if family.name == "separable at 70°" {
                    steps.1
                } else {
                    Vec::new()
                },
                ..Curve::new(&family.name, colour, Mark::Line, steps.0)
            });
        }
        let level = |name: &str, colour, model: &str| {
            let y = of(&self.baseline(model)?).median;
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
        let on_the_way = self.adaptive.iter().map(|point| (point.rig_s, of(point).median));
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
    fn by_planes(&self, summary: &Summary) -> Figure {
        let count = |planes: &str| planes.split(' ').count();
        let own: Vec<&Point> = self
            .families
            .iter()
            .filter(|family| family.own)
            .flat_map(|family| &family.points)
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
                .filter(|line| !matches!(line.family.as_str(), "separable" | "bivariate"))
                .map(|line| line.male_median)
                .fold(f64::INFINITY, f64::min);
            let line = vec![(FROM_S / 2.0, floor), (TO_S, floor)];
            curves.push(Curve::new("", colour, Mark::Dashed, line));
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
}

impl Summary {
    fn with_rows(mut self, rows: &[GridRow]) -> Self {
        let mut captures: Vec<_> = rows
            .iter()
            .filter(|row| row.source == Source::Rig)
            .map(|row| {
                (
                    &row.material,
                    &row.planes_deg,
                    row.readings,
                    row.arc,
                    row.budget_s,
                )
            })
            .collect();
        captures.sort();
        captures.dedup();
        self.captures = captures.len();
        self
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
fn steps(
    front: &[&Point],
    of: impl Fn(&Point) -> crate::statistics::Band,
) -> (Vec<(f64, f64)>, Vec<(f64, f64, f64)>) {
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

/// A baseline's front against the own one, at every time at which either changes; `None` where it has none in time.
fn against(name: &str, baseline: &[&Point], own: &[&Point]) -> Option<Against> {
    let times = baseline.iter().chain(own).map(|point| point.rig_s);
    times
        .chain([FROM_S, TO_S])
        .filter(|seconds| (FROM_S..=TO_S).contains(seconds))
        .filter_map(|seconds| {
            let ratio = within(baseline, seconds)?.male.median
                / within(own, seconds).map_or(f64::INFINITY, |point| point.male.median);
            Some(Against {
                baseline: name.to_owned(),
                least_ratio: ratio,
                at_s: seconds,
            })
        })
        .min_by(|a, b| a.least_ratio.total_cmp(&b.least_ratio))
}

fn table(lines: &[Line]) -> Vec<Vec<String>> {
    let heading = [
        "model",
        "planes in °",
        "readings each",
        "arc",
        "rig s",
        "compute s",
        "MALE mean",
        "median",
        "10 %",
        "90 %",
        "median rel. error",
    ];
    let mut rows = vec![heading.map(str::to_owned).to_vec()];
    for line in lines {
        let number = |value: f64, digits: usize| match value.is_finite() {
            true => format!("{value:.digits$}"),
            false => "–".to_owned(),
        };
        rows.push(vec![
            line.family.clone(),
            line.planes_deg.clone(),
            line.readings.to_string(),
            line.arc.to_string(),
            number(line.rig_s, 1),
            number(line.fit_s, 3),
            number(line.male_mean, 5),
            number(line.male_median, 5),
            number(line.male_p10, 5),
            number(line.male_p90, 5),
            format!("{:.2} %", 100.0 * line.median_rel),
        ]);
    }
    rows
}

fn pca_table(pca: &[Pca]) -> Vec<Vec<String>> {
    let heading = [
        "readings",
        "MALE mean",
        "median",
        "median rel. error",
        "front is below from",
    ];
    let mut rows = vec![heading.map(str::to_owned).to_vec()];
    for pca in pca {
        rows.push(vec![
            pca.readings.to_string(),
            format!("{:.5}", pca.male_mean),
            format!("{:.5}", pca.male_median),
            format!("{:.2} %", 100.0 * pca.median_rel),
            pca.beaten_from_s
                .map_or("nowhere".to_owned(), |s| format!("{s:.0} s")),
        ]);
    }
    rows
}
