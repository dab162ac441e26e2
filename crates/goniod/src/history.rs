use api::JobState;

use crate::{Refusal, RefusalKind, RunView};

/// Most runs, or jobs that are over, in one answer.
pub(crate) const MOST: u32 = 200;
/// As many are told unless somebody says otherwise.
pub(crate) const USUAL: u32 = 50;

/// Which runs somebody wants to see: those for which everything holds that is said, newest first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunQuery {
    /// At most so many.
    pub limit: u32,
    /// Those whose place is before this one.
    pub before: Option<u64>,
    /// Every word of it is the beginning of one of the run's: of its specimen, job file, record or id.
    pub words: Option<String>,
    /// One of its tags, whatever the case of its letters.
    pub tag: Option<String>,
    /// Who measured, exactly.
    pub operator: Option<String>,
    /// What it was measured for, exactly.
    pub project: Option<String>,
    /// The specimen's name or number, exactly.
    pub specimen: Option<String>,
    /// How its job stands.
    pub state: Option<JobState>,
    /// It began then or later: a day, or a time, RFC 3339, UTC.
    pub from: Option<String>,
    /// It began then or earlier, likewise; on the day where that is all that is said.
    pub to: Option<String>,
    /// Those that were put away, instead of those that were not.
    pub archived: bool,
}

impl RunQuery {
    /// The latest runs.
    pub fn latest(limit: u32) -> Self {
        Self {
            limit,
            ..Self::default()
        }
    }

    /// Checks what can be wrong with it.
    ///
    /// # Errors
    /// A limit that is not within 1 … 200; a day or time that is none.
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        limit(self.limit)?;
        for (key, time) in [("from", &self.from), ("to", &self.to)] {
            let Some(time) = time else { continue };
            let whole = match is_day(time) {
                true => format!("{time}T00:00:00Z"),
                false => time.clone(),
            };
            if !whole.ends_with('Z') || humantime::parse_rfc3339(&whole).is_err() {
                let why = format!(
                    "{key} is {time:?}, allowed is a day such as 2026-12-01 or a time such as 2026-12-01T08:30:00Z"
                );
                return Err(Refusal::new(RefusalKind::Invalid, why));
            }
        }
        Ok(())
    }

    /// Words that are looked for, as the index spells them.
    pub(crate) fn needles(&self) -> Vec<String> {
        self.words.as_deref().map(words).unwrap_or_default()
    }

    /// The latest time at which a run began that is wanted, for comparison with an RFC 3339 time in UTC.
    pub(crate) fn until(&self) -> Option<String> {
        // Whatever stands behind a day begins with "T".
        let until = |to: &String| if is_day(to) { format!("{to}U") } else { to.clone() };
        self.to.as_ref().map(until)
    }

    /// Whether everything holds of a run, its place and the limit aside.
    pub(crate) fn matches(&self, run: &RunView) -> bool {
        let is = |wanted: &Option<String>, known: &[&String]| {
            wanted.as_ref().is_none_or(|wanted| known.contains(&wanted))
        };
        let record = &run.record;
        let known = words(&searched(run));
        self.needles()
            .iter()
            .all(|needle| known.iter().any(|word| word.starts_with(needle)))
            && self
                .tag
                .as_ref()
                .is_none_or(|tag| record.tags.iter().any(|known| folded(known) == folded(tag)))
            && is(&self.operator, &[&record.operator])
            && is(&self.project, &[&record.project])
            && is(&self.specimen, &[&run.specimen, &record.specimen_id])
            && self.state.is_none_or(|state| run.state == state)
            && self.from.as_ref().is_none_or(|from| run.started >= *from)
            && self.until().is_none_or(|until| run.started <= until)
            && self.archived == run.archived.is_some()
    }
}

/// Checks how many are wanted in one answer.
///
/// # Errors
/// Not within 1 … 200.
pub(crate) fn limit(limit: u32) -> Result<(), Refusal> {
    match (1..=MOST).contains(&limit) {
        true => Ok(()),
        false => Err(Refusal::new(
            RefusalKind::Invalid,
            format!("limit is {limit}, allowed are 1 … {MOST}; what is beyond follows with before"),
        )),
    }
}

/// Everything of a run in which words are looked for.
pub(crate) fn searched(run: &RunView) -> String {
    let record = &run.record;
    [
        &run.specimen,
        &run.name,
        &run.id,
        &record.specimen_id,
        &record.material,
        &record.tags.join(" "),
        &record.notes,
        &record.operator,
        &record.project,
    ]
    .map(String::as_str)
    .join(" ")
}

/// The words of a text, in small letters.
pub(crate) fn words(text: &str) -> Vec<String> {
    let words = text.split(|letter: char| !letter.is_alphanumeric());
    words.filter(|word| !word.is_empty()).map(folded).collect()
}

/// A word or tag, so that the case of its letters makes no difference.
pub(crate) fn folded(text: &str) -> String {
    text.to_lowercase()
}

fn is_day(time: &str) -> bool {
    time.len() == "2026-12-01".len()
}
