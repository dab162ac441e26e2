use std::fs::File;
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::Path;
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};

use crate::file::CONNECTION;

/// Longest answer that is taken: an instrument that floods is a fault.
const LONGEST: usize = 4096;

/// A connection with an instrument.
#[derive(Debug)]
pub(super) enum Transport {
    Tcp(TcpStream),
    Serial(TTYPort),
    /// /dev/usbtmcN: a message is a write, an answer is a read; the kernel's driver has a time limit of its own.
    Usbtmc(File),
}

impl Transport {
    /// Connects; sends nothing.
    pub(super) fn open(address: &str, baud: u32) -> io::Result<Self> {
        if let Some(host) = address.strip_prefix("tcp:") {
            let mut last = io::Error::new(io::ErrorKind::NotFound, "no such host");
            for socket in host.to_socket_addrs()? {
                match TcpStream::connect_timeout(&socket, CONNECTION) {
                    Ok(stream) => {
                        stream.set_nodelay(true)?;
                        return Ok(Self::Tcp(stream));
                    }
                    Err(error) => last = error,
                }
            }
            return Err(last);
        }
        if address.starts_with("/dev/usbtmc") {
            let file = File::options().read(true).write(true).open(address)?;
            return Ok(Self::Usbtmc(file));
        }
        let port = crate::dynamixel::open_port(Path::new(address), baud).map_err(io::Error::other)?;
        Ok(Self::Serial(port))
    }

    /// Sends a line.
    pub(super) fn send(&mut self, line: &str) -> io::Result<()> {
        let bytes = format!("{line}\n").into_bytes();
        match self {
            Self::Tcp(stream) => {
                stream.set_write_timeout(Some(CONNECTION))?;
                stream.write_all(&bytes)
            }
            Self::Serial(port) => port.write_all(&bytes),
            Self::Usbtmc(file) => file.write_all(&bytes),
        }
    }

    /// Reads a line within a time, without what ends it.
    pub(super) fn receive(&mut self, within: Duration) -> io::Result<String> {
        let until = Instant::now() + within;
        let mut line = Vec::new();
        let mut buffer = [0; 512];
        loop {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(io::ErrorKind::TimedOut.into());
            }
            let read = match self {
                Self::Tcp(stream) => {
                    stream.set_read_timeout(Some(left))?;
                    stream.read(&mut buffer)
                }
                Self::Serial(port) => {
                    port.set_timeout(left).map_err(io::Error::other)?;
                    port.read(&mut buffer)
                }
                Self::Usbtmc(file) => file.read(&mut buffer),
            };
            let read = match read {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(read) => read,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    return Err(io::ErrorKind::TimedOut.into());
                }
                Err(error) => return Err(error),
            };
            line.extend_from_slice(&buffer[..read]);
            // What follows the first line was not asked for: an answer to an older question, or a flood.
            if let Some(end) = line.iter().position(|&byte| byte == b'\n') {
                if line[end + 1..].iter().any(|byte| !byte.is_ascii_whitespace()) {
                    return Err(io::Error::new(io::ErrorKind::InvalidData, "more than one answer"));
                }
                line.truncate(end);
                let text = String::from_utf8_lossy(&line).trim().to_owned();
                return Ok(text);
            }
            if line.len() > LONGEST {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    "an answer of more than 4096 bytes",
                ));
            }
        }
    }
}
