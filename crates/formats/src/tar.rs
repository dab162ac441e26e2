//! Plain tar archives (POSIX.1-1988, ustar): several files as one.

use crate::{Error, Place};

/// Size of a block, bytes.
const BLOCK: usize = 512;

/// An archive of files, by name and content, readable by everybody.
pub(crate) fn archive(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (name, content) in files {
        let mut header = [0_u8; BLOCK];
        let mut put = |at: usize, text: &[u8]| header[at..at + text.len()].copy_from_slice(text);
        put(0, &name.as_bytes()[..name.len().min(100)]);
        put(100, b"0000644\0");
        put(108, b"0000000\0");
        put(116, b"0000000\0");
        put(124, format!("{:011o}\0", content.len()).as_bytes());
        put(136, b"00000000000\0");
        put(148, b"        ");
        put(156, b"0");
        put(257, b"ustar\x0000");
        let sum: u32 = header.iter().map(|&byte| u32::from(byte)).sum();
        header[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
        bytes.extend(header);
        bytes.extend(content);
        bytes.resize(bytes.len().next_multiple_of(BLOCK), 0);
    }
    bytes.resize(bytes.len() + 2 * BLOCK, 0);
    bytes
}

/// The files of an archive by name and content; an error, after which there is no more, where it is none.
pub(crate) fn members(bytes: &[u8]) -> impl Iterator<Item = Result<(String, &[u8]), Error>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let rest = bytes
            .get(at..)
            .filter(|rest| rest.len() >= BLOCK && rest[0] != 0)?;
        let member = member(rest).map_err(|(found, allowed)| {
            let place = Place::Byte(at as u64);
            Error::malformed(place, found, allowed)
        });
        at = match &member {
            Ok((_, content)) => at + BLOCK + content.len().next_multiple_of(BLOCK),
            Err(_) => bytes.len(),
        };
        Some(member)
    })
}

/// The file with which some bytes, at least a block, begin; else what stands there and what is allowed.
fn member(bytes: &[u8]) -> Result<(String, &[u8]), (String, &'static str)> {
    let (header, rest) = bytes.split_at(BLOCK);
    if &header[257..262] != b"ustar" {
        return Err(("no file header".to_owned(), "\"ustar\" at byte 257 of a header"));
    }
    let digits = header[124..136]
        .iter()
        .map_while(|byte| char::from(*byte).to_digit(8));
    let size = digits.fold(0_usize, |size, digit| {
        size.saturating_mul(8).saturating_add(digit as usize)
    });
    let content = rest
        .get(..size)
        .ok_or_else(|| (format!("a file of {size} bytes"), "a file within the archive"))?;
    let name = header[..100].split(|&byte| byte == 0).next().unwrap_or_default();
    Ok((crate::text::shortened(&String::from_utf8_lossy(name)), content))
}
