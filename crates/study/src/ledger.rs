use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::Error;

/// A CSV file of rows that only grows, and from which an interrupted study goes on.
///
/// Rows that belong together are appended in one write; a line that was cut short by a crash is removed when the file
/// is opened again.
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
    /// The medium refuses, or a whole line is no row of this kind.
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
        let mut text = String::new();
        file.read_to_string(&mut text).map_err(io("read"))?;
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        file.set_len(whole as u64).map_err(io("cut"))?;
        file.seek(SeekFrom::End(0)).map_err(io("read"))?;
        let mut reader = csv::Reader::from_reader(&text.as_bytes()[..whole]);
        let rows = reader.deserialize().collect::<Result<Vec<R>, _>>();
        let rows = rows.map_err(|error| io("read")(std::io::Error::other(error)))?;
        Ok(Self {
            file,
            path: path.to_owned(),
            rows,
        })
    }

    pub(crate) fn rows(&self) -> &[R] {
        &self.rows
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
        let mut ledger = Ledger::<Row>::open(&path).unwrap();
        assert_eq!(ledger.rows(), &rows[..1]);
        ledger.append(&rows[1..]).unwrap();
        assert_eq!(Ledger::<Row>::open(&path).unwrap().rows(), rows);
    }
}
