use std::borrow::Cow;

use crate::{Error, Place};

/// The first twelve bytes of a tensor file.
pub(crate) const MAGIC: &[u8] = b"tensor_file\0";
/// Most fields of a file; those of RGL have eleven or twelve.
const MOST_FIELDS: u32 = 1024;
/// Most dimensions of a field.
const MOST_DIMENSIONS: u16 = 8;
/// Code and size in bytes of each type of number.
const TYPES: [(u8, usize); 11] = [
    (1, 1),
    (2, 1),
    (3, 2),
    (4, 2),
    (5, 4),
    (6, 4),
    (7, 8),
    (8, 8),
    (9, 2),
    (10, 4),
    (11, 8),
];

/// The type of a field's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    U8,
    U32,
    F32,
    Other(u8),
}

impl Kind {
    fn code(self) -> u8 {
        match self {
            Self::U8 => 1,
            Self::U32 => 5,
            Self::F32 => 10,
            Self::Other(code) => code,
        }
    }

    fn of(code: u8) -> Self {
        match code {
            1 => Self::U8,
            5 => Self::U32,
            10 => Self::F32,
            other => Self::Other(other),
        }
    }
}

/// A named array of a tensor file.
pub(crate) struct Field<'a> {
    pub(crate) name: &'a [u8],
    pub(crate) kind: Kind,
    pub(crate) shape: Vec<usize>,
    pub(crate) data: Cow<'a, [u8]>,
}

impl Field<'static> {
    /// A field of 32-bit floating-point numbers.
    pub(crate) fn floats(name: &'static str, shape: &[usize], values: impl IntoIterator<Item = f64>) -> Self {
        let bytes = values.into_iter().flat_map(|value| (value as f32).to_le_bytes());
        Self {
            name: name.as_bytes(),
            kind: Kind::F32,
            shape: shape.to_vec(),
            data: bytes.collect(),
        }
    }

    /// A field of bytes.
    pub(crate) fn bytes(name: &'static str, bytes: Vec<u8>) -> Self {
        Self {
            name: name.as_bytes(),
            kind: Kind::U8,
            shape: vec![bytes.len()],
            data: bytes.into(),
        }
    }
}

/// A tensor file: named arrays, in the order of the file.
pub(crate) struct Tensor<'a>(pub(crate) Vec<Field<'a>>);

impl<'a> Tensor<'a> {
    /// The bytes of the file, every array at a multiple of eight bytes.
    pub(crate) fn write(&self) -> Vec<u8> {
        let header: usize = self
            .0
            .iter()
            .map(|field| 2 + field.name.len() + 2 + 1 + 8 + 8 * field.shape.len())
            .sum();
        let mut bytes = MAGIC.to_vec();
        bytes.extend([1, 0]);
        bytes.extend((self.0.len() as u32).to_le_bytes());
        let mut at = (bytes.len() + header).next_multiple_of(8);
        for field in &self.0 {
            bytes.extend((field.name.len() as u16).to_le_bytes());
            bytes.extend(field.name);
            bytes.extend((field.shape.len() as u16).to_le_bytes());
            bytes.push(field.kind.code());
            bytes.extend((at as u64).to_le_bytes());
            for &n in &field.shape {
                bytes.extend((n as u64).to_le_bytes());
            }
            at = (at + field.data.len()).next_multiple_of(8);
        }
        for field in &self.0 {
            bytes.resize(bytes.len().next_multiple_of(8), 0);
            bytes.extend(field.data.iter());
        }
        bytes
    }

    /// Finds the arrays in the bytes of a file; nothing is copied.
    ///
    /// # Errors
    /// It is no tensor file of version 1.0, or an array lies outside of the file.
    pub(crate) fn read(bytes: &'a [u8]) -> Result<Self, Error> {
        let mut cursor = Cursor { bytes, at: 0 };
        if cursor.take(MAGIC.len())? != MAGIC {
            return Err(Error::malformed(
                Place::Byte(0),
                "another signature",
                "\"tensor_file\" and a zero byte",
            ));
        }
        let version = cursor.take(2)?;
        if version != [1, 0] {
            let found = format!("version {}.{}", version[0], version[1]);
            return Err(Error::malformed(Place::Byte(12), found, "version 1.0"));
        }
        let count = u32::from_le_bytes(cursor.array()?);
        if count > MOST_FIELDS {
            return Err(Error::malformed(
                Place::Byte(14),
                format!("{count} fields"),
                format!("at most {MOST_FIELDS}"),
            ));
        }
        let fields = (0..count).map(|_| cursor.field()).collect::<Result<_, _>>()?;
        Ok(Self(fields))
    }

    /// Whether there is a field of that name.
    pub(crate) fn has(&self, name: &[u8]) -> bool {
        self.0.iter().any(|field| field.name == name)
    }

    /// A field of 32-bit numbers with as many dimensions as asked for: its shape and its values.
    ///
    /// # Errors
    /// There is none, or it is of another type or shape, or empty, or a value is no finite number.
    pub(crate) fn floats<const N: usize>(&self, name: &str) -> Result<([usize; N], Vec<f64>), Error> {
        let place = || Place::Field(name.into());
        let allowed = || format!("an array of f32 with {N} dimensions, none of them 0");
        let Some(field) = self.0.iter().find(|field| field.name == name.as_bytes()) else {
            return Err(Error::malformed(place(), "no such field", allowed()));
        };
        let shape = <[usize; N]>::try_from(field.shape.as_slice()).ok();
        let Some(shape) = shape.filter(|shape| field.kind == Kind::F32 && !shape.contains(&0)) else {
            let found = format!("type {} and shape {:?}", field.kind.code(), field.shape);
            return Err(Error::malformed(place(), found, allowed()));
        };
        let words = field.data.as_chunks::<4>().0;
        let values: Vec<f64> = words
            .iter()
            .map(|word| f64::from(f32::from_le_bytes(*word)))
            .collect();
        match values.iter().position(|value| !value.is_finite()) {
            None => Ok((shape, values)),
            Some(at) => {
                let found = format!("{} as number {at}", values[at]);
                Err(Error::malformed(place(), found, "finite numbers"))
            }
        }
    }
}

/// A place in bytes that are read one after the other.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], Error> {
        let end = self.at.checked_add(count);
        let Some(taken) = end.and_then(|end| self.bytes.get(self.at..end)) else {
            let found = "the end of the file";
            return Err(Error::malformed(
                Place::Byte(self.bytes.len() as u64),
                found,
                "the rest of the list of fields",
            ));
        };
        self.at += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Error> {
        let taken = self.take(N)?;
        Ok(taken.try_into().expect("as many bytes as were asked for"))
    }

    /// A field of the list, with its array, which may lie anywhere in the bytes.
    fn field(&mut self) -> Result<Field<'a>, Error> {
        let length = usize::from(u16::from_le_bytes(self.array()?));
        let name = self.take(length)?;
        let here = self.at as u64;
        let dimensions = u16::from_le_bytes(self.array()?);
        let code = self.take(1)?[0];
        let start = u64::from_le_bytes(self.array()?);
        if dimensions > MOST_DIMENSIONS {
            let found = format!("{dimensions} dimensions");
            return Err(Error::malformed(
                Place::Byte(here),
                found,
                format!("at most {MOST_DIMENSIONS}"),
            ));
        }
        let Some((_, size)) = TYPES.into_iter().find(|(known, _)| *known == code) else {
            return Err(Error::malformed(
                Place::Byte(here + 2),
                format!("type {code}"),
                "types 1 … 11",
            ));
        };
        let mut shape = Vec::new();
        let mut length = Some(size);
        for _ in 0..dimensions {
            let n = usize::try_from(u64::from_le_bytes(self.array()?)).ok();
            length = length.zip(n).and_then(|(length, n)| length.checked_mul(n));
            shape.push(n.unwrap_or(usize::MAX));
        }
        let start = usize::try_from(start).ok();
        let end = start
            .zip(length)
            .and_then(|(start, length)| start.checked_add(length));
        let Some(data) = start.zip(end).and_then(|(start, end)| self.bytes.get(start..end)) else {
            let found = format!(
                "an array of shape {shape:?} at byte {}",
                start.unwrap_or(usize::MAX)
            );
            let allowed = format!("arrays within the {} bytes of the file", self.bytes.len());
            return Err(Error::malformed(Place::Byte(here), found, allowed));
        };
        Ok(Field {
            name,
            kind: Kind::of(code),
            shape,
            data: data.into(),
        })
    }
}
