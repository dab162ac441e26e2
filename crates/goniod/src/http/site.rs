use std::collections::BTreeSet;
use std::net::{IpAddr, SocketAddr};

use axum::http::uri::Authority;
use axum::http::{HeaderMap, Uri, header};

/// Under which names this daemon is asked for.
///
/// A web page elsewhere may point a name of its own at our address (DNS rebinding) or send requests from the
/// technician's browser (CSRF). Both show in the headers Host and Origin, which a page cannot choose.
#[derive(Clone, Debug)]
pub(crate) struct Site {
    names: BTreeSet<String>,
    /// Addresses that may stand for the host; an address cannot be pointed elsewhere.
    addresses: Addresses,
}

#[derive(Clone, Copy, Debug)]
enum Addresses {
    Loopback,
    One(IpAddr),
    Any,
}

impl Site {
    /// The site of a listener, with further names that lead to it; a Unix socket has no address.
    pub(crate) fn new(address: Option<SocketAddr>, names: impl IntoIterator<Item = String>) -> Self {
        let addresses = match address.map(|address| address.ip()) {
            None => Addresses::Loopback,
            Some(ip) if ip.is_loopback() => Addresses::Loopback,
            Some(ip) if ip.is_unspecified() => Addresses::Any,
            Some(ip) => Addresses::One(ip),
        };
        let mut names: BTreeSet<String> = names.into_iter().map(|name| name.to_ascii_lowercase()).collect();
        names.insert("localhost".to_owned());
        Self { names, addresses }
    }

    /// Checks who a request is for and where it comes from; says what is wrong.
    pub(crate) fn check(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), String> {
        let hosts: Vec<_> = headers.get_all(header::HOST).iter().collect();
        let host: Authority = match (uri.authority(), hosts.as_slice()) {
            // An absolute request target outranks the header, and must not contradict it (RFC 9112, 3.2.2).
            (Some(target), [one]) if one.as_bytes() == target.as_str().as_bytes() => target.clone(),
            (None, [one]) => one
                .to_str()
                .ok()
                .and_then(|host| host.parse().ok())
                .ok_or_else(|| "the header Host is no host".to_owned())?,
            _ => return Err("exactly one header Host is needed, equal to the request's target".to_owned()),
        };
        if !self.is_ours(&host) {
            return Err(format!("this daemon is not known as {host}"));
        }
        for origin in headers.get_all(header::ORIGIN) {
            let ours = origin
                .to_str()
                .ok()
                .and_then(|origin| origin.split_once("://"))
                .is_some_and(|(scheme, of)| {
                    matches!(scheme, "http" | "https") && of.eq_ignore_ascii_case(host.as_str())
                });
            if !ours {
                let from = origin.to_str().unwrap_or("somewhere unreadable");
                return Err(format!("a page of {from} may not use this daemon"));
            }
        }
        Ok(())
    }

    fn is_ours(&self, host: &Authority) -> bool {
        if host.as_str().contains('@') {
            return false;
        }
        let name = host.host().trim_start_matches('[').trim_end_matches(']');
        if let Ok(ip) = name.parse::<IpAddr>() {
            return ip.is_loopback()
                || match self.addresses {
                    Addresses::Loopback => false,
                    Addresses::One(ours) => ip == ours,
                    Addresses::Any => true,
                };
        }
        self.names.contains(&name.to_ascii_lowercase())
    }
}

#[cfg(test)]
mod tests {
    use axum::http::{HeaderName, HeaderValue};

    use super::*;

    fn check(site: &Site, headers: &[(HeaderName, &str)]) -> bool {
        let mut map = HeaderMap::new();
        for (name, value) in headers {
            map.append(name, HeaderValue::from_str(value).unwrap());
        }
        site.check(&Uri::from_static("/api/v1/rig"), &map).is_ok()
    }

    #[test]
    fn only_our_own_names_are_hosts() {
        let local = Site::new(Some("127.0.0.1:4664".parse().unwrap()), []);
        let everywhere = Site::new(Some("0.0.0.0:4664".parse().unwrap()), ["Rig.Lab".to_owned()]);
        let one = Site::new(Some("192.0.2.7:4664".parse().unwrap()), []);
        for (host, by_local, by_everywhere, by_one) in [
            ("localhost:4664", true, true, true),
            ("LOCALHOST", true, true, true),
            ("127.0.0.1:4664", true, true, true),
            ("[::1]:4664", true, true, true),
            ("192.0.2.7:4664", false, true, true),
            ("192.0.2.8:4664", false, true, false),
            ("rig.lab:4664", false, true, false),
            ("evil.example", false, false, false),
            ("evil.example@localhost", false, false, false),
            ("localhost.evil.example", false, false, false),
            ("a b", false, false, false),
            ("", false, false, false),
        ] {
            let asked = [(header::HOST, host)];
            assert_eq!(check(&local, &asked), by_local, "local {host}");
            assert_eq!(check(&everywhere, &asked), by_everywhere, "everywhere {host}");
            assert_eq!(check(&one, &asked), by_one, "one {host}");
        }
        assert!(!check(&local, &[]));
        assert!(!check(
            &local,
            &[(header::HOST, "localhost"), (header::HOST, "localhost")]
        ));
    }

    #[test]
    fn an_origin_must_be_the_host_itself() {
        let site = Site::new(None, []);
        for (origin, allowed) in [
            ("http://localhost:4664", true),
            ("https://localhost:4664", true),
            ("http://localhost:8000", false),
            ("http://127.0.0.1:4664", false),
            ("http://evil.example", false),
            ("ftp://localhost:4664", false),
            ("null", false),
        ] {
            let headers = [(header::HOST, "localhost:4664"), (header::ORIGIN, origin)];
            assert_eq!(check(&site, &headers), allowed, "{origin}");
        }
    }
}
