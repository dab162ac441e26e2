//! A message to an address that is no daemon of ours.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;
use ureq::Agent;
use ureq::tls::TlsConfig;

use super::roots::roots;

/// Why a message was not taken.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PostError {
    /// Nobody took it: no answer, no connection, no trust.
    #[error("{address} does not answer")]
    Unreachable {
        /// Where it was sent to.
        address: String,
        /// Why.
        source: Box<ureq::Error>,
    },
    /// The authorities of this computer cannot be read.
    #[error("cannot speak https")]
    Authorities {
        /// Why.
        source: Box<crate::ClientError>,
    },
    /// It was refused.
    #[error("{address} answers {status}: {said}")]
    Refused {
        /// Where it was sent to.
        address: String,
        /// The HTTP status.
        status: u16,
        /// The first line of the answer.
        said: String,
    },
}

impl PostError {
    /// Whether it may be taken when it is sent again later.
    pub fn may_pass(&self) -> bool {
        match self {
            Self::Unreachable { .. } => true,
            Self::Authorities { .. } => false,
            Self::Refused { status, .. } => *status == 408 || *status == 429 || *status >= 500,
        }
    }
}

/// Posts a value as JSON to an address, with further headers, and takes any status below 300 for received. Blocks until it
/// is answered, or until the time is over.
///
/// # Errors
/// Nobody answers in time, or the answer is a refusal.
pub fn post_json(
    address: &str,
    headers: &BTreeMap<String, String>,
    value: &impl Serialize,
    timeout: Duration,
) -> Result<(), PostError> {
    let mut tls = TlsConfig::builder();
    if address.starts_with(super::HTTPS) {
        let authorities = roots(None).map_err(|source| PostError::Authorities {
            source: Box::new(source),
        })?;
        tls = tls.root_certs(authorities);
    }
    let config = Agent::config_builder()
        .tls_config(tls.build())
        .http_status_as_error(false)
        .max_redirects(0)
        .timeout_global(Some(timeout))
        .build();
    let unreachable = |source| PostError::Unreachable {
        address: address.to_owned(),
        source: Box::new(source),
    };
    let mut request = Agent::new_with_config(config).post(address);
    for (name, header) in headers {
        request = request.header(name, header);
    }
    let text = serde_json::to_string(value).map_err(|error| unreachable(ureq::Error::Io(error.into())))?;
    let request = request.header("content-type", "application/json");
    let mut answer = request.send(text.as_bytes()).map_err(unreachable)?;
    let status = answer.status().as_u16();
    if status < 300 {
        return Ok(());
    }
    let said = answer.body_mut().read_to_string().unwrap_or_default();
    let said = said.lines().next().unwrap_or_default();
    Err(PostError::Refused {
        address: address.to_owned(),
        status,
        said: said.chars().take(200).collect(),
    })
}
