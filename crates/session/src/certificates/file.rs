//! A certificate as a file: its JSON with a digest of its content.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use rig::Certificate;
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use super::Stored;
use crate::SessionError;

/// The key of the digest, beside those of the certificate.
const DIGEST: &str = "sha256";

/// Writes a certificate with the digest of its content.
pub(super) fn write(certificate: &Certificate, mut out: impl Write) -> io::Result<()> {
    let mut content = content(certificate)?;
    // Of what a reader will read: a number may have lost its last digit on the way into the text.
    let text = serde_json::to_string(&content)?;
    let read: Map<String, Value> = serde_json::from_str(&text)?;
    content.insert(DIGEST.to_owned(), digest(&read).into());
    serde_json::to_writer_pretty(&mut out, &content)?;
    out.write_all(b"\n")
}

/// Reads a certificate and compares it with its digest, where it has one.
///
/// # Errors
/// A file that cannot be read, is no certificate, or is not as it was written.
pub(super) fn read(path: PathBuf) -> Result<Stored, SessionError> {
    let refuse = |why: String| refused(&path, why);
    let bytes = std::fs::read(&path).map_err(|source| SessionError::Read {
        what: "calibration",
        path: path.clone(),
        source,
    })?;
    let mut content: Map<String, Value> = serde_json::from_slice(&bytes).map_err(|error| {
        refuse(format!(
            "it is no JSON object ({error}); the file is damaged or was edited"
        ))
    })?;
    let said = content.remove(DIGEST);
    let found = digest(&content);
    if said.as_ref().is_some_and(|said| said.as_str() != Some(&found)) {
        return Err(refuse(
            "its content is not the one of its digest (sha256): it was edited or damaged".to_owned(),
        ));
    }
    let certificate: Certificate =
        serde_path_to_error::deserialize(Value::Object(content.clone())).map_err(|error| {
            let key = error.path().to_string();
            refuse(format!("{key}: {}", error.into_inner()))
        })?;
    if said.is_none() && certificate.number != 0 {
        return Err(refuse(format!(
            "it has a number, {}, and no digest (sha256): it was edited or damaged",
            certificate.number
        )));
    }
    if let Some(key) = surplus(
        "",
        &Value::Object(content),
        &Value::Object(content_of(&certificate, &path)?),
    ) {
        return Err(refuse(format!("unknown key {key}")));
    }
    Ok(Stored {
        path,
        certificate,
        sealed: said.is_some(),
    })
}

/// The error of a certificate's file, with what can be done about it.
pub(super) fn refused(path: &Path, why: impl Into<String>) -> SessionError {
    SessionError::Certificate {
        path: path.to_owned(),
        why: why.into(),
    }
}

fn content(certificate: &Certificate) -> io::Result<Map<String, Value>> {
    match serde_json::to_value(certificate)? {
        Value::Object(content) => Ok(content),
        _ => Err(io::Error::other("a certificate is no JSON object")),
    }
}

fn content_of(certificate: &Certificate, path: &Path) -> Result<Map<String, Value>, SessionError> {
    content(certificate).map_err(|source| SessionError::Read {
        what: "calibration",
        path: path.to_owned(),
        source,
    })
}

/// The first key that something has and its pattern has not.
fn surplus(at: &str, found: &Value, pattern: &Value) -> Option<String> {
    match (found, pattern) {
        (Value::Object(found), Value::Object(pattern)) => found.iter().find_map(|(key, value)| {
            let path = match at {
                "" => key.clone(),
                at => format!("{at}.{key}"),
            };
            match pattern.get(key) {
                Some(pattern) => surplus(&path, value, pattern),
                // What is not there and what is null are the same.
                None => (!value.is_null()).then_some(path),
            }
        }),
        (Value::Array(found), Value::Array(pattern)) => {
            let mut pairs = found.iter().zip(pattern).enumerate();
            pairs.find_map(|(i, (found, pattern))| surplus(&format!("{at}[{i}]"), found, pattern))
        }
        _ => None,
    }
}

/// SHA-256, hexadecimal, of an object in one form: keys in their order, no spaces.
fn digest(content: &Map<String, Value>) -> String {
    let mut text = String::new();
    canonical(&Value::Object(content.clone()), &mut text);
    let hash = Sha256::digest(text.as_bytes());
    hash.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Whether a JSON library keeps the order of keys depends on who else uses it; here they are sorted.
fn canonical(value: &Value, out: &mut String) {
    match value {
        Value::Object(map) => {
            let mut keys: Vec<&String> = map.keys().collect();
            keys.sort();
            out.push('{');
            for key in keys {
                out.push_str(&Value::from(key.as_str()).to_string());
                out.push(':');
                canonical(&map[key], out);
                out.push(',');
            }
            out.push('}');
        }
        Value::Array(items) => {
            out.push('[');
            for item in items {
                canonical(item, out);
                out.push(',');
            }
            out.push(']');
        }
        leaf => out.push_str(&leaf.to_string()),
    }
}
