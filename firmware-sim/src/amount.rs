use serde::{Deserialize, Serialize};

/// A number from 0 to `MAX`, as a key of the `[sim]` table may have it; NaN is in no range.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct UpTo<const MAX: u32>(pub(crate) f64);

impl<const MAX: u32> TryFrom<f64> for UpTo<MAX> {
    type Error = String;

    fn try_from(value: f64) -> Result<Self, String> {
        match (0.0..=f64::from(MAX)).contains(&value) {
            true => Ok(Self(value)),
            false => Err(format!("{value} is not allowed here, only 0 … {MAX}")),
        }
    }
}

impl<const MAX: u32> From<UpTo<MAX>> for f64 {
    fn from(amount: UpTo<MAX>) -> Self {
        amount.0
    }
}
