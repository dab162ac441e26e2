use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use async_trait::async_trait;
use crc::{CRC_32_ISO_HDLC, Crc};

use crate::{Header, Journal, JournalError, Record};

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// A journal in a file: one line a record, the CRC-32 of its JSON in eight hexadecimal digits, a space, the JSON.
///
/// Every record is synced before [`Journal::append`] returns. A last line that was cut short or damaged by a crash
/// had not been promised to anyone; it is removed when the file is opened. Damage before it is an error. An advisory
/// lock keeps a second process from appending.
#[derive(Debug)]
pub struct FileJournal {
    file: File,
    path: PathBuf,
    records: Vec<Record>,
    /// Length of the file up to the last whole record, bytes.
    length: u64,
    /// Bytes of an append that failed and could not be taken back may follow `length`.
    torn: bool,
}

impl FileJournal {
    /// Begins a journal with its header; a file that is there already is never touched.
    ///
    /// # Errors
    /// The file exists, or cannot be created, locked or written.
    pub fn create(path: impl AsRef<Path>, header: Header) -> Result<Self, JournalError> {
        let path = path.as_ref();
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create_new(true)
            .open(path);
        let file = file.map_err(io("create", path))?;
        lock(&file, path)?;
        let mut journal = Self {
            file,
            path: path.to_owned(),
            records: Vec::new(),
            length: 0,
            torn: false,
        };
        journal.write(&Record::Header(header))?;
        // The name is durable once the directory is.
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
        let directory = File::open(parent.unwrap_or(Path::new(".")));
        directory
            .and_then(|directory| directory.sync_all())
            .map_err(io("sync the directory of", path))?;
        Ok(journal)
    }

    /// Opens a journal to go on with it, and cuts off a torn tail.
    ///
    /// # Errors
    /// The file cannot be opened or is in use, is no journal, or is damaged before its last line.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, JournalError> {
        let path = path.as_ref();
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .open(path)
            .map_err(io("open", path))?;
        lock(&file, path)?;
        let bytes = read(&file, path)?;
        let (records, length) = parse(&bytes, path)?;
        let mut journal = Self {
            file,
            path: path.to_owned(),
            records,
            length: length as u64,
            torn: true,
        };
        journal.cut()?;
        Ok(journal)
    }

    /// Reads all whole records of a journal that another process may be writing.
    ///
    /// # Errors
    /// The file cannot be read, is no journal, or is damaged before its last line.
    pub fn read(path: impl AsRef<Path>) -> Result<Vec<Record>, JournalError> {
        let path = path.as_ref();
        let file = File::open(path).map_err(io("open", path))?;
        let bytes = read(&file, path)?;
        Ok(parse(&bytes, path)?.0)
    }

    /// Reads all whole records of the bytes of a journal file, which errors call `name`.
    ///
    /// # Errors
    /// They are no journal, or damaged before the last line.
    pub fn parse(bytes: &[u8], name: impl AsRef<Path>) -> Result<Vec<Record>, JournalError> {
        Ok(parse(bytes, name.as_ref())?.0)
    }

    /// Writes records in the form of a journal file, for one that is made whole from another place.
    ///
    /// # Errors
    /// What `out` says.
    pub fn copy<'a>(
        records: impl IntoIterator<Item = &'a Record>,
        out: &mut impl Write,
    ) -> std::io::Result<()> {
        for record in records {
            out.write_all(line(record)?.as_bytes())?;
        }
        Ok(())
    }

    /// Makes the last whole record the end of the file.
    fn cut(&mut self) -> Result<(), JournalError> {
        let cut = self
            .file
            .set_len(self.length)
            .and_then(|()| self.file.seek(SeekFrom::End(0)));
        cut.and_then(|_| self.file.sync_all())
            .map_err(io("cut the torn tail of", &self.path))?;
        self.torn = false;
        Ok(())
    }

    /// Appends a record and returns once it is durable.
    fn write(&mut self, record: &Record) -> Result<(), JournalError> {
        if self.torn {
            self.cut()?;
        }
        let line = line(record).map_err(io("write", &self.path))?;
        self.torn = true;
        let written = self
            .file
            .write_all(line.as_bytes())
            .and_then(|()| self.file.sync_data());
        if let Err(source) = written {
            // Best effort: where this fails as well, the next append or open tries again.
            let _ = self.cut();
            return Err(io("write", &self.path)(source));
        }
        self.torn = false;
        self.length += line.len() as u64;
        self.records.push(record.clone());
        Ok(())
    }
}

#[async_trait]
impl Journal for FileJournal {
    async fn append(&mut self, record: &Record) -> Result<(), JournalError> {
        self.write(record)
    }

    fn records(&self) -> &[Record] {
        &self.records
    }

    fn room(&self) -> Option<u64> {
        rig::doctor::room(&self.path).ok()
    }
}

fn io<'a>(what: &'static str, path: &'a Path) -> impl Fn(std::io::Error) -> JournalError + 'a {
    move |source| JournalError::Io {
        what,
        path: path.to_owned(),
        source,
    }
}

fn lock(file: &File, path: &Path) -> Result<(), JournalError> {
    file.try_lock().map_err(|error| match error {
        TryLockError::WouldBlock => JournalError::Locked {
            path: path.to_owned(),
        },
        TryLockError::Error(source) => io("lock", path)(source),
    })
}

fn read(mut file: &File, path: &Path) -> Result<Vec<u8>, JournalError> {
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).map_err(io("read", path))?;
    Ok(bytes)
}

fn line(record: &Record) -> std::io::Result<String> {
    let json = serde_json::to_string(record)?;
    Ok(format!("{:08x} {json}\n", CRC.checksum(json.as_bytes())))
}

/// Whole records from the start, and the bytes that they take.
fn parse(bytes: &[u8], path: &Path) -> Result<(Vec<Record>, usize), JournalError> {
    let damaged = |line, why: String| JournalError::Damaged {
        path: path.to_owned(),
        line,
        why,
    };
    let mut records = Vec::new();
    let mut length = 0;
    for (i, line) in bytes.split_inclusive(|&byte| byte == b'\n').enumerate() {
        let last = length + line.len() == bytes.len();
        match record(line) {
            Ok(record) => records.push(record),
            // A crash tears the end of the file only.
            Err(_) if last && i > 0 => break,
            Err(why) => return Err(damaged(i + 1, why)),
        }
        length += line.len();
    }
    match records.first() {
        Some(Record::Header(_)) => Ok((records, length)),
        Some(_) => Err(damaged(1, "the first record is no header".to_owned())),
        None => Err(damaged(1, "the file is empty".to_owned())),
    }
}

fn record(line: &[u8]) -> Result<Record, String> {
    let line = line.strip_suffix(b"\n").ok_or("the line is cut short")?;
    let text = std::str::from_utf8(line).map_err(|error| error.to_string())?;
    let (crc, json) = text.split_once(' ').ok_or("no checksum, so no journal line")?;
    let crc = u32::from_str_radix(crc, 16).map_err(|_| "no checksum, so no journal line")?;
    if crc != CRC.checksum(json.as_bytes()) {
        return Err("the checksum does not match".to_owned());
    }
    serde_json::from_str(json).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device that is always full stands for a full disk.
    #[test]
    fn a_full_disk_is_an_error_and_keeps_what_was_there() {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .open("/dev/full")
            .unwrap();
        let path = PathBuf::from("/dev/full");
        let mut journal = FileJournal {
            file,
            path,
            records: Vec::new(),
            length: 0,
            torn: false,
        };
        let end = Record::End {
            outcome: crate::Outcome::Done,
            device_ticks: None,
            at: String::new(),
        };
        let error = journal.write(&end).unwrap_err();
        assert!(matches!(error, JournalError::Io { what: "write", .. }), "{error}");
        assert!(journal.records().is_empty());
    }
}
