use std::io;
use std::path::Path;

use crate::TextError;

/// The mark with which some editors begin UTF-8.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// Reads a file of text.
///
/// # Errors
/// It cannot be read; or it is no UTF-8, as [`io::ErrorKind::InvalidData`] with a [`TextError`], which names the
/// encoding that it seems to be in.
pub fn read_text(path: &Path) -> io::Result<String> {
    decode(std::fs::read(path)?).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

/// Makes a text of bytes in UTF-8, with or without a byte order mark, which is taken off.
///
/// # Errors
/// It is no UTF-8, or has zero bytes; the error names the encoding that it seems to be in.
pub fn decode(bytes: Vec<u8>) -> Result<String, TextError> {
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err(TextError::Utf16);
    }
    if let Some(at) = bytes.iter().position(|&byte| byte == 0) {
        // Without a mark, every other byte of plain letters is zero in UTF-16.
        let zeros = bytes.iter().filter(|&&byte| byte == 0).count();
        return Err(match 3 * zeros >= bytes.len() {
            true => TextError::Utf16,
            false => TextError::Binary {
                line: line(&bytes, at),
            },
        });
    }
    let mut text = String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        TextError::Latin1 {
            line: line(error.as_bytes(), at),
            byte: error.as_bytes()[at],
        }
    })?;
    if text.starts_with(BYTE_ORDER_MARK) {
        text.drain(..BYTE_ORDER_MARK.len_utf8());
    }
    Ok(text)
}

/// Line of a byte, from 1.
fn line(bytes: &[u8], at: usize) -> usize {
    bytes[..at].iter().filter(|&&byte| byte == b'\n').count() + 1
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A job file as people in Europe write it.
    const TEXT: &str = "# Größe\nspecimen = \"Gold, geprüft\"\n";

    fn utf16(text: &str, little: bool) -> Vec<u8> {
        let bytes = |unit: u16| match little {
            true => unit.to_le_bytes(),
            false => unit.to_be_bytes(),
        };
        text.encode_utf16().flat_map(bytes).collect()
    }

    #[test]
    fn utf_16_is_recognised_with_and_without_a_mark() {
        for little in [true, false] {
            assert_eq!(decode(utf16(TEXT, little)), Err(TextError::Utf16));
            let marked = format!("{BYTE_ORDER_MARK}{TEXT}");
            assert_eq!(decode(utf16(&marked, little)), Err(TextError::Utf16));
        }
    }

    #[test]
    fn latin_1_is_recognised_and_the_line_is_named() {
        let bytes: Vec<u8> = "ok = 1\n# Größe\n".chars().map(|c| c as u8).collect();
        let error = decode(bytes).unwrap_err();
        assert_eq!(error, TextError::Latin1 { line: 2, byte: 0xF6 });
        assert!(error.to_string().contains("Latin-1"), "{error}");
    }

    #[test]
    fn a_zero_byte_is_no_text() {
        assert_eq!(
            decode(b"a = 1\nb = \"\0\"".to_vec()),
            Err(TextError::Binary { line: 2 })
        );
    }

    proptest! {
        #[test]
        fn prop_utf_8_is_taken_as_it_is(text in "[^\0\u{feff}][^\0]*") {
            prop_assert_eq!(decode(text.clone().into_bytes()), Ok(text.clone()));
            let marked = format!("{BYTE_ORDER_MARK}{text}");
            prop_assert_eq!(decode(marked.into_bytes()), Ok(text));
        }

        #[test]
        fn prop_no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..64)) {
            let _ = decode(bytes);
        }
    }
}
