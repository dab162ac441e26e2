use std::ops::RangeInclusive;

use serde::Deserialize;
use toml::Spanned;

use super::Source;
use crate::{Leg, SweepError};

/// Half and difference angles of a leg's ends, degrees.
const HALF_DEG: RangeInclusive<f64> = -85.0..=85.0;
const DIFFERENCE_DEG: RangeInclusive<f64> = 0.0..=85.0;
/// Where either arm may be asked to stand, degrees.
const ARM_DEG: RangeInclusive<f64> = -85.0..=85.0;
/// The least that the half angle of a leg must change by, degrees: what does not is no curve over it.
const LEAST_DEG: f64 = 5.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLeg {
    half_deg: [Spanned<f64>; 2],
    difference_deg: [Spanned<f64>; 2],
    readings: Option<Spanned<i64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSnake {
    legs: Spanned<i64>,
}

impl RawLeg {
    pub(super) fn check(&self, index: usize, source: &Source<'_>) -> Result<Leg, SweepError> {
        let key = |name: &str| format!("leg[{index}].{name}");
        let mut half = [0.0; 2];
        let mut difference = [0.0; 2];
        for end in 0..2 {
            half[end] = source.within(&self.half_deg[end], key("half_deg"), &HALF_DEG)?;
            difference[end] =
                source.within(&self.difference_deg[end], key("difference_deg"), &DIFFERENCE_DEG)?;
            for (arm, at) in [
                ("light", half[end] - difference[end]),
                ("sensor", half[end] + difference[end]),
            ] {
                let allowed = if arm == "sensor" {
                    0.0..=*ARM_DEG.end()
                } else {
                    ARM_DEG
                };
                if !allowed.contains(&at) {
                    let why = format!(
                        "with a half angle of {} and a difference angle of {} the {arm} would stand at {at}, allowed are {} … {}",
                        half[end],
                        difference[end],
                        allowed.start(),
                        allowed.end()
                    );
                    return Err(source.refuse(Some(self.half_deg[end].span()), key("half_deg"), why));
                }
            }
        }
        if (half[1] - half[0]).abs() < LEAST_DEG {
            let why = format!(
                "from {} to {} is less than {LEAST_DEG}°: a leg runs over the half angle, for the mirror arc there is [arc]",
                half[0], half[1]
            );
            return Err(source.refuse(Some(self.half_deg[0].span()), key("half_deg"), why));
        }
        let readings = self.readings.as_ref();
        Ok(Leg {
            half: half.map(f64::to_radians),
            difference: difference.map(f64::to_radians),
            readings: readings
                .map(|readings| source.readings(readings, key("readings")))
                .transpose()?,
        })
    }
}

impl RawSnake {
    pub(super) fn check(&self, source: &Source<'_>) -> Result<Vec<Leg>, SweepError> {
        let known = usize::try_from(*self.legs.get_ref()).ok().and_then(Leg::snake);
        known.ok_or_else(|| {
            let why = format!(
                "{} is not one of {}",
                self.legs.get_ref(),
                Leg::SNAKES.map(|n| n.to_string()).join(", ")
            );
            source.refuse(Some(self.legs.span()), "snake.legs", why)
        })
    }
}
