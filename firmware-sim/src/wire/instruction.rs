use super::packet::{BROADCAST, Packet, STATUS};
use crate::Refusal;

/// Part of a control table that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Read {
    pub(crate) id: u8,
    pub(crate) address: u16,
    pub(crate) length: u16,
}

/// Bytes for a control table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Write<'a> {
    pub(crate) id: u8,
    pub(crate) address: u16,
    pub(crate) bytes: &'a [u8],
}

/// What a packet asks for (e-manual, Protocol 2.0, "Instruction Details"). Sync and bulk come to the same thing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Instruction<'a> {
    Ping,
    Read(Read),
    Write(Write<'a>),
    RegWrite(Write<'a>),
    Action,
    FactoryReset(u8),
    Reboot,
    Clear(&'a [u8]),
    BackUp(&'a [u8]),
    Reads(Vec<Read>),
    FastReads(Vec<Read>),
    Writes(Vec<Write<'a>>),
}

impl<'a> Instruction<'a> {
    /// Reads the parameters; `None` for what is not an instruction at all.
    ///
    /// # Errors
    /// Instructions that are not known or may not be addressed so, parameters of the wrong length.
    pub(crate) fn decode(packet: &'a Packet) -> Option<Result<Self, Refusal>> {
        let params = packet.params.as_slice();
        let for_all = packet.id == BROADCAST;
        Some(match packet.instruction {
            STATUS => return None,
            0x01 => empty(params, Self::Ping),
            0x02 => one_read(packet.id, params).map(Self::Read),
            0x03 => one_write(packet.id, params).map(Self::Write),
            0x04 => one_write(packet.id, params).map(Self::RegWrite),
            0x05 => empty(params, Self::Action),
            0x06 => match params {
                // Refused since firmware 42: it would leave every device at the same id.
                [0xFF] if for_all => Err(Refusal::Instruction),
                [option] => Ok(Self::FactoryReset(*option)),
                _ => Err(Refusal::DataLength),
            },
            0x08 => empty(params, Self::Reboot),
            0x10 => Ok(Self::Clear(params)),
            0x20 => Ok(Self::BackUp(params)),
            0x82 if for_all => sync_reads(params).map(Self::Reads),
            0x83 if for_all => sync_writes(params).map(Self::Writes),
            0x8A if for_all => sync_reads(params).map(Self::FastReads),
            0x92 if for_all => bulk_reads(params).map(Self::Reads),
            0x93 if for_all => bulk_writes(params).map(Self::Writes),
            0x9A if for_all => bulk_reads(params).map(Self::FastReads),
            _ => Err(Refusal::Instruction),
        })
    }
}

/// What a packet writes, by any kind of write.
pub(super) fn writes(packet: &Packet) -> Vec<Write<'_>> {
    match Instruction::decode(packet) {
        Some(Ok(Instruction::Write(write) | Instruction::RegWrite(write))) => vec![write],
        Some(Ok(Instruction::Writes(writes))) => writes,
        _ => Vec::new(),
    }
}

fn empty<'a>(params: &[u8], instruction: Instruction<'a>) -> Result<Instruction<'a>, Refusal> {
    if params.is_empty() {
        Ok(instruction)
    } else {
        Err(Refusal::DataLength)
    }
}

fn one_read(id: u8, params: &[u8]) -> Result<Read, Refusal> {
    match *params {
        [a, b, c, d] => Ok(Read {
            id,
            address: u16::from_le_bytes([a, b]),
            length: u16::from_le_bytes([c, d]),
        }),
        _ => Err(Refusal::DataLength),
    }
}

fn one_write(id: u8, params: &[u8]) -> Result<Write<'_>, Refusal> {
    match params {
        [a, b, bytes @ ..] if !bytes.is_empty() => Ok(Write {
            id,
            address: u16::from_le_bytes([*a, *b]),
            bytes,
        }),
        _ => Err(Refusal::DataLength),
    }
}

fn sync_reads(params: &[u8]) -> Result<Vec<Read>, Refusal> {
    let (range, ids) = params.split_first_chunk::<4>().ok_or(Refusal::DataLength)?;
    ids.iter().map(|&id| one_read(id, range)).collect()
}

fn bulk_reads(params: &[u8]) -> Result<Vec<Read>, Refusal> {
    let (entries, []) = params.as_chunks::<5>() else {
        return Err(Refusal::DataLength);
    };
    entries
        .iter()
        .map(|entry| one_read(entry[0], &entry[1..]))
        .collect()
}

fn sync_writes(params: &[u8]) -> Result<Vec<Write<'_>>, Refusal> {
    let ([a, b, c, d], entries) = params.split_first_chunk::<4>().ok_or(Refusal::DataLength)?;
    let (address, length) = (u16::from_le_bytes([*a, *b]), u16::from_le_bytes([*c, *d]));
    let stride = usize::from(length) + 1;
    if length == 0 || !entries.len().is_multiple_of(stride) {
        return Err(Refusal::DataLength);
    }
    Ok(entries
        .chunks_exact(stride)
        .map(|entry| Write {
            id: entry[0],
            address,
            bytes: &entry[1..],
        })
        .collect())
}

fn bulk_writes(mut params: &[u8]) -> Result<Vec<Write<'_>>, Refusal> {
    let mut writes = Vec::new();
    while !params.is_empty() {
        let (&[id, a, b, c, d], rest) = params.split_first_chunk::<5>().ok_or(Refusal::DataLength)?;
        let length = usize::from(u16::from_le_bytes([c, d]));
        let (bytes, rest) = rest.split_at_checked(length).ok_or(Refusal::DataLength)?;
        writes.push(Write {
            id,
            address: u16::from_le_bytes([a, b]),
            bytes,
        });
        params = rest;
    }
    Ok(writes)
}
