use std::io;
use std::path::Path;

use crate::ClientError;
use ureq::tls::{Certificate, PemItem, RootCerts, parse_pem};

/// Returns the authorities whose word is taken for who a daemon behind https is: those in a file of certificates alone;
/// without a file those of this computer, and where it has none, those of Mozilla.
///
/// # Errors
/// A file that cannot be read or holds no certificate.
pub(super) fn roots(file: Option<&Path>) -> Result<RootCerts, ClientError> {
    let Some(file) = file else {
        let found = rustls_native_certs::load_native_certs().certs;
        let certificates: Vec<_> = found
            .iter()
            .map(|certificate| Certificate::from_der(certificate).to_owned())
            .collect();
        return Ok(match certificates.as_slice() {
            [] => RootCerts::WebPki,
            some => RootCerts::new_with_certs(some),
        });
    };
    let failed = |source| ClientError::Authorities {
        path: file.to_owned(),
        source,
    };
    let text = std::fs::read(file).map_err(failed)?;
    let mut certificates = Vec::new();
    for item in parse_pem(&text) {
        // A file may hold a key beside them.
        if let PemItem::Certificate(certificate) = item.map_err(io::Error::other).map_err(failed)? {
            certificates.push(certificate);
        }
    }
    if certificates.is_empty() {
        let why = "it holds no certificate; allowed are those of one or more authorities in PEM";
        return Err(failed(io::Error::new(io::ErrorKind::InvalidData, why)));
    }
    Ok(RootCerts::new_with_certs(&certificates))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_without_certificates_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ca.pem");
        assert!(roots(Some(&path)).is_err());
        for text in [
            "",
            "no PEM",
            "-----BEGIN CERTIFICATE-----\n!\n-----END CERTIFICATE-----\n",
        ] {
            std::fs::write(&path, text).unwrap();
            assert!(roots(Some(&path)).is_err(), "{text}");
        }
        assert!(roots(None).is_ok());
    }
}
