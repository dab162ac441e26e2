use serde::Deserialize;
use toml::Spanned;

use super::Source;
use crate::{Mode, Model, SweepError, Until};

/// Errors that may be asked for, and rig seconds.
const TARGET_MALE: std::ops::RangeInclusive<f64> = 1e-5..=1.0;
const BUDGET_S: std::ops::RangeInclusive<f64> = 1.0..=86_400.0;
const PASSES: std::ops::RangeInclusive<i64> = 1..=2;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSweep {
    #[serde(default)]
    pub(super) mode: Mode,
    passes: Option<Spanned<i64>>,
    target_male: Option<Spanned<f64>>,
    budget_s: Option<Spanned<f64>>,
}

impl RawSweep {
    /// How often each sweep is passed: once unless said, for what the way back adds is little.
    pub(super) fn passes(&self, source: &Source<'_>) -> Result<usize, SweepError> {
        let fly = self.mode == Mode::Fly;
        let Some(passes) = &self.passes else {
            return Ok(1);
        };
        if !fly {
            let why = "arms that stop for each reading pass a sweep once; it is for mode = \"fly\"";
            return Err(source.refuse(Some(passes.span()), "sweep.passes", why));
        }
        let passes = source.within(passes, "sweep.passes", &PASSES)?;
        Ok(usize::try_from(passes).expect("within 1 … 2"))
    }

    /// `None` where neither is given.
    pub(super) fn check(&self, source: &Source<'_>, model: Model) -> Result<Option<Until>, SweepError> {
        let given = self.target_male.as_ref().or(self.budget_s.as_ref());
        let Some(given) = given else { return Ok(None) };
        if !matches!(model, Model::Planes | Model::Auto) {
            let why = format!(
                "what to measure next is decided for the model \"planes\" or \"auto\"; this job's is \"{}\"",
                model.name()
            );
            return Err(source.refuse(Some(given.span()), "sweep", why));
        }
        let within = |value: &Option<Spanned<f64>>, key: &str, range| {
            let value = value.as_ref();
            value.map(|value| source.within(value, key, range)).transpose()
        };
        Ok(Some(Until {
            target_male: within(&self.target_male, "sweep.target_male", &TARGET_MALE)?,
            budget_s: within(&self.budget_s, "sweep.budget_s", &BUDGET_S)?,
        }))
    }
}
