//! Whatever the text, nothing in what is printed can control a terminal.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use proptest::prelude::*;
use terminal::{LogFormat, Printable, printable, printable_json, subscriber};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::MakeWriter;

/// What has been used against people who look at a terminal, with what is shown instead.
const HOSTILE: [(&str, &str); 16] = [
    ("\u{1b}[2J", r"\u{1b}[2J"),
    ("\u{1b}]0;title\u{7}", r"\u{1b}]0;title\u{7}"),
    ("\u{9b}31m", r"\u{9b}31m"),
    ("\u{9d}0;title\u{9c}", r"\u{9d}0;title\u{9c}"),
    ("good\rbad", r"good\rbad"),
    ("good\nbad", r"good\nbad"),
    ("\u{0}\u{8}\u{7f}", r"\u{0}\u{8}\u{7f}"),
    ("a\tb", r"a\tb"),
    ("\u{85}", r"\u{85}"),
    ("\u{202e}evil\u{202c}", r"\u{202e}evil\u{202c}"),
    ("\u{2066}evil\u{2069}", r"\u{2066}evil\u{2069}"),
    ("\u{200e}\u{200f}\u{61c}", r"\u{200e}\u{200f}\u{61c}"),
    (
        "\u{200b}\u{200d}\u{2060}\u{feff}",
        r"\u{200b}\u{200d}\u{2060}\u{feff}",
    ),
    ("\u{2028}\u{2029}", r"\u{2028}\u{2029}"),
    ("\u{e0041}\u{fe0f}\u{3164}", r"\u{e0041}\u{fe0f}\u{3164}"),
    ("\u{e000}\u{10ffff}", r"\u{e000}\u{10ffff}"),
];

/// What this program says itself, and what people call their specimens.
const HARMLESS: [&str; 4] = [
    "light -45.00°  θ_r 0 … 85, 3.1 sr⁻¹ ± 2 %, Σ × ← →",
    "Gold, grün, e\u{301}tain, 金, ذهب, золото, सोना",
    r"C:\rig 'quoted' \u{1b}",
    "emoji 🔧",
];

/// Characters of every kind, those that control something more often than they are among all.
fn text() -> impl Strategy<Value = String> {
    let hostile = proptest::sample::select(
        HOSTILE
            .iter()
            .flat_map(|(text, _)| text.chars())
            .collect::<Vec<_>>(),
    );
    let character = prop_oneof![any::<char>(), hostile, proptest::char::range('\0', '\u{2fff}')];
    proptest::collection::vec(character, 0..40).prop_map(String::from_iter)
}

/// An independent statement of what may not be shown raw: by ranges, where the program goes by categories.
fn controls(c: char) -> bool {
    matches!(c, '\0'..='\u{1f}' | '\u{7f}'..='\u{9f}' | '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}'..='\u{1160}'
        | '\u{17b4}'..='\u{17b5}' | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
        | '\u{2060}'..='\u{206f}' | '\u{3164}' | '\u{e000}'..='\u{f8ff}' | '\u{fe00}'..='\u{fe0f}' | '\u{feff}'
        | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}' | '\u{e0000}'..='\u{10ffff}')
}

/// Collects a log.
#[derive(Clone, Default)]
struct Kept(Arc<Mutex<Vec<u8>>>);

impl Write for Kept {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl MakeWriter<'_> for Kept {
    type Writer = Self;

    fn make_writer(&self) -> Self {
        self.clone()
    }
}

/// The log of an event that carries a text in every way in which an event can.
fn logged(format: LogFormat, text: &str) -> String {
    let kept = Kept::default();
    let subscriber = subscriber(
        format,
        Targets::new().with_default(LevelFilter::INFO),
        false,
        kept.clone(),
    );
    tracing::subscriber::with_default(subscriber, || {
        let error: Box<dyn std::error::Error> = text.to_owned().into();
        let span = tracing::info_span!("request", path = text, host = %text);
        span.in_scope(
            || tracing::warn!(path = text, host = %text, name = ?text, error = &*error, "refused: {text}"),
        );
    });
    let bytes = kept.0.lock().unwrap().clone();
    String::from_utf8(bytes).unwrap()
}

#[test]
fn hostile_text_is_shown_by_its_escapes() {
    for (hostile, shown) in HOSTILE {
        assert_eq!(printable(hostile), shown);
        assert_eq!(Printable(hostile).to_string(), shown);
    }
}

#[test]
fn harmless_text_stays_as_it_is() {
    for text in HARMLESS {
        assert_eq!(printable(text), text);
        assert_eq!(printable_json(text), text);
    }
}

proptest! {
    #[test]
    fn prop_nothing_that_controls_a_terminal_is_left(text in text()) {
        let shown = printable(&text);
        prop_assert!(!shown.contains(controls), "{shown:?}");
        prop_assert_eq!(Printable(&text).to_string(), shown.as_ref());
        prop_assert_eq!(printable(&shown), shown.as_ref(), "what was made printable is");
    }

    #[test]
    fn prop_json_is_printable_and_means_the_same(text in text()) {
        let value = serde_json::json!({ &text: [&text] });
        for written in [value.to_string(), serde_json::to_string_pretty(&value).unwrap()] {
            let shown = printable_json(&written);
            prop_assert!(!shown.contains(|c| c != '\n' && controls(c)), "{shown:?}");
            prop_assert_eq!(&serde_json::from_str::<serde_json::Value>(&shown).unwrap(), &value);
        }
    }

    #[test]
    fn prop_a_log_has_one_printable_line_for_each_event(text in text()) {
        for format in [LogFormat::Human, LogFormat::Json] {
            let log = logged(format, &text);
            let line = log.strip_suffix('\n').unwrap();
            prop_assert!(line.contains("refused: ") && !line.contains(controls), "{line:?}");
        }
        let event: serde_json::Value = serde_json::from_str(&logged(LogFormat::Json, &text)).unwrap();
        prop_assert_eq!(event["fields"]["path"].as_str(), Some(text.as_str()));
    }
}
