use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::Error;

/// A CSV file of rows that only grows, and from which an interrupted study goes on.
///
/// Rows that belong together are appended in one write; a line that was cut short by a crash is removed when the file
/// is opened again. It is locked while it is open, so that nobody else cuts or continues it; where the file system knows no
/// locks, nothing keeps two programs apart.
#[derive(Debug)]
pub(crate) struct Ledger<R> {
    file: File,
    path: PathBuf,
    rows: Vec<R>,
}

impl<R: Serialize + DeserializeOwned + Clone> Ledger<R> {
    /// Opens the ledger, or begins it.
    ///
    /// # Errors
    /// The medium refuses, a whole line is no row of this kind, or another program writes it.
    pub(crate) fn open(path: &Path) -> Result<Self, Error> {
        let io = |what| {
            move |source| Error::Io {
                what,
                path: path.to_owned(),
                source,
            }
        };
        let mut options = OpenOptions::new();
        let opened = options
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path);
        let mut file = opened.map_err(io("open"))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::InUse {
                    path: path.to_owned(),
                });
            }
            Err(TryLockError::Error(error)) if error.kind() == std::io::ErrorKind::Unsupported => {}
            Err(TryLockError::Error(error)) => return Err(io("lock")(error)),
        }
        let mut text = String::new();
        file.read_to_string(&mut text).map_err(io("read"))?;
        let whole = whole_lines(&text);
        file.set_len(whole.len() as u64).map_err(io("cut"))?;
        file.seek(SeekFrom::End(0)).map_err(io("read"))?;
        let rows = parse(whole).map_err(io("read"))?;
        Ok(Self {
            file,
            path: path.to_owned(),
            rows,
        })
    }

    /// Adds rows.
    ///
    /// # Errors
    /// The medium refuses.
    pub(crate) fn append(&mut self, rows: &[R]) -> Result<(), Error> {
        let io = |source| Error::Io {
            what: "write",
            path: self.path.clone(),
            source,
        };
        let text = text(rows, self.rows.is_empty()).map_err(io)?;
        self.file.write_all(&text).map_err(io)?;
        self.rows.extend_from_slice(rows);
        Ok(())
    }
}

/// The rows of a ledger that somebody else may be writing; a line that is not whole yet is left out. None where there is no
/// such file.
///
/// # Errors
/// The medium refuses, or a whole line is no row of this kind.
pub(crate) fn read<R: DeserializeOwned>(path: &Path) -> Result<Vec<R>, Error> {
    let io = |source| Error::Io {
        what: "read",
        path: path.to_owned(),
        source,
    };
    match std::fs::read_to_string(path) {
        Ok(text) => parse(whole_lines(&text)).map_err(io),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(Vec::new()),
        Err(error) => Err(io(error)),
    }
}

fn whole_lines(text: &str) -> &str {
    &text[..text.rfind('\n').map_or(0, |end| end + 1)]
}

fn parse<R: DeserializeOwned>(text: &str) -> std::io::Result<Vec<R>> {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let rows = reader.deserialize().collect::<Result<Vec<R>, _>>();
    rows.map_err(std::io::Error::other)
}

/// Rows as CSV without one of their columns.
pub(crate) fn text_without<R: Serialize>(rows: &[R], column: &str) -> std::io::Result<Vec<u8>> {
    let whole = text(rows, true)?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .from_reader(whole.as_slice());
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut left_out = None;
    for (line, record) in reader.records().enumerate() {
        let record = record.map_err(std::io::Error::other)?;
        if line == 0 {
            left_out = record.iter().position(|name| name == column);
        }
        let cells = record.iter().enumerate();
        let cells = cells.filter(|(i, _)| Some(*i) != left_out);
        writer
            .write_record(cells.map(|(_, cell)| cell))
            .map_err(std::io::Error::other)?;
    }
    writer
        .into_inner()
        .map_err(|error| std::io::Error::other(error.to_string()))
}

/// Rows as CSV, with a heading or without.
pub(crate) fn text<R: Serialize>(rows: &[R], heading: bool) -> std::io::Result<Vec<u8>> {
    let mut writer = csv::WriterBuilder::new()
        .has_headers(heading)
        .from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).map_err(std::io::Error::other)?;
    }
    writer
        .into_inner()
        .map_err(|error| std::io::Error::other(error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq, Serialize, serde::Deserialize)]
    struct Row {
        name: String,
        value: Option<f64>,
    }

    #[test]
    fn a_line_that_was_cut_short_is_taken_back() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("study.csv");
        let row = |name: &str, value| Row {
            name: name.to_owned(),
            value,
        };
        let rows = [row("a, b", Some(1.5)), row("c", None)];
        Ledger::open(&path).unwrap().append(&rows[..1]).unwrap();
        let mut torn = OpenOptions::new().append(true).open(&path).unwrap();
        torn.write_all(b"c,1.797").unwrap();
        assert_eq!(read::<Row>(&path).unwrap(), &rows[..1]);
        let mut ledger = Ledger::<Row>::open(&path).unwrap();
        assert_eq!(ledger.rows, &rows[..1]);
        let refused = Ledger::<Row>::open(&path).unwrap_err();
        assert!(matches!(refused, Error::InUse { .. }), "{refused}");
        ledger.append(&rows[1..]).unwrap();
        drop(ledger);
        assert_eq!(Ledger::<Row>::open(&path).unwrap().rows, rows);
    }
}
