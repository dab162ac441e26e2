use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;

/// What a command found, as CI servers and editors show it: a file of JUnit's XML with one test suite.
///
/// The file is written when the command begins, with an error in it, so that one that was killed, or could not begin, is
/// never taken for one that passed. What is written in the end takes its place.
pub(crate) struct Junit {
    path: PathBuf,
    suite: String,
}

impl Junit {
    /// Writes the file of a command that has not come to its end yet.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn begin(path: &Path, suite: impl Into<String>) -> anyhow::Result<Self> {
        let junit = Self {
            path: path.to_owned(),
            suite: suite.into(),
        };
        junit.error("the command did not come to its end")?;
        Ok(junit)
    }

    /// Writes that the command could not do its work.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn error(&self, why: &str) -> anyhow::Result<()> {
        self.write(&[Case::new(
            format!("gonioctl {}", self.suite),
            Outcome::Error(why.to_owned()),
        )])
    }

    /// Writes what was found.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn write(&self, cases: &[Case]) -> anyhow::Result<()> {
        std::fs::write(&self.path, xml(&self.suite, cases))
            .with_context(|| format!("cannot write {}", self.path.display()))
    }
}

/// One thing that was tried.
pub(crate) struct Case {
    name: String,
    outcome: Outcome,
    /// What is to be known of it, however it came out.
    said: String,
}

/// How one thing came out.
#[derive(Clone, Debug)]
pub(crate) enum Outcome {
    /// As it should.
    Passed,
    /// Not as it should, and what was found.
    Failed(String),
    /// It could not be tried, and why.
    Error(String),
}

impl Case {
    pub(crate) fn new(name: impl Into<String>, outcome: Outcome) -> Self {
        Self {
            name: name.into(),
            outcome,
            said: String::new(),
        }
    }

    /// The same, with something to be known of it.
    pub(crate) fn saying(self, said: impl Into<String>) -> Self {
        Self {
            said: said.into(),
            ..self
        }
    }
}

/// The whole file.
fn xml(suite: &str, cases: &[Case]) -> String {
    let count = |is: fn(&Outcome) -> bool| cases.iter().filter(|case| is(&case.outcome)).count();
    let counts = format!(
        r#"tests="{}" failures="{}" errors="{}" skipped="0""#,
        cases.len(),
        count(|outcome| matches!(outcome, Outcome::Failed(_))),
        count(|outcome| matches!(outcome, Outcome::Error(_)))
    );
    let suite = escaped(suite);
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"gonioctl\" {counts}>\n  <testsuite name=\"{suite}\" {counts}>\n"
    );
    for case in cases {
        text += &element(&suite, case);
    }
    text + "  </testsuite>\n</testsuites>\n"
}

fn element(suite: &str, case: &Case) -> String {
    let mut text = format!(
        "    <testcase classname=\"gonioctl.{suite}\" name=\"{}\">\n",
        escaped(&case.name)
    );
    match &case.outcome {
        Outcome::Passed => {}
        Outcome::Failed(why) => text += &format!("      <failure message=\"{}\"/>\n", escaped(why)),
        Outcome::Error(why) => text += &format!("      <error message=\"{}\"/>\n", escaped(why)),
    }
    if !case.said.is_empty() {
        text += &format!("      <system-out>{}</system-out>\n", escaped(&case.said));
    }
    text + "    </testcase>\n"
}

/// A text as it stands in an attribute or between tags. What XML 1.0 cannot hold (section 2.2) is shown as Rust escapes it;
/// white space is kept as references, since a reader makes blanks of it in attributes (section 3.3.3).
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\t' | '\n' | '\r' => {
                let _ = write!(escaped, "&#{};", u32::from(c));
            }
            '\0'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => escaped.extend(c.escape_default()),
            _ => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use roxmltree::Document;

    use super::*;

    fn outcome() -> impl Strategy<Value = Outcome> {
        prop_oneof![
            Just(Outcome::Passed),
            any::<String>().prop_map(Outcome::Failed),
            any::<String>().prop_map(Outcome::Error),
        ]
    }

    /// A text as a reader of XML can have it: what XML cannot hold is shown by its escape.
    fn readable(text: &str) -> String {
        let held = |c: char| c >= ' ' && c != '\u{fffe}' && c != '\u{ffff}' || "\t\n\r".contains(c);
        text.chars()
            .map(|c| match held(c) {
                true => c.to_string(),
                false => c.escape_default().to_string(),
            })
            .collect()
    }

    proptest! {
        #[test]
        fn prop_a_reader_of_xml_finds_every_case_with_what_was_said_of_it(
            suite in any::<String>(),
            cases in proptest::collection::vec((any::<String>(), outcome(), any::<String>()), 0..5),
        ) {
            let built: Vec<Case> = cases.iter().cloned().map(|(name, outcome, said)| Case { name, outcome, said }).collect();
            let text = xml(&suite, &built);
            let document = Document::parse(&text).unwrap();
            let found: Vec<_> = document.descendants().filter(|node| node.has_tag_name("testcase")).collect();
            prop_assert_eq!(found.len(), cases.len());
            for (node, (name, outcome, said)) in found.iter().zip(&cases) {
                prop_assert_eq!(node.attribute("name").unwrap(), readable(name));
                let message = |tag: &str| {
                    let child = node.children().find(|child| child.has_tag_name(tag));
                    child.map(|child| child.attribute("message").unwrap().to_owned())
                };
                let (failure, error) = match outcome {
                    Outcome::Passed => (None, None),
                    Outcome::Failed(why) => (Some(readable(why)), None),
                    Outcome::Error(why) => (None, Some(readable(why))),
                };
                prop_assert_eq!(message("failure"), failure);
                prop_assert_eq!(message("error"), error);
                let out = node.children().find(|child| child.has_tag_name("system-out"));
                let out = out.map_or("", |out| out.text().unwrap());
                prop_assert_eq!(out, readable(said));
            }
            let suite = document.descendants().find(|node| node.has_tag_name("testsuite")).unwrap();
            let failed = found.iter().filter(|node| node.children().any(|child| child.has_tag_name("failure"))).count();
            prop_assert_eq!(suite.attribute("failures").unwrap(), failed.to_string());
        }
    }

    #[test]
    fn a_command_that_has_not_come_to_its_end_has_not_passed() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("junit.xml");
        let junit = Junit::begin(&path, "doctor").unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("errors=\"1\""), "{text}");
        junit.write(&[Case::new("clock", Outcome::Passed)]).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("tests=\"1\" failures=\"0\" errors=\"0\""), "{text}");
        assert!(Junit::begin(&directory.path().join("none/junit.xml"), "doctor").is_err());
    }
}
