//! What to do about a fault: what docs/operating.md says of it.

use crate::FaultCode;

/// The page that explains every fault; its own test sees to that.
const OPERATING: &str = include_str!("../../../docs/operating.md");
/// Letters that a message's fixed words must have to be taken for that message.
const LETTERS: usize = 6;
/// What stands in place of an advice that is somewhere else.
const POINTERS: [&str; 4] = ["follows", "says which", "says what", "says why"];

/// What is to be done about a fault: as the page says of its message, else of its kind.
pub(crate) fn remedy(code: FaultCode, text: &str) -> String {
    let section = section(code);
    let of_message = rows(section)
        .into_iter()
        .filter(|(_, advice)| !POINTERS.iter().any(|pointer| advice.contains(pointer)))
        .map(|(message, advice)| (likeness(message, code, text), advice))
        .max_by_key(|(likeness, _)| *likeness)
        .filter(|(likeness, _)| *likeness >= LETTERS);
    let advice = match of_message {
        Some((_, advice)) => advice,
        None => prose(section).unwrap_or("remove its cause, then acknowledge and resume"),
    };
    sentence(advice)
}

/// The section of the page about a kind of fault, without its heading.
fn section(code: FaultCode) -> &'static str {
    let name = format!("`{code}`");
    let is_heading = |line: &str| line.starts_with('#');
    let mut lines = OPERATING.lines();
    let Some(heading) = lines.find(|line| line.starts_with("### ") && line.contains(&name)) else {
        return "";
    };
    let end = lines
        .find(|line| is_heading(line))
        .map_or(OPERATING.len(), offset);
    &OPERATING[offset(heading) + heading.len()..end]
}

/// Where a line of the page begins.
fn offset(line: &'static str) -> usize {
    line.as_ptr().addr() - OPERATING.as_ptr().addr()
}

/// Rows of the tables of a section: message or code, and what to do; "likewise" is that of the row before.
fn rows(section: &str) -> Vec<(&str, &str)> {
    let mut rows: Vec<(&str, &str)> = Vec::new();
    for line in section.lines() {
        let cells = line.strip_prefix("| ").and_then(|line| line.strip_suffix(" |"));
        let Some((message, advice)) = cells.and_then(|cells| cells.split_once(" | ")) else {
            continue;
        };
        let advice = match rows.last() {
            Some((_, before)) if advice.starts_with("likewise") => before,
            _ => advice,
        };
        rows.push((message, advice));
    }
    rows
}

/// Letters of the words that a text has in common with a message of the page, whose variable parts are "…"; 0 where it
/// is not that message. A row may also name the code, or several words one of which must be there.
fn likeness(message: &str, code: FaultCode, text: &str) -> usize {
    if message == format!("`{code}`") {
        return usize::MAX;
    }
    let letters = |words: &str| words.chars().filter(|letter| letter.is_alphabetic()).count();
    if !message.contains('…') {
        let found = message.split(", ").filter(|words| text.contains(words));
        return match text.contains(message) {
            true => letters(message),
            false => found.map(letters).max().unwrap_or(0),
        };
    }
    let mut rest = text;
    let mut found = 0;
    for words in message.split('…').map(str::trim) {
        let Some(at) = rest.find(words) else { return 0 };
        rest = &rest[at + words.len()..];
        found += letters(words);
    }
    found
}

/// The first two sentences of a section, where it does not begin with a table.
fn prose(section: &str) -> Option<&str> {
    let first = section
        .lines()
        .find(|line| !line.is_empty() && !line.starts_with('|'))?;
    let end = first.match_indices(". ").nth(1).map(|(at, _)| at + 1);
    Some(&first[..end.unwrap_or(first.len())])
}

/// A cell of the page as a sentence of plain text: no markup, no link.
fn sentence(advice: &str) -> String {
    let mut plain = String::with_capacity(advice.len());
    let mut rest = advice;
    // A link is [words](address).
    while let Some((before, words, after)) = link(rest) {
        plain.extend([before, words]);
        rest = after;
    }
    plain.push_str(rest);
    let plain = plain.replace('`', "");
    let mut letters = plain.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    let mut sentence: String = first.chain(letters).collect();
    if !sentence.ends_with(['.', '!', '?']) {
        sentence.push('.');
    }
    sentence
}

/// What stands before the first link of a text, its words, and what stands after it.
fn link(text: &str) -> Option<(&str, &str, &str)> {
    let middle = text.find("](")?;
    let begin = text[..middle].rfind('[')?;
    let end = middle + text[middle..].find(')')?;
    Some((&text[..begin], &text[begin + 1..middle], &text[end + 1..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CODES: [FaultCode; 16] = [
        FaultCode::Estop,
        FaultCode::NoReply,
        FaultCode::Refused,
        FaultCode::Hardware,
        FaultCode::Motion,
        FaultCode::Light,
        FaultCode::Disconnected,
        FaultCode::Mismatch,
        FaultCode::Setup,
        FaultCode::StoodStill,
        FaultCode::DiskFull,
        FaultCode::StoreLocked,
        FaultCode::ReadOnly,
        FaultCode::DiskError,
        FaultCode::Store,
        FaultCode::Report,
    ];

    #[test]
    fn every_kind_of_fault_has_a_section_and_a_remedy_in_plain_words() {
        for code in CODES {
            assert!(
                !section(code).is_empty(),
                "docs/operating.md has no section of {code}"
            );
            let said = remedy(code, "nothing that the page knows");
            assert!(said.ends_with('.') && said.len() > 20, "{code}: {said:?}");
            for markup in ["`", "](", "| "] {
                assert!(!said.contains(markup), "{code}: {said:?}");
            }
        }
    }

    #[test]
    fn every_message_of_the_page_finds_its_own_advice() {
        let mut tried = 0;
        // A section of several codes has a row for each, which comes before the messages.
        let of_code = |code: &FaultCode| !OPERATING.contains(&format!("| `{code}` |"));
        for code in CODES.into_iter().filter(of_code) {
            for (message, advice) in rows(section(code)) {
                let pointer = POINTERS.iter().any(|pointer| advice.contains(pointer));
                if pointer || likeness(message, code, &message.replace('…', "7")) < LETTERS {
                    continue;
                }
                tried += 1;
                let text = format!("before it: {}: after it", message.replace('…', "7"));
                assert_eq!(remedy(code, &text), sentence(advice), "{code}: {text}");
            }
        }
        assert!(tried > 40, "{tried}");
    }

    #[test]
    fn the_advice_is_that_of_the_message_and_else_of_the_kind() {
        let said = |code, text: &str| remedy(code, text);
        let pressed = said(FaultCode::Estop, "emergency stop by operator at 127.0.0.1");
        assert!(
            pressed.starts_with("Find out why before you acknowledge."),
            "{pressed}"
        );
        let hot = "light servo reports overheating; remove the cause, then switch its power off and on";
        assert!(said(FaultCode::Hardware, hot).starts_with("Let the servo cool"));
        let locked = said(
            FaultCode::StoreLocked,
            "cannot record a reading in the store: busy",
        );
        assert!(locked.contains("End it"), "{locked}");
        let silent = "the light servo gives no reply: check its power, cable, id and baud rate";
        assert!(said(FaultCode::NoReply, silent).contains("gonioctl doctor"));
    }
}
