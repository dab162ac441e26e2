//! docs/operating.md knows every code and every message that the program has.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

/// Enums whose variants are codes, as files, the API and the page spell them.
const CODES: [(&str, &str); 4] = [
    ("crates/api/src/fault.rs", "FaultCode"),
    ("crates/api/src/state.rs", "JobState"),
    ("crates/rig/src/fault.rs", "FaultKind"),
    ("crates/capture/src/reading.rs", "Flag"),
];

/// Files whose error texts a technician may meet.
const MESSAGES: [&str; 8] = [
    "crates/rig/src/calibration/dark_set.rs",
    "crates/rig/src/error.rs",
    "crates/rig/src/drive/error.rs",
    "crates/arms/src/envelope.rs",
    "crates/capture/src/error.rs",
    "crates/session/src/error.rs",
    "crates/goniod/src/error.rs",
    "crates/goniod/src/store.rs",
];

/// Shorter than this, what stands between the variables of a message names nothing.
const LETTERS: usize = 8;

fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Variants of an enum in a source file, in snake case.
fn variants(source: &str, name: &str) -> Vec<String> {
    let begin = source
        .find(&format!("pub enum {name} {{"))
        .unwrap_or_else(|| panic!("no enum {name}"));
    let body = source[begin..].lines().skip(1).take_while(|line| *line != "}");
    let named = body
        .filter_map(|line| line.strip_prefix("    "))
        .filter(|line| line.starts_with(char::is_uppercase));
    named
        .map(|line| {
            let mut snake = String::new();
            for letter in line.chars().take_while(|letter| letter.is_alphanumeric()) {
                if letter.is_uppercase() && !snake.is_empty() {
                    snake.push('_');
                }
                snake.extend(letter.to_lowercase());
            }
            snake
        })
        .collect()
}

/// A string literal without the breaks of its lines.
fn unbroken(literal: &str) -> String {
    let mut lines = literal.split("\\\n");
    let first = lines.next().unwrap_or_default().to_owned();
    lines.fold(first, |text, line| text + line.trim_start())
}

/// The longest fixed piece of each error text in a source file.
fn messages(source: &str) -> Vec<String> {
    let attributes = source.split("#[error(").skip(1);
    let texts: Vec<String> = attributes
        .filter_map(|rest| rest.trim_start().strip_prefix('"')?.split('"').next())
        .map(unbroken)
        .collect();
    let fixed = |text: &str| {
        let pieces = text
            .split('{')
            .map(|piece| piece.split_once('}').map_or(piece, |(_, fixed)| fixed));
        let longest =
            pieces.max_by_key(|piece| piece.chars().filter(|letter| letter.is_alphabetic()).count());
        longest
            .unwrap_or_default()
            .trim_matches(|letter: char| !letter.is_alphanumeric())
            .to_owned()
    };
    let telling = |text: &String| text.chars().filter(|letter| letter.is_alphabetic()).count() >= LETTERS;
    texts.iter().map(|text| fixed(text)).filter(telling).collect()
}

#[test]
fn every_code_is_explained() {
    let page = read("docs/operating.md");
    for (file, name) in CODES {
        let codes = variants(&read(file), name);
        assert!(codes.len() > 2, "{file}: {codes:?}");
        for code in codes {
            let words = code.replace('_', " ");
            assert!(
                page.contains(&format!("`{code}`")) || page.contains(&format!("| {words} |")),
                "docs/operating.md does not name {code} of {name}"
            );
        }
    }
}

#[test]
fn every_message_is_explained() {
    let page = read("docs/operating.md");
    let known: Vec<_> = MESSAGES.iter().flat_map(|file| messages(&read(file))).collect();
    assert!(known.len() > 30, "{known:?}");
    let missing: Vec<_> = known
        .iter()
        .filter(|message| !page.contains(message.as_str()))
        .collect();
    assert!(
        missing.is_empty(),
        "docs/operating.md does not explain {missing:#?}"
    );
}

#[test]
fn every_check_of_doctor_is_explained() {
    let page = read("docs/operating.md");
    let checks = [
        "clock",
        "disk",
        "port",
        "permission",
        "lock",
        "latency timer",
        "devices",
        "round trip",
        "pose",
        "dark",
        "lamp",
    ];
    for check in checks {
        assert!(
            page.contains(&format!("| {check} |")),
            "docs/operating.md does not explain {check}"
        );
    }
}
