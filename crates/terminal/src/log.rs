use std::io::{self, IsTerminal, Write};

use clap::ValueEnum;
use tracing::Subscriber;
use tracing::field::Field;
use tracing_subscriber::field::MakeExt;
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::fmt::format::{Writer, debug_fn};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use crate::printable::{Printable, printable_json};

/// How a log is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// For people.
    Human,
    /// A JSON object a line.
    Json,
}

/// Writes the log of this process to stderr from now on: what the variable `RUST_LOG` says, such as `warn` or
/// `info,capture=debug`, else everything from `level` on. A text that is no such list counts as none.
///
/// Does nothing where a log is written already.
pub fn log(format: LogFormat, level: LevelFilter) {
    let said = std::env::var("RUST_LOG").ok();
    let said = said.filter(|text| !text.trim().is_empty());
    let filter = said
        .and_then(|text| text.parse().ok())
        .unwrap_or_else(|| Targets::new().with_default(level));
    let _ = subscriber(format, filter, io::stderr().is_terminal(), io::stderr).try_init();
}

/// Returns what writes a log, in colours where `ansi` says so. Each event takes one line, in which nothing can control
/// a terminal but those colours.
pub fn subscriber<W>(
    format: LogFormat,
    filter: Targets,
    ansi: bool,
    writer: W,
) -> Box<dyn Subscriber + Send + Sync>
where
    W: for<'a> MakeWriter<'a> + Send + Sync + 'static,
{
    let log = tracing_subscriber::fmt()
        .with_max_level(LevelFilter::TRACE)
        .with_ansi(ansi);
    match format {
        LogFormat::Human => Box::new(
            log.fmt_fields(debug_fn(field).delimited(" "))
                .with_writer(writer)
                .finish()
                .with(filter),
        ),
        LogFormat::Json => Box::new(log.json().with_writer(JsonLines(writer)).finish().with(filter)),
    }
}

/// Writes a field as people read it. The name of a field is in the program's text, its value may be anybody's.
fn field(writer: &mut Writer<'_>, field: &Field, value: &dyn std::fmt::Debug) -> std::fmt::Result {
    match field.name() {
        "message" => write!(writer, "{}", Printable(format_args!("{value:?}"))),
        name => write!(writer, "{name}={}", Printable(format_args!("{value:?}"))),
    }
}

/// Makes the lines of a JSON log printable.
struct JsonLines<W>(W);

impl<'a, W: MakeWriter<'a>> MakeWriter<'a> for JsonLines<W> {
    type Writer = JsonLine<W::Writer>;

    fn make_writer(&'a self) -> Self::Writer {
        JsonLine(self.0.make_writer())
    }
}

struct JsonLine<W>(W);

impl<W: Write> Write for JsonLine<W> {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        // An event comes whole, as UTF-8.
        let text = String::from_utf8_lossy(line);
        self.0.write_all(printable_json(&text).as_bytes())?;
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}
