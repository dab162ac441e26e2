use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::Error;

/// The ledger of a study that is done as a whole.
pub(crate) const WHOLE: &str = "rows.csv";
/// The most parts that a study is cut into.
const MOST: u32 = 100_000;

/// One of so many parts of a study, which cost about the same: K/N, K from 1.
///
/// Which tasks are a shard's own depends on the study and on N alone, not on what has been done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u32,
    of: u32,
}

impl Shard {
    /// Its tasks of all: every N-th, so that dear and cheap ones are dealt out evenly.
    pub(crate) fn part<'a, T>(&self, tasks: &'a [T]) -> impl Iterator<Item = &'a T> {
        tasks
            .iter()
            .skip(self.index as usize - 1)
            .step_by(self.of as usize)
    }

    /// The name of its ledger.
    pub(crate) fn ledger(&self) -> String {
        format!("rows-{}-of-{}.csv", self.index, self.of)
    }
}

impl FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let number = |text: &str| {
            // "+3" is a number for the parser of integers.
            let digits = text.bytes().all(|byte| byte.is_ascii_digit());
            digits.then(|| text.parse::<u32>().ok()).flatten()
        };
        let parts = text.split_once('/');
        let parts = parts.and_then(|(index, of)| Some((number(index)?, number(of)?)));
        match parts {
            Some((index, of)) if (1..=of).contains(&index) && of <= MOST => Ok(Self { index, of }),
            _ => Err(Error::Shard {
                given: text.to_owned(),
                most: MOST,
            }),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

/// The ledgers of a directory in the order of their names: that of the whole study, and of every shard, into however many
/// parts it was cut.
///
/// # Errors
/// The directory cannot be read.
pub(crate) fn ledgers(directory: &Path) -> Result<Vec<PathBuf>, Error> {
    let io = |source| Error::Io {
        what: "read",
        path: directory.to_owned(),
        source,
    };
    let mut ledgers = Vec::new();
    for entry in fs::read_dir(directory).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let name = path
            .file_name()
            .and_then(|name| name.to_str())
            .unwrap_or_default();
        if name == WHOLE || (name.starts_with("rows-") && name.ends_with(".csv")) {
            ledgers.push(path);
        }
    }
    ledgers.sort();
    Ok(ledgers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prop_shards_deal_every_task_out_once_and_as_evenly_as_can_be() {
        for tasks in 0..40_usize {
            let tasks: Vec<usize> = (0..tasks).collect();
            for of in 1..=12 {
                let parts =
                    (1..=of).map(|index| Shard { index, of }.part(&tasks).copied().collect::<Vec<_>>());
                let parts: Vec<Vec<usize>> = parts.collect();
                let (least, most) = (parts.iter().map(Vec::len).min(), parts.iter().map(Vec::len).max());
                assert!(most.unwrap() - least.unwrap() <= 1);
                let mut all: Vec<usize> = parts.into_iter().flatten().collect();
                all.sort_unstable();
                assert_eq!(all, tasks);
            }
        }
    }

    #[test]
    fn only_a_part_of_a_whole_is_a_shard() {
        let shard: Shard = "3/16".parse().unwrap();
        assert_eq!(shard, Shard { index: 3, of: 16 });
        assert_eq!(shard.to_string(), "3/16");
        for wrong in [
            "",
            "3",
            "0/4",
            "5/4",
            "1/0",
            "1/100001",
            "+1/4",
            "1/4/2",
            "a/b",
            "1/99999999999",
        ] {
            let error = wrong.parse::<Shard>().unwrap_err().to_string();
            assert!(
                error.contains(&format!("{wrong:?}")) && error.contains("1 ≤ K ≤ N"),
                "{error}"
            );
        }
    }
}
