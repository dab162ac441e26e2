//! Serial ports: which there are, and opening one for us alone.

// The one line below that makes a descriptor of a number; its reason stands there.
#![allow(unsafe_code)]

use std::os::fd::{FromRawFd, IntoRawFd};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serialport::{ErrorKind, SerialPortType, TTYPort, UsbPortInfo};

use crate::RigError;

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

/// Opens a port in raw mode at a baud rate and locks it (TIOCEXCL and flock) until the value is dropped.
pub(super) fn open(path: &Path, baud: u32) -> Result<TTYPort, RigError> {
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
