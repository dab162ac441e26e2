use serde::Serialize;

/// Characters of a line of the record: a name, a number, a material.
const LINE: usize = 200;
/// Characters of notes.
const NOTES: usize = 10_000;
/// Tags of one specimen.
const TAGS: usize = 20;
/// Characters of a tag.
const TAG: usize = 50;

/// What lies on the stage, as a job file describes it; all of it in the technician's words, empty where nothing is said.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Specimen {
    /// Its name.
    pub name: String,
    /// Its number in whatever list it stands.
    pub id: String,
    /// What it is made of.
    pub material: String,
    /// Words under which it is to be found again.
    pub tags: Vec<String>,
    /// Anything else.
    pub notes: String,
}

/// What is wrong in the record of a job or a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordFlaw {
    /// The key whose value is not allowed.
    pub key: &'static str,
    /// Why, and what is allowed.
    pub why: String,
}

impl std::fmt::Display for RecordFlaw {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.key, self.why)
    }
}

impl Specimen {
    /// Returns the specimen with white space around its texts taken off, and each tag once. Its name and its notes are left
    /// as they are.
    ///
    /// # Errors
    /// Number or material is no line of up to 200 characters; there are more than 20 tags, or one is no line of 1 … 50; the
    /// notes have more than 10,000.
    pub fn checked(self) -> Result<Self, RecordFlaw> {
        let flaw = |key, why| Err(RecordFlaw { key, why });
        if self.tags.len() > TAGS {
            return flaw("tags", format!("{} tags, allowed are {TAGS}", self.tags.len()));
        }
        let mut tags: Vec<String> = Vec::new();
        for tag in &self.tags {
            let tag = line_within("tags", tag, 1, TAG)?;
            if !tags.contains(&tag) {
                tags.push(tag);
            }
        }
        let notes = self.notes.chars().count();
        if notes > NOTES {
            return flaw("notes", format!("{notes} characters, allowed are {NOTES}"));
        }
        Ok(Self {
            id: line("id", &self.id)?,
            material: line("material", &self.material)?,
            tags,
            ..self
        })
    }
}

/// Returns a text of one line, up to 200 characters, without the white space around it.
///
/// # Errors
/// It is longer, or holds a control character; `key` says of which value.
pub fn line(key: &'static str, text: &str) -> Result<String, RecordFlaw> {
    line_within(key, text, 0, LINE)
}

fn line_within(key: &'static str, text: &str, least: usize, most: usize) -> Result<String, RecordFlaw> {
    let text = text.trim();
    let length = text.chars().count();
    let why = match text.chars().any(char::is_control) {
        true => "it holds a control character, such as a line break".to_owned(),
        false if (least..=most).contains(&length) => return Ok(text.to_owned()),
        false => format!("{length} characters, allowed are {least} … {most}"),
    };
    Err(RecordFlaw { key, why })
}
