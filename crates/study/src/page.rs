use std::fmt::{Display, Write};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use report::escape;

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;margin:0;color:#1a1a1a;background:#fff}\
main{max-width:1040px;margin:0 auto;padding:1rem}h1{font-size:1.6rem}h2{font-size:1.15rem;margin-top:2rem}\
figure{margin:1rem 0}figure svg,figure img{max-width:100%;height:auto}pre{white-space:pre-wrap;background:#f5f5f5;\
padding:.8rem;font-size:.85rem}.wide{overflow-x:auto}table{border-collapse:collapse;font-size:.85rem}\
td,th{padding:.2rem .6rem;text-align:right;border-bottom:1px solid #ddd;white-space:nowrap}\
td:first-child,th:first-child{text-align:left}";

/// A page that needs nothing but itself.
#[derive(Clone, Debug)]
pub(crate) struct Page {
    title: String,
    body: String,
}

impl Page {
    pub(crate) fn new(title: &str) -> Self {
        let title = escape(title);
        Self {
            body: format!("<h1>{title}</h1>\n"),
            title,
        }
    }

    pub(crate) fn heading(&mut self, text: &str) {
        self.push(format_args!("<h2>{}</h2>", escape(text)));
    }

    /// Text as it stands, line by line.
    pub(crate) fn text(&mut self, text: &str) {
        self.push(format_args!("<pre>{}</pre>", escape(text)));
    }

    /// A drawing.
    pub(crate) fn figure(&mut self, svg: &str, caption: &str) {
        // With a view box it scales to the width that there is.
        let svg = match svg.find("<svg") {
            Some(start) => &svg[start..],
            None => svg,
        };
        self.push(format_args!(
            "<figure role=\"img\" aria-label=\"{}\">{svg}</figure>",
            escape(caption)
        ));
    }

    /// A PNG.
    pub(crate) fn image(&mut self, png: &[u8], caption: &str) {
        let data = STANDARD.encode(png);
        self.push(format_args!(
            "<figure><img alt=\"{}\" src=\"data:image/png;base64,{data}\"></figure>",
            escape(caption)
        ));
    }

    /// A table whose first row is its head.
    pub(crate) fn table(&mut self, rows: &[Vec<String>]) {
        let mut table = String::new();
        for (i, row) in rows.iter().enumerate() {
            let tag = if i == 0 { "th" } else { "td" };
            let cells: String = row
                .iter()
                .map(|cell| format!("<{tag}>{}</{tag}>", escape(cell)))
                .collect();
            table += &format!("<tr>{cells}</tr>\n");
        }
        self.push(format_args!("<div class=\"wide\"><table>\n{table}</table></div>"));
    }

    pub(crate) fn html(&self) -> String {
        let Self { title, body } = self;
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n{body}</main>\n</body>\n</html>\n"
        )
    }

    fn push(&mut self, line: impl Display) {
        writeln!(self.body, "{line}").expect("writing to a String does not fail");
    }
}
