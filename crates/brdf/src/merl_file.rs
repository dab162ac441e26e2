use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use crate::{Error, MerlTable};

/// What a stored number is worth in sr⁻¹, per channel (MERL's BRDFRead.cpp).
const SCALE: [f64; 3] = [1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0];
const CHANNELS: [&str; 3] = ["red", "green", "blue"];
const HEADER_BYTES: usize = 12;
const PLANE_BYTES: usize = MerlTable::NODES * 8;

impl MerlTable {
    /// Length of a MERL file: three int32 and three planes of 1,458,000 float64.
    pub const FILE_BYTES: u64 = (HEADER_BYTES + 3 * PLANE_BYTES) as u64;

    /// Reads a MERL `.binary` file.
    ///
    /// # Errors
    /// The file cannot be read, has another length, other dimensions, or an entry that is NaN or infinite.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let io = |source| Error::Io {
            what: "read",
            path: path.to_owned(),
            source,
        };
        let file = File::open(path).map_err(io)?;
        let bytes = file.metadata().map_err(io)?.len();
        if bytes != Self::FILE_BYTES {
            return Err(Error::Length {
                path: path.to_owned(),
                bytes,
                allowed: Self::FILE_BYTES,
            });
        }
        Self::read_from(file).map_err(|error| match error {
            Error::Stream { source, .. } => io(source),
            error => Error::File {
                path: path.to_owned(),
                source: Box::new(error),
            },
        })
    }

    /// Reads a MERL table from a stream that ends with it.
    ///
    /// # Errors
    /// As [`MerlTable::read`], without the path.
    ///
    /// ```
    /// use brdf::{Lambert, MerlTable};
    ///
    /// let table = MerlTable::fill(&Lambert::new(0.5)?);
    /// let mut bytes = Vec::new();
    /// table.write_to(&mut bytes).expect("memory takes it all");
    /// assert_eq!(bytes.len() as u64, MerlTable::FILE_BYTES);
    /// let back = MerlTable::read_from(&bytes[..])?;
    /// assert!((back.node([0, 0, 0]) - table.node([0, 0, 0])).abs().max_element() < 1e-15);
    /// // What ends too soon is refused.
    /// assert!(MerlTable::read_from(&bytes[..1000]).is_err());
    /// # Ok::<(), brdf::Error>(())
    /// ```
    pub fn read_from(mut stream: impl Read) -> Result<Self, Error> {
        let io = |source| Error::Stream { what: "read", source };
        let mut bytes = vec![0; HEADER_BYTES.max(PLANE_BYTES)];
        let mut read = 0;
        fill(&mut stream, &mut bytes[..HEADER_BYTES], &mut read)?;
        let (words, _) = bytes[..HEADER_BYTES].as_chunks();
        let found = std::array::from_fn(|n| i32::from_le_bytes(words[n]));
        if found != Self::SHAPE.map(|n| n as i32) {
            return Err(Error::Header { found });
        }
        let mut nodes = vec![[0.0; 3]; Self::NODES];
        for (channel, scale) in SCALE.iter().enumerate() {
            let start = read;
            fill(&mut stream, &mut bytes[..PLANE_BYTES], &mut read)?;
            for (at, (node, bytes)) in nodes.iter_mut().zip(bytes.as_chunks().0).enumerate() {
                let value = f64::from_le_bytes(*bytes);
                if !value.is_finite() {
                    let [_, rows, columns] = Self::SHAPE;
                    return Err(Error::NotFinite {
                        byte: start + 8 * at as u64,
                        channel: CHANNELS[channel],
                        index: [at / columns / rows, at / columns % rows, at % columns],
                        value,
                    });
                }
                node[channel] = value * scale;
            }
        }
        if stream.read(&mut bytes[..1]).map_err(io)? != 0 {
            return Err(Error::Trailing {
                allowed: Self::FILE_BYTES,
            });
        }
        Ok(Self::from_nodes(nodes))
    }

    /// Writes the table as MERL does: f · 1500 / (1.00, 1.15, 1.66), −1 where an entry is invalid.
    ///
    /// # Errors
    /// The stream refused.
    pub fn write_to(&self, stream: impl Write) -> io::Result<()> {
        let mut stream = BufWriter::with_capacity(1 << 16, stream);
        for n in Self::SHAPE {
            stream.write_all(&(n as i32).to_le_bytes())?;
        }
        for (channel, scale) in SCALE.iter().enumerate() {
            for node in self.nodes() {
                let value = node[channel];
                let stored = if value < 0.0 { -1.0 } else { value / scale };
                stream.write_all(&stored.to_le_bytes())?;
            }
        }
        stream.flush()
    }

    /// Writes a MERL file under a temporary name beside `path`, makes it durable and renames it, so that `path`
    /// never names half a table.
    ///
    /// # Errors
    /// The medium refused; what was at `path` before is still there.
    pub fn write(&self, path: &Path) -> Result<(), Error> {
        let partial = PathBuf::from(format!("{}.partial", path.display()));
        let written = File::create(&partial).and_then(|file| {
            self.write_to(&file)?;
            file.sync_all()?;
            std::fs::rename(&partial, path)
        });
        written.map_err(|source| {
            // What is left of a failed attempt is of no use; that it could not be removed changes nothing.
            let _ = std::fs::remove_file(&partial);
            Error::Io {
                what: "write",
                path: path.to_owned(),
                source,
            }
        })
    }
}

/// Reads exactly `bytes`, counting what came in `read`.
fn fill(stream: &mut impl Read, bytes: &mut [u8], read: &mut u64) -> Result<(), Error> {
    let mut done = 0;
    while done < bytes.len() {
        match stream.read(&mut bytes[done..]) {
            Ok(0) => {
                return Err(Error::Truncated {
                    bytes: *read + done as u64,
                    allowed: MerlTable::FILE_BYTES,
                });
            }
            Ok(n) => done += n,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(source) => return Err(Error::Stream { what: "read", source }),
        }
    }
    *read += done as u64;
    Ok(())
}
