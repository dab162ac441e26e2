use pdv::{Cell, Scene};
use serde::Deserialize;
use toml::Spanned;

use super::Source;
use crate::SweepError;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawScene {
    theta_i_deg: Option<Spanned<[f64; 2]>>,
    theta_o_deg: Option<Spanned<[f64; 2]>>,
    channels: Option<Spanned<Vec<RawChannel>>>,
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
        Ok(Scene {
            cells: vec![Cell {
                theta_i: range(
                    source,
                    self.theta_i_deg.as_ref(),
                    "scene.theta_i_deg",
                    whole.theta_i,
                )?,
                theta_o: range(
                    source,
                    self.theta_o_deg.as_ref(),
                    "scene.theta_o_deg",
                    whole.theta_o,
                )?,
            }],
            channels: self.channels(source)?,
        })
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
