use super::front::{Approach, FamilyLine, Line, Point, adaptive, approaches, front, points};
use super::{GridRow, Source};

/// What the plans are called that are made on the way.
pub(crate) const ADAPTIVE: &str = "planned on the way";

/// The rows of a study, sorted out.
pub(crate) struct Outcome<'a> {
    pub(crate) rows: &'a [GridRow],
    pub(crate) approaches: Vec<Approach>,
    /// Floors of the models, the worst first.
    pub(crate) floors: Vec<Point>,
    /// Plans that were made on the way.
    pub(crate) adaptive: Vec<Point>,
}

impl<'a> Outcome<'a> {
    pub(crate) fn new(rows: &'a [GridRow]) -> Self {
        let mut floors = points(rows, Source::Floor);
        floors.sort_by(|a, b| b.male.median.total_cmp(&a.male.median));
        Self {
            rows,
            approaches: approaches(rows),
            floors,
            adaptive: adaptive(rows),
        }
    }

    /// The front of all own models together.
    pub(crate) fn own(&self) -> Vec<&Point> {
        front(
            self.approaches
                .iter()
                .filter(|approach| approach.own)
                .flat_map(|approach| &approach.points),
        )
    }

    /// The plans of the front over the materials of each family.
    pub(crate) fn by_family(&self) -> Vec<FamilyLine> {
        let mut families: Vec<&str> = self.rows.iter().map(|row| row.family.as_str()).collect();
        families.sort_unstable();
        families.dedup();
        let own = self.own();
        let of_family = |family: &str| -> Vec<FamilyLine> {
            let rows: Vec<GridRow> = self
                .rows
                .iter()
                .filter(|row| row.family == family)
                .cloned()
                .collect();
            let points = points(&rows, Source::Rig);
            let same = |point: &Point| own.iter().any(|front| front.same_plan(point));
            let line = |point: &Point| FamilyLine {
                family: family.to_owned(),
                materials: rows.iter().filter(|row| point.holds(row)).count(),
                line: point.line(&point.model),
            };
            points.iter().filter(|point| same(point)).map(line).collect()
        };
        families.into_iter().flat_map(of_family).collect()
    }

    /// A baseline without a rig, by its name.
    pub(crate) fn baseline(&self, model: &str) -> Option<Point> {
        points(self.rows, Source::Baseline)
            .into_iter()
            .find(|point| point.model == model)
    }

    /// Every approach's front, the own one first.
    pub(crate) fn lines(&self) -> Vec<Line> {
        let own = self.own();
        let mut lines: Vec<Line> = own.iter().map(|point| point.line("front")).collect();
        for approach in &self.approaches {
            lines.extend(
                front(&approach.points)
                    .iter()
                    .map(|point| point.line(&approach.name)),
            );
        }
        lines.extend(self.adaptive.iter().map(|point| point.line(ADAPTIVE)));
        lines
    }
}
