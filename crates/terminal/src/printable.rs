use std::borrow::Cow;
use std::fmt::{self, Display, Write};

use unicode_properties::{GeneralCategory, UnicodeGeneralCategory};

/// Text in which each character can be seen: what could control a terminal, reorder or hide text, or break a line is
/// shown by its escape, such as `\n` or `\u{202e}`.
#[derive(Clone, Copy, Debug)]
pub struct Printable<T>(pub T);

impl<T: Display> Display for Printable<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(Escaping(f), "{}", self.0)
    }
}

/// Returns a text as [`Printable`] shows it.
pub fn printable(text: &str) -> Cow<'_, str> {
    if text.chars().all(can_be_seen) {
        Cow::Borrowed(text)
    } else {
        Cow::Owned(Printable(text).to_string())
    }
}

/// Returns a JSON text that means the same, with what cannot be seen in its strings escaped as JSON does.
///
/// Between the strings of a JSON text there is nothing to escape; line breaks and tabs stay.
pub fn printable_json(text: &str) -> Cow<'_, str> {
    let stays = |c: char| can_be_seen(c) || matches!(c, '\n' | '\t' | '\r');
    if text.chars().all(stays) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        if stays(c) {
            escaped.push(c);
            continue;
        }
        for unit in c.encode_utf16(&mut [0; 2]) {
            write!(escaped, "\\u{unit:04x}").expect("a string takes everything");
        }
    }
    Cow::Owned(escaped)
}

/// Escapes what passes through.
struct Escaping<'a, 'b>(&'a mut fmt::Formatter<'b>);

impl Write for Escaping<'_, '_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let mut rest = text;
        while let Some(at) = rest.find(|c| !can_be_seen(c)) {
            let (seen, hidden) = rest.split_at(at);
            self.0.write_str(seen)?;
            let mut hidden = hidden.chars();
            if let Some(c) = hidden.next() {
                write!(self.0, "{}", c.escape_default())?;
            }
            rest = hidden.as_str();
        }
        self.0.write_str(rest)
    }
}

/// True for a character that shows as itself, where it stands, and does nothing else.
fn can_be_seen(c: char) -> bool {
    if c.is_ascii() {
        return !c.is_ascii_control();
    }
    let hidden = matches!(
        c.general_category(),
        GeneralCategory::Control
            | GeneralCategory::Format
            | GeneralCategory::Surrogate
            | GeneralCategory::PrivateUse
            | GeneralCategory::Unassigned
            | GeneralCategory::LineSeparator
            | GeneralCategory::ParagraphSeparator
    );
    !hidden && !is_ignorable(c)
}

/// True for letters and marks that show nothing: those of Default_Ignorable_Code_Point (Unicode 16,
/// DerivedCoreProperties) whose category does not say so.
fn is_ignorable(c: char) -> bool {
    matches!(c,
        '\u{034f}' | '\u{115f}'..='\u{1160}' | '\u{17b4}'..='\u{17b5}' | '\u{180b}'..='\u{180d}' | '\u{180f}'
        | '\u{3164}' | '\u{fe00}'..='\u{fe0f}' | '\u{ffa0}' | '\u{e0100}'..='\u{e01ef}')
}
