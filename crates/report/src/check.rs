use serde::{Deserialize, Serialize};

/// What a consistency check says, from the least news to the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The readings do not allow the check.
    Unknown,
    /// As it should be.
    Good,
    /// Worth a look before the result is used.
    Look,
    /// The result must not be used: there is none, or something in it cannot be true.
    Bad,
}

impl Verdict {
    /// The verdict as files and the screen spell it.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Good => "good",
            Self::Look => "look",
            Self::Bad => "bad",
        }
    }

    /// The verdict on a whole run from its checks: the worst of them. A run that is not complete is never good, since
    /// nobody can tell what the rest of it would show.
    pub fn overall(checks: &[Check], complete: bool) -> Self {
        let worst = checks.iter().map(|check| check.verdict).max();
        match worst.unwrap_or(Self::Unknown) {
            Self::Bad => Self::Bad,
            _ if !complete => Self::Unknown,
            worst => worst,
        }
    }
}

/// One consistency check, in words and as numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// What is checked, a short noun phrase.
    pub name: &'static str,
    /// What it says.
    pub verdict: Verdict,
    /// The finding in one or two sentences.
    pub text: String,
    /// The figures behind it.
    pub values: serde_json::Value,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn overall(verdicts: &[Verdict], complete: bool) -> Verdict {
        let check = |&verdict: &Verdict| Check {
            name: "a check",
            verdict,
            text: String::new(),
            values: serde_json::Value::Null,
        };
        Verdict::overall(&verdicts.iter().map(check).collect::<Vec<_>>(), complete)
    }

    #[test]
    fn a_run_is_as_bad_as_its_worst_check_and_good_only_when_complete() {
        use Verdict::{Bad, Good, Look, Unknown};
        assert_eq!(overall(&[Good, Unknown], true), Good);
        assert_eq!(overall(&[Good, Look, Unknown], true), Look);
        assert_eq!(overall(&[Bad, Good, Look], true), Bad);
        assert_eq!(overall(&[Good, Look], false), Unknown);
        assert_eq!(overall(&[Good, Bad], false), Bad);
        assert_eq!(overall(&[], true), Unknown);
    }
}
