use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use crate::{Check, Verdict};

/// Colours for light and dark, one column on a phone.
const STYLE: &str = include_str!("page.css");

/// What report.html shows, from top to bottom.
pub(crate) struct Page<'a> {
    /// What was measured.
    pub(crate) title: &'a str,
    /// Facts about the run: label, value.
    pub(crate) facts: Vec<(&'a str, String)>,
    /// Pictures as PNG, each with its caption.
    pub(crate) pictures: Vec<(&'a str, Vec<u8>)>,
    /// Consistency checks.
    pub(crate) checks: &'a [Check],
    /// Drawings as SVG, each with its caption.
    pub(crate) plots: Vec<(&'a str, String)>,
    /// Tables: caption, rows of cells; the first row is the head.
    pub(crate) tables: Vec<(&'a str, Vec<Vec<String>>)>,
    /// Sentences at the foot.
    pub(crate) notes: Vec<String>,
}

impl Page<'_> {
    /// The page: one file that needs nothing else, no network and no script.
    pub(crate) fn html(&self) -> String {
        let title = escape(self.title);
        let mut body = format!("<h1>{title}</h1>\n<dl>\n");
        for (label, value) in &self.facts {
            push(
                &mut body,
                format_args!("<dt>{}</dt><dd>{}</dd>", escape(label), escape(value)),
            );
        }
        body.push_str("</dl>\n<div class=\"pictures\">\n");
        for (caption, png) in &self.pictures {
            let (caption, data) = (escape(caption), STANDARD.encode(png));
            push(
                &mut body,
                format_args!(
                    "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{data}\"><figcaption>{caption}</figcaption></figure>"
                ),
            );
        }
        body.push_str("</div>\n<h2>Checks</h2>\n<ul class=\"checks\">\n");
        for Check {
            name, verdict, text, ..
        } in self.checks
        {
            let class = verdict.word();
            let word = match verdict {
                Verdict::Unknown => "not checked",
                judged => judged.word(),
            };
            push(
                &mut body,
                format_args!(
                    "<li class=\"{class}\"><b>{}</b> <em>{word}</em><br>{}</li>",
                    escape(name),
                    escape(text)
                ),
            );
        }
        body.push_str("</ul>\n<h2>Factors</h2>\n");
        for (caption, svg) in &self.plots {
            push(
                &mut body,
                format_args!(
                    "<figure>{svg}<figcaption>{}</figcaption></figure>",
                    escape(caption)
                ),
            );
        }
        for (caption, rows) in &self.tables {
            push(
                &mut body,
                format_args!("<h2>{}</h2>\n{}", escape(caption), table(rows)),
            );
        }
        for note in &self.notes {
            push(&mut body, format_args!("<p class=\"note\">{}</p>", escape(note)));
        }
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n"
        )
    }
}

/// A table whose first row is its head.
fn table(rows: &[Vec<String>]) -> String {
    let mut out = "<div class=\"wide\"><table>\n".to_owned();
    for (index, row) in rows.iter().enumerate() {
        let tag = if index == 0 { "th" } else { "td" };
        let cells: String = row
            .iter()
            .map(|cell| format!("<{tag}>{}</{tag}>", escape(cell)))
            .collect();
        push(&mut out, format_args!("<tr>{cells}</tr>"));
    }
    out + "</table></div>"
}

fn push(out: &mut String, line: std::fmt::Arguments<'_>) {
    out.write_fmt(line).expect("writing to a String does not fail");
    out.push('\n');
}

/// Text as it may stand in HTML, in attributes too.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_self_contained_and_escapes_what_people_wrote() {
        let checks = [Check {
            name: "both sides",
            verdict: Verdict::Look,
            text: "a < b".into(),
            values: serde_json::Value::Null,
        }];
        let page = Page {
            title: "</title><script>alert(1)</script> \"paint\"",
            facts: vec![("run", "R&D".into())],
            pictures: vec![("sphere", vec![1, 2, 3])],
            checks: &checks,
            plots: vec![],
            tables: vec![("errors", vec![vec!["male".into()], vec!["0.01".into()]])],
            notes: vec![],
        };
        let html = page.html();
        assert!(!html.contains("<script"), "{html}");
        assert!(!html.contains("http"), "nothing is fetched");
        for part in [
            "R&amp;D",
            "a &lt; b",
            "data:image/png;base64,AQID",
            "<th>male</th>",
            "<td>0.01</td>",
        ] {
            assert!(html.contains(part), "{part} is missing");
        }
    }
}
