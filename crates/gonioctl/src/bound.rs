use std::str::FromStr;

use serde::Serialize;
use serde_json::Value;

use crate::eval::METRICS;

/// The most that an error metric may be, as `--fail-above` takes it: `male=0.001`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bound {
    /// Which metric, of all channels together.
    pub(crate) metric: &'static str,
    /// The most that it may be.
    pub(crate) at_most: f64,
}

impl FromStr for Bound {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((name, number)) = text.split_once('=') else {
            return Err("it has no \"=\"; write METRIC=NUMBER, such as male=0.001".to_owned());
        };
        let known = METRICS.into_iter().find(|metric| *metric == name.trim());
        let metric = known.ok_or_else(|| {
            format!(
                "there is no metric \"{}\"; there are {}",
                name.trim(),
                METRICS.join(", ")
            )
        })?;
        let number = number.trim();
        match number.parse::<f64>() {
            Ok(at_most) if at_most.is_finite() && at_most >= 0.0 => Ok(Self { metric, at_most }),
            _ => Err(format!(
                "the bound of {metric} is \"{number}\"; allowed is a finite number from 0"
            )),
        }
    }
}

/// A metric beside its bound.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Bounded {
    /// Which metric.
    pub(crate) metric: &'static str,
    /// The most that it may be.
    pub(crate) at_most: f64,
    /// What it is; none where it has no value.
    pub(crate) value: Option<f64>,
    /// Whether it is above its bound. One without a value is.
    pub(crate) above: bool,
}

impl Bounded {
    /// A bound beside what a comparison, as its JSON has it, says of its metric.
    pub(crate) fn new(bound: Bound, comparison: &Value) -> Self {
        let Bound { metric, at_most } = bound;
        // JSON has no NaN and no infinity: they are null there.
        let value = comparison[metric].as_f64().filter(|value| value.is_finite());
        Self {
            metric,
            at_most,
            value,
            above: !value.is_some_and(|value| value <= at_most),
        }
    }
}

impl std::fmt::Display for Bounded {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { metric, at_most, .. } = self;
        match self.value {
            None => write!(
                f,
                "{metric} has no value, which counts as above its bound of {at_most}"
            ),
            Some(value) if self.above => {
                write!(
                    f,
                    "{metric} is {value}, above its bound of {at_most} by {:.3e}",
                    value - at_most
                )
            }
            Some(value) => write!(f, "{metric} is {value}, within its bound of {at_most}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::json;

    use super::*;

    proptest! {
        #[test]
        fn prop_a_metric_is_above_its_bound_unless_it_is_a_number_that_is_not(value in any::<f64>(), at_most in 0.0..1e300f64) {
            let bounded = Bounded::new(Bound { metric: "male", at_most }, &json!({ "male": value }));
            prop_assert_eq!(bounded.above, value.is_nan() || value.is_infinite() || value > at_most);
            prop_assert!(bounded.to_string().contains("male"));
        }

        #[test]
        fn prop_a_bound_is_read_as_it_is_written(index in 0..METRICS.len(), at_most in 0.0..1e300f64) {
            let bound = Bound { metric: METRICS[index], at_most };
            prop_assert_eq!(format!("{} = {at_most}", METRICS[index]).parse(), Ok(bound));
        }

        #[test]
        fn prop_no_text_panics(text in any::<String>()) {
            let _ = text.parse::<Bound>();
        }
    }

    #[test]
    fn a_metric_without_a_value_is_above_any_bound() {
        let bound = Bound {
            metric: "eq4",
            at_most: f64::MAX,
        };
        for comparison in [json!({ "eq4": null }), json!({})] {
            assert!(Bounded::new(bound, &comparison).above, "{comparison}");
        }
    }

    #[test]
    fn what_is_no_bound_is_told_with_what_is() {
        for (text, said) in [
            ("mole=1", "male, median_rel, p95_rel"),
            ("male", "METRIC=NUMBER"),
            ("male=NaN", "finite"),
            ("male=-1", "finite number from 0"),
            ("male=inf", "finite"),
            ("male=", "finite"),
        ] {
            let why = text.parse::<Bound>().unwrap_err();
            assert!(why.contains(said), "{text}: {why}");
        }
    }
}
