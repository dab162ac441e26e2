use super::front::{Family, Line, Point, adaptive, families, front, points};
use super::{GridRow, Source};

/// What the plans are called that are made on the way.
pub(crate) const ADAPTIVE: &str = "planned on the way";

/// The rows of a study, sorted out.
pub(crate) struct Outcome<'a> {
    pub(crate) rows: &'a [GridRow],
    pub(crate) families: Vec<Family>,
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
            families: families(rows),
            floors,
            adaptive: adaptive(rows),
        }
    }

    /// The front of all own models together.
    pub(crate) fn own(&self) -> Vec<&Point> {
        front(
            self.families
                .iter()
                .filter(|family| family.own)
                .flat_map(|family| &family.points),
        )
    }

    /// A baseline without a rig, by its name.
    pub(crate) fn baseline(&self, model: &str) -> Option<Point> {
        points(self.rows, Source::Baseline)
            .into_iter()
            .find(|point| point.model == model)
    }

    /// Every family's front, the own one first.
    pub(crate) fn lines(&self) -> Vec<Line> {
        let own = self.own();
        let mut lines: Vec<Line> = own.iter().map(|point| point.line("front")).collect();
        for family in &self.families {
            lines.extend(front(&family.points).iter().map(|point| point.line(&family.name)));
        }
        lines.extend(self.adaptive.iter().map(|point| point.line(ADAPTIVE)));
        lines
    }
}
