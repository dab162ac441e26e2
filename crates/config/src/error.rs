use std::ops::Range;

/// Why bytes are no text that is taken: every text file is UTF-8.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TextError {
    /// It seems to be in UTF-16, as Windows' Notepad and PowerShell write it.
    #[error("it seems to be in UTF-16, taken is UTF-8: save it as UTF-8, or `iconv -f UTF-16 -t UTF-8`")]
    Utf16,
    /// It has zero bytes, and is no UTF-16 either.
    #[error("line {line} has a zero byte: this is no text file")]
    Binary {
        /// Line of the first zero byte, from 1.
        line: usize,
    },
    /// A byte that is no UTF-8, as Latin-1 and Windows-1252 have them.
    #[error(
        "line {line}: byte {byte:#04x} is no UTF-8; the file seems to be in Latin-1: save it as UTF-8, or `iconv -f \
         LATIN1 -t UTF-8`"
    )]
    Latin1 {
        /// Line of the byte, from 1.
        line: usize,
        /// The byte.
        byte: u8,
    },
}

/// One thing that is wrong in a TOML text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flaw {
    /// The bytes of the text that are to blame, where they are known.
    pub span: Option<Range<usize>>,
    /// The key with its tables, such as `plane[0].readings`, where one is to blame.
    pub key: Option<String>,
    /// What was found and what is allowed.
    pub why: String,
}

/// What is wrong in a TOML text: at least one flaw, in the order in which they were found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flaws {
    pub(crate) first: Flaw,
    pub(crate) others: Vec<Flaw>,
    /// Whether there may be more than those.
    pub(crate) more: bool,
}

impl Flaws {
    /// The flaw that is named with its own place.
    pub fn first(&self) -> &Flaw {
        &self.first
    }

    /// What is wrong with the first one, and then each other one with its line and key. `text` is what was parsed.
    pub fn why(&self, text: &str) -> String {
        let mut all = self.first.why.clone();
        for flaw in &self.others {
            let line = flaw
                .span
                .as_ref()
                .map(|span| format!("line {}: ", line(text, span)));
            let key = flaw.key.as_ref().map(|key| format!("{key}: "));
            all = format!(
                "{all}; {}{}{}",
                line.unwrap_or_default(),
                key.unwrap_or_default(),
                flaw.why
            );
        }
        if self.more {
            all += "; and more";
        }
        all
    }

    /// Line of the first flaw, from 1, where it is known.
    pub fn line(&self, text: &str) -> Option<usize> {
        self.first.span.as_ref().map(|span| line(text, span))
    }
}

/// All of it in one line, without the places, which need the text.
impl std::fmt::Display for Flaws {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(key) = &self.first.key {
            write!(f, "{key}: ")?;
        }
        f.write_str(&self.why(""))
    }
}

impl std::error::Error for Flaws {}

/// Line on which a span begins, from 1.
pub(crate) fn line(text: &str, span: &Range<usize>) -> usize {
    let before = &text.as_bytes()[..span.start.min(text.len())];
    before.iter().filter(|&&byte| byte == b'\n').count() + 1
}
