use pdv::{Cell, Scene};
use serde::Deserialize;
use toml::Spanned;

use super::Source;
use crate::SweepError;

/// Where a histogram of directions stands in a job file.
const KEY: &str = "scene.directions";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawScene {
    theta_i_deg: Option<Spanned<[f64; 2]>>,
    theta_o_deg: Option<Spanned<[f64; 2]>>,
    directions: Option<Spanned<Directions>>,
    share: Option<Spanned<f64>>,
    channels: Option<Spanned<Vec<RawChannel>>>,
}

/// The name of a file with a histogram, or what is in it: θ_i from … to, θ_o from … to, deg, and the weight.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "allowed are the name of a file, or a list of [θ_i from, to, θ_o from, to, weight]"
)]
enum Directions {
    File(String),
    Cells(Vec<[f64; 5]>),
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum RawChannel {
    R,
    G,
    B,
}

impl RawScene {
    pub(super) fn check(&self, source: &Source<'_>) -> Result<Scene, SweepError> {
        let whole = Cell::WHOLE;
        let (i, o) = (self.theta_i_deg.as_ref(), self.theta_o_deg.as_ref());
        let ranges = Cell {
            theta_i: range(source, i, "scene.theta_i_deg", whole.theta_i)?,
            theta_o: range(source, o, "scene.theta_o_deg", whole.theta_o)?,
            ..whole
        };
        let share = self.share(source)?;
        let cells = match &self.directions {
            Some(given) if i.or(o).is_some() => {
                let why = "given beside theta_i_deg or theta_o_deg, allowed is one of both";
                return Err(source.refuse(Some(given.span()), KEY, why));
            }
            Some(given) => keep(cells(source, given)?, share),
            None => vec![ranges],
        };
        Ok(Scene {
            cells,
            channels: self.channels(source)?,
        })
    }

    fn share(&self, source: &Source<'_>) -> Result<f64, SweepError> {
        let Some(share) = &self.share else { return Ok(1.0) };
        if self.directions.is_none() {
            let why = "without scene.directions, of which it says how much to keep";
            return Err(source.refuse(Some(share.span()), "scene.share", why));
        }
        source.within(share, "scene.share", &(0.01..=1.0))
    }

    fn channels(&self, source: &Source<'_>) -> Result<[bool; 3], SweepError> {
        let Some(named) = &self.channels else {
            return Ok([true; 3]);
        };
        if named.get_ref().is_empty() {
            let why = "empty, allowed are \"r\", \"g\", \"b\", at least one";
            return Err(source.refuse(Some(named.span()), "scene.channels", why));
        }
        let mut channels = [false; 3];
        for &channel in named.get_ref() {
            channels[channel as usize] = true;
        }
        Ok(channels)
    }
}

/// The cells of a histogram.
fn cells(source: &Source<'_>, given: &Spanned<Directions>) -> Result<Vec<Cell>, SweepError> {
    let refuse = |why: String| source.refuse(Some(given.span()), KEY, why);
    let given = match given.get_ref() {
        Directions::File(name) => {
            let why = format!(
                "\"{name}\" was not read: where a job does not come from a file, write the cells themselves"
            );
            return Err(refuse(why));
        }
        Directions::Cells(given) if given.is_empty() => {
            return Err(refuse("empty, allowed is at least one".to_owned()));
        }
        Directions::Cells(given) => given,
    };
    let checked = given.iter().map(|&[i0, i1, o0, o1, weight]| {
        // NaN is in no order.
        let sound = |low: f64, high: f64| 0.0 <= low && low < high && high <= 90.0;
        if !(sound(i0, i1) && sound(o0, o1) && weight > 0.0 && weight.is_finite()) {
            let why = "allowed are θ_i from, to, θ_o from, to, in degrees within 0 … 90, the smaller first, and a weight above 0";
            return Err(refuse(format!("[{i0}, {i1}, {o0}, {o1}, {weight}]: {why}")));
        }
        Ok(Cell {
            theta_i: [i0.to_radians(), i1.to_radians()],
            theta_o: [o0.to_radians(), o1.to_radians()],
            weight,
        })
    });
    checked.collect()
}

/// The heaviest cells that together have a share of the weight of all.
fn keep(mut cells: Vec<Cell>, share: f64) -> Vec<Cell> {
    // Which rounding must not make less than all.
    if share >= 1.0 {
        return cells;
    }
    cells.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let mut left = share * cells.iter().map(|cell| cell.weight).sum::<f64>();
    let kept = cells.iter().take_while(|cell| {
        let needed = left > 0.0;
        left -= cell.weight;
        needed
    });
    let kept = kept.count();
    cells.truncate(kept.max(1));
    cells
}

/// A range of zenith angles in rad; `all` where it is not given.
fn range(
    source: &Source<'_>,
    given: Option<&Spanned<[f64; 2]>>,
    key: &str,
    all: [f64; 2],
) -> Result<[f64; 2], SweepError> {
    let Some(given) = given else { return Ok(all) };
    let [low, high] = *given.get_ref();
    // NaN is in no order.
    if 0.0 <= low && low < high && high <= 90.0 {
        return Ok([low.to_radians(), high.to_radians()]);
    }
    let why = format!("[{low}, {high}] is no range within 0 … 90, the smaller first");
    Err(source.refuse(Some(given.span()), key, why))
}
