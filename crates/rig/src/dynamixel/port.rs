//! Serial ports: which there are, and opening one for us alone.

// The one line below that makes a descriptor of a number; its reason stands there.
#![allow(unsafe_code)]

use std::os::fd::{FromRawFd, IntoRawFd};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serialport::{ErrorKind, SerialPortType, TTYPort, UsbPortInfo};

use crate::RigError;

/// Where Linux lists its ports.
const SYSFS: &str = "/sys/class/tty";

/// A serial port of this machine, with what is known of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Adapter {
    /// Path to open.
    pub path: PathBuf,
    /// What is known of a USB adapter.
    pub usb: Option<Usb>,
}

/// What a USB adapter says of itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Usb {
    /// Vendor id; 0x0403 is FTDI, whose chip is in ROBOTIS' U2D2.
    pub vendor_id: u16,
    /// Product id.
    pub product_id: u16,
    /// Manufacturer in words.
    pub manufacturer: Option<String>,
    /// Product in words.
    pub product: Option<String>,
    /// Serial number.
    pub serial_number: Option<String>,
}

impl From<UsbPortInfo> for Usb {
    fn from(usb: UsbPortInfo) -> Self {
        Self {
            vendor_id: usb.vid,
            product_id: usb.pid,
            manufacturer: usb.manufacturer,
            product: usb.product,
            serial_number: usb.serial_number,
        }
    }
}

/// The serial ports of this machine, by path.
///
/// # Errors
/// The system does not say.
pub fn ports() -> Result<Vec<Adapter>, RigError> {
    readable(Path::new(SYSFS))?;
    let ports = serialport::available_ports().map_err(|source| RigError::Ports { source })?;
    let mut adapters: Vec<_> = ports
        .into_iter()
        .map(|port| Adapter {
            path: port.port_name.into(),
            usb: match port.port_type {
                SerialPortType::UsbPort(usb) => Some(usb.into()),
                _ => None,
            },
        })
        .collect();
    adapters.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(adapters)
}

/// Whether the folder can be read in which Linux lists its ports: without one, as in a root that has no /sys, serialport
/// panics.
fn readable(folder: &Path) -> Result<(), RigError> {
    let tried = if cfg!(target_os = "linux") {
        folder.read_dir().map(drop)
    } else {
        Ok(())
    };
    tried.map_err(|error| RigError::Ports {
        source: serialport::Error::new(
            ErrorKind::Io(error.kind()),
            format!("{}: {error}", folder.display()),
        ),
    })
}

/// Opens a port in raw mode at a baud rate and locks it (TIOCEXCL and flock) until the value is dropped.
pub(crate) fn open(path: &Path, baud: u32) -> Result<TTYPort, RigError> {
    serialport::new(path.to_string_lossy(), baud)
        .open_native()
        .map_err(|source| refusal(path, source))
}

fn refusal(path: &Path, source: serialport::Error) -> RigError {
    let port = path.to_owned();
    match source.kind() {
        ErrorKind::Io(std::io::ErrorKind::NotFound) => {
            let present = ports().unwrap_or_default();
            RigError::PortMissing {
                port,
                present: present.into_iter().map(|adapter| adapter.path).collect(),
            }
        }
        ErrorKind::Io(std::io::ErrorKind::PermissionDenied) => RigError::PortDenied { port, source },
        // What serialport says where TIOCEXCL or the file lock of another program stands in the way.
        ErrorKind::NoDevice => RigError::PortLocked { port, source },
        _ => RigError::PortUnusable { port, source },
    }
}

/// Another descriptor of an open port, for `dynamixel2`. The lock stays with `port`, which must outlive it.
pub(super) fn descriptor(port: &TTYPort) -> Result<serial2::SerialPort, serialport::Error> {
    let descriptor = port.try_clone_native()?.into_raw_fd();
    // SAFETY: `into_raw_fd` has just handed over an open descriptor that nothing else owns. `serialport` offers no
    // safe way out (no `Into<OwnedFd>`), and `serial2` cannot lock a port.
    Ok(unsafe { serial2::SerialPort::from_raw_fd(descriptor) })
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_root_without_sysfs_is_told_and_not_a_panic() {
        let error = readable(Path::new("/no such folder")).unwrap_err();
        assert!(matches!(error, RigError::Ports { .. }), "{error}");
        let source = std::error::Error::source(&error).map(ToString::to_string);
        assert!(source.is_some_and(|why| why.starts_with("/no such folder: ")));
        assert!(readable(&std::env::temp_dir()).is_ok());
    }
}
