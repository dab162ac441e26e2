use std::collections::BTreeMap;

use serde::Serialize;

use super::{GridRow, Source};
use crate::statistics::{Band, median};

/// A model on a plan, over all materials.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    /// θ_r of the planes, degrees.
    pub(crate) planes_deg: String,
    /// Readings asked for of each plane.
    pub(crate) readings: usize,
    /// Readings asked for of the arc.
    pub(crate) arc: usize,
    /// How the arms moved.
    pub(crate) motion: String,
    /// Rig seconds within which more was added.
    pub(crate) budget_s: Option<u32>,
    pub(crate) model: String,
    /// Median of the seconds that the rig took; NaN where there was none.
    pub(crate) rig_s: f64,
    pub(crate) male: Band,
    /// Over the materials' median relative errors.
    pub(crate) median_rel: Band,
}

/// One line of front.csv.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Line {
    pub(crate) approach: String,
    pub(crate) rig_s: f64,
    pub(crate) planes_deg: String,
    pub(crate) readings: usize,
    pub(crate) arc: usize,
    pub(crate) motion: String,
    pub(crate) male_mean: f64,
    pub(crate) male_median: f64,
    pub(crate) male_p10: f64,
    pub(crate) male_p90: f64,
    pub(crate) median_rel: f64,
}

/// A plan of the front over the materials of one family: one line of families.csv.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct FamilyLine {
    pub(crate) family: String,
    pub(crate) materials: usize,
    #[serde(flatten)]
    pub(crate) line: Line,
}

/// Curves that are compared: the program's own models together, and each baseline.
#[derive(Clone, Debug)]
pub(crate) struct Approach {
    pub(crate) name: String,
    /// Whether it is one of the program's models, not a baseline.
    pub(crate) own: bool,
    pub(crate) points: Vec<Point>,
}

/// Rows of one source over all materials, by plan and model.
pub(crate) fn points(rows: &[GridRow], source: Source) -> Vec<Point> {
    let mut groups: BTreeMap<_, Vec<&GridRow>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.source == source) {
        let key = (
            &row.model,
            &row.planes_deg,
            row.readings,
            row.arc,
            &row.motion,
            row.budget_s,
        );
        groups.entry(key).or_default().push(row);
    }
    groups
        .into_values()
        .map(|rows| {
            let first = rows[0];
            Point {
                planes_deg: first.planes_deg.clone(),
                readings: first.readings,
                arc: first.arc,
                motion: first.motion.clone(),
                budget_s: first.budget_s,
                model: first.model.clone(),
                rig_s: median(rows.iter().filter_map(|row| row.rig_s)),
                male: Band::of(rows.iter().map(|row| row.male)),
                median_rel: Band::of(rows.iter().map(|row| row.median_rel)),
            }
        })
        .collect()
}

/// The points of the rig at which what was added was decided on the way.
pub(crate) fn adaptive(rows: &[GridRow]) -> Vec<Point> {
    let mut points = points(rows, Source::Rig);
    points.retain(|point| point.budget_s.is_some());
    points
}

/// The points of the rig with fixed plans by approach: baselines are the paper's model at each angle, and the bivariate table.
pub(crate) fn approaches(rows: &[GridRow]) -> Vec<Approach> {
    let mut approaches: Vec<Approach> = Vec::new();
    let fixed = |point: &Point| point.budget_s.is_none();
    for point in points(rows, Source::Rig).into_iter().filter(fixed) {
        let (name, own) = match point.model.as_str() {
            "separable" => (format!("separable at {}°", point.planes_deg), false),
            "bivariate" => ("bivariate".to_owned(), false),
            model => (model.to_owned(), true),
        };
        match approaches.iter_mut().find(|approach| approach.name == name) {
            Some(approach) => approach.points.push(point),
            None => approaches.push(Approach {
                name,
                own,
                points: vec![point],
            }),
        }
    }
    approaches.sort_by_key(|approach| (!approach.own, approach.name.clone()));
    approaches
}

/// The points that no other reaches in less time, by the median of MALE: ascending in time, descending in error.
pub(crate) fn front<'a>(points: impl IntoIterator<Item = &'a Point>) -> Vec<&'a Point> {
    let mut points: Vec<&Point> = points.into_iter().collect();
    points.sort_by(|a, b| {
        (a.rig_s, a.male.median)
            .partial_cmp(&(b.rig_s, b.male.median))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    let mut front: Vec<&Point> = Vec::new();
    for point in points {
        if front
            .last()
            .is_none_or(|last| point.male.median < last.male.median)
        {
            front.push(point);
        }
    }
    front
}

/// The best point of a front within some time.
pub(crate) fn within<'a>(front: &[&'a Point], seconds: f64) -> Option<&'a Point> {
    front.iter().rev().find(|point| point.rig_s <= seconds).copied()
}

impl Point {
    pub(crate) fn line(&self, approach: &str) -> Line {
        Line {
            approach: approach.to_owned(),
            rig_s: self.rig_s,
            planes_deg: self.planes_deg.clone(),
            readings: self.readings,
            arc: self.arc,
            motion: self.motion.clone(),
            male_mean: self.male.mean,
            male_median: self.male.median,
            male_p10: self.male.p10,
            male_p90: self.male.p90,
            median_rel: self.median_rel.median,
        }
    }

    /// Whether another point is of the same plan and model.
    pub(crate) fn same_plan(&self, other: &Self) -> bool {
        let of = |point: &Self| (point.readings, point.arc, point.motion.clone(), point.budget_s);
        self.planes_deg == other.planes_deg && self.model == other.model && of(self) == of(other)
    }

    /// Whether a row of the rig is one of its own.
    pub(crate) fn holds(&self, row: &GridRow) -> bool {
        row.source == Source::Rig
            && row.model == self.model
            && row.planes_deg == self.planes_deg
            && (row.readings, row.arc, &row.motion, row.budget_s)
                == (self.readings, self.arc, &self.motion, self.budget_s)
    }

    /// What is done, in words.
    pub(crate) fn plan(&self) -> String {
        if self.planes_deg.starts_with("snake") {
            return format!("a {} legs, {}", self.planes_deg, self.motion);
        }
        format!(
            "{}, {} each, arc {}, {}",
            self.planes_deg.replace(' ', "° ") + "°",
            self.readings,
            self.arc,
            self.motion
        )
    }
}
