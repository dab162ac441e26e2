use std::ops::{Range, RangeInclusive};

use config::Flaws;
use serde::Deserialize;
use toml::Spanned;

use crate::first::first;
use crate::{Arc, Distribution, FORMATS, Job, Leg, Mode, Model, Plane, SweepError};

mod leg;
mod record;
mod scene;
mod until;

use leg::{RawLeg, RawSnake};
use record::{RawRun, RawSpecimen};
use scene::RawScene;
use until::RawSweep;

/// Most planes and legs of one job together: their order is found by trying every one.
pub const MAX_PLANES: usize = 12;
/// Degrees from the normal at which a plane's sensor may stand.
pub const THETA_R_DEG: RangeInclusive<f64> = 0.0..=85.0;
/// Readings of one sweep.
const READINGS: RangeInclusive<i64> = 1..=2000;
/// Deviation that an arc keeps.
const OFFSET: RangeInclusive<f64> = -1.0..=1.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawJob {
    #[serde(default)]
    specimen: RawSpecimen,
    #[serde(default)]
    run: RawRun,
    #[serde(default)]
    on_stage: bool,
    #[serde(default)]
    formats: Vec<Spanned<String>>,
    #[serde(default)]
    plane: Vec<RawPlane>,
    #[serde(default)]
    leg: Vec<RawLeg>,
    snake: Option<RawSnake>,
    arc: Option<RawArc>,
    #[serde(default)]
    reconstruction: RawReconstruction,
    scene: Option<RawScene>,
    sweep: Option<RawSweep>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlane {
    theta_r_deg: Spanned<f64>,
    readings: Spanned<i64>,
    #[serde(default)]
    distribution: Distribution,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawArc {
    readings: Spanned<i64>,
    offset: Option<Spanned<f64>>,
}

impl RawPlane {
    fn check(&self, index: usize, source: &Source<'_>) -> Result<Plane, SweepError> {
        let key = |name: &str| format!("plane[{index}].{name}");
        let theta_r_deg = source.within(&self.theta_r_deg, key("theta_r_deg"), &THETA_R_DEG)?;
        Ok(Plane {
            theta_r: theta_r_deg.to_radians(),
            readings: source.readings(&self.readings, key("readings"))?,
            distribution: self.distribution,
        })
    }
}

impl RawArc {
    fn check(&self, source: &Source<'_>) -> Result<Arc, SweepError> {
        let offset = self.offset.as_ref();
        let offset = offset
            .map(|offset| source.within(offset, "arc.offset", &OFFSET))
            .transpose()?;
        Ok(Arc {
            readings: source.readings(&self.readings, "arc.readings")?,
            offset: offset.unwrap_or(0.0),
        })
    }
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct RawReconstruction {
    #[serde(default)]
    model: Model,
}

/// The text of a file and its name, for saying where something is.
struct Source<'a> {
    text: &'a str,
    name: &'a str,
}

impl Source<'_> {
    fn line(&self, span: &Range<usize>) -> usize {
        self.text.as_bytes()[..span.start.min(self.text.len())]
            .iter()
            .filter(|&&byte| byte == b'\n')
            .count()
            + 1
    }

    fn refuse(
        &self,
        span: Option<Range<usize>>,
        key: impl Into<String>,
        why: impl Into<String>,
    ) -> SweepError {
        SweepError::File {
            file: self.name.to_owned(),
            line: span.map(|span| self.line(&span)),
            key: key.into(),
            why: why.into(),
        }
    }

    /// What is no job file at all: syntax, unknown keys, missing keys, wrong types.
    fn form(&self, flaws: &Flaws) -> SweepError {
        let key = flaws.first().key.clone();
        self.refuse(
            flaws.first().span.clone(),
            key.unwrap_or_else(|| "job file".to_owned()),
            flaws.why(self.text),
        )
    }

    fn within<T: PartialOrd + Copy + std::fmt::Display>(
        &self,
        value: &Spanned<T>,
        key: impl Into<String>,
        allowed: &RangeInclusive<T>,
    ) -> Result<T, SweepError> {
        // NaN is in no range.
        if allowed.contains(value.get_ref()) {
            return Ok(*value.get_ref());
        }
        let why = format!(
            "{} is not within {} … {}",
            value.get_ref(),
            allowed.start(),
            allowed.end()
        );
        Err(self.refuse(Some(value.span()), key, why))
    }

    /// Names of formats, each of which is known and given once.
    fn formats(&self, names: &[Spanned<String>]) -> Result<Vec<&'static str>, SweepError> {
        let mut found: Vec<&'static str> = Vec::new();
        for name in names {
            let refuse = |why: String| Err(self.refuse(Some(name.span()), "formats", why));
            match FORMATS.iter().find(|known| *known == name.get_ref()) {
                None => {
                    let why = format!(
                        "there is no format \"{}\"; there are {}",
                        name.get_ref(),
                        FORMATS.join(", ")
                    );
                    return refuse(why);
                }
                Some(known) if found.contains(known) => return refuse(format!("\"{known}\" is given twice")),
                Some(known) => found.push(known),
            }
        }
        Ok(found)
    }

    fn readings(&self, value: &Spanned<i64>, key: impl Into<String>) -> Result<usize, SweepError> {
        let readings = self.within(value, key, &READINGS)?;
        Ok(usize::try_from(readings).expect("within 1 … 2000"))
    }
}

impl Job {
    /// Reads the text of a job file; `name` is what messages call it.
    ///
    /// Planes need θ_r of 0 … 85°, every sweep 1 … 2000 readings, an arc an offset of −1 … 1, a scene ranges within
    /// 0 … 90°. A job with a target or a budget that names no plane gets its first planes, and its arc if it names none
    /// either, from its scene.
    ///
    /// # Errors
    /// Names file, line, key and what is allowed: unknown or missing keys, wrong types, values out of range, more than
    /// 12 planes and legs, legs with another model than "planes" or with a target, or none without a target or a budget.
    pub fn parse(text: &str, name: &str) -> Result<Self, SweepError> {
        let source = Source { text, name };
        let raw: RawJob = config::parse(text).map_err(|flaws| source.form(&flaws))?;
        let until = raw
            .sweep
            .as_ref()
            .map(|sweep| sweep.check(&source, raw.reconstruction.model))
            .transpose()?
            .flatten();
        let legs = raw.leg.iter().enumerate().map(|(i, leg)| leg.check(i, &source));
        let mut legs: Vec<Leg> = legs.collect::<Result<_, _>>()?;
        if let Some(snake) = &raw.snake {
            legs.extend(snake.check(&source)?);
        }
        let curves = raw.plane.len() + legs.len();
        if curves > MAX_PLANES || (curves == 0 && until.is_none()) {
            let why = format!(
                "{} planes and {} legs, allowed are 1 … {MAX_PLANES} together, or none where sweep.target_male or \
                 sweep.budget_s is given",
                raw.plane.len(),
                legs.len()
            );
            return Err(source.refuse(None, "[[plane]]", why));
        }
        if !legs.is_empty() && until.is_some() {
            let why =
                "what is added on the way are planes; a job with legs has neither target_male nor budget_s";
            return Err(source.refuse(None, "sweep", why));
        }
        if !legs.is_empty() && raw.reconstruction.model != Model::Planes {
            let why = format!(
                "readings of legs make the model \"planes\" alone, this job's is \"{}\"",
                raw.reconstruction.model.name()
            );
            return Err(source.refuse(None, "reconstruction.model", why));
        }
        let scene = raw.scene.map(|scene| scene.check(&source)).transpose()?;
        let planes = raw.plane.iter().enumerate();
        let mut planes: Vec<Plane> = planes
            .map(|(i, plane)| plane.check(i, &source))
            .collect::<Result<_, _>>()?;
        let mut arc = raw.arc.map(|arc| arc.check(&source)).transpose()?;
        if planes.is_empty() && legs.is_empty() {
            let (first, along) = first(scene.as_ref());
            planes = first;
            arc = arc.or(Some(along));
        }
        let (operator, project) = raw.run.check(&source)?;
        Ok(Self {
            name: name.to_owned(),
            specimen: raw.specimen.check(&source)?,
            operator,
            project,
            on_stage: raw.on_stage,
            planes,
            legs,
            arc,
            mode: raw.sweep.as_ref().map_or(Mode::Step, |sweep| sweep.mode),
            passes: raw.sweep.as_ref().map_or(Ok(1), |sweep| sweep.passes(&source))?,
            model: raw.reconstruction.model,
            scene,
            formats: source.formats(&raw.formats)?,
            until,
        })
    }
}
