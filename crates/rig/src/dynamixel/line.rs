use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use dynamixel2::{Bus, ReadError, WriteError};
use serialport::TTYPort;

use super::port;
use crate::{BusSettings, RigError};

/// Longest return delay that a device can be set to (e-manual, "Return Delay Time(9)").
const RETURN_DELAY_MAX: Duration = Duration::from_micros(508);

/// What a busy host may add to a reply time; the price of a lost reply, so not more than needed.
const HOST_MARGIN: Duration = Duration::from_millis(10);

/// Bytes of an instruction packet besides its parameters: header 4, id, length 2, instruction, CRC 2.
const INSTRUCTION_OVERHEAD: usize = 10;

/// Bytes of a status packet besides its parameters: those of an instruction and the error byte.
const STATUS_OVERHEAD: usize = 11;

/// Bytes of the packet buffers: several times the longest packet that is sent or asked for.
const BUFFER: usize = 256;

/// One transaction: a packet and the status packets that must follow, in their order.
#[derive(Debug)]
pub(super) struct Request {
    /// Id that is addressed, 254 for all.
    pub(super) id: u8,
    /// Instruction (Protocol 2.0).
    pub(super) instruction: u8,
    /// Its parameters.
    pub(super) parameters: Vec<u8>,
    /// Id and parameter count of each reply.
    pub(super) replies: Vec<(u8, usize)>,
}

/// A good status packet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Reply {
    /// The device has a hardware error.
    pub(super) alert: bool,
    /// As many as were asked for.
    pub(super) parameters: Vec<u8>,
}

/// Why a transaction failed, with the id that should have answered.
#[derive(Debug)]
pub(super) struct Failure {
    pub(super) id: u8,
    pub(super) cause: Cause,
}

#[derive(Debug)]
pub(super) enum Cause {
    /// Nothing came in time.
    Silence,
    /// What came is no reply to this request.
    Damage(String),
    /// A status packet with this error number.
    Refusal(u8),
    /// The port is gone.
    Gone(io::Error),
}

/// The port, locked, with `dynamixel2` on it. Owned by one thread; one transaction at a time.
pub(super) struct Line {
    // Declared first, so that it is closed before the lock is given up.
    bus: Bus<Vec<u8>, Vec<u8>>,
    echo: Option<serial2::SerialPort>,
    lock: TTYPort,
    path: PathBuf,
    settings: BusSettings,
    /// After a failure nothing is sent before this, so that a late reply is not taken for the next one.
    quiet_until: Option<Instant>,
}

impl Line {
    pub(super) fn open(path: &Path, settings: &BusSettings) -> Result<Self, RigError> {
        let lock = port::open(path, settings.baud)?;
        let unusable = |source| RigError::PortUnusable {
            port: path.to_owned(),
            source,
        };
        Ok(Self {
            bus: bus(&lock).map_err(unusable)?,
            echo: echo(&lock, settings).map_err(unusable)?,
            lock,
            path: path.to_owned(),
            settings: settings.clone(),
            quiet_until: None,
        })
    }

    /// Sends a packet and collects its replies.
    ///
    /// `dynamixel2` 0.9.1 panics on a reply that claims to be shorter than a status packet can be; such a reply is
    /// damage like any other, and the crate's state is made anew.
    pub(super) fn transact(&mut self, request: &Request) -> Result<Vec<Reply>, Failure> {
        if let Some(quiet) = self.quiet_until.take() {
            std::thread::sleep(quiet.saturating_duration_since(Instant::now()));
        }
        let first = request.replies.first().map_or(request.id, |&(id, _)| id);
        let result = catch_unwind(AssertUnwindSafe(|| self.attempt(request))).unwrap_or_else(|_| {
            let cause = match bus(&self.lock) {
                Ok(bus) => {
                    self.bus = bus;
                    Cause::Damage("it has an impossible length".to_owned())
                }
                Err(error) => Cause::Gone(error.into()),
            };
            Err(Failure { id: first, cause })
        });
        if let Err(Failure { id, cause }) = &result {
            tracing::debug!(id, ?cause, port = %self.path.display(), "transaction failed");
            if !matches!(cause, Cause::Refusal(_)) {
                self.quiet_until = Some(Instant::now() + self.reply_time(0, request));
            }
        }
        result
    }

    fn attempt(&mut self, request: &Request) -> Result<Vec<Reply>, Failure> {
        let fail = |id: u8, cause: Cause| Failure { id, cause };
        let parameters = &request.parameters;
        // Also throws away whatever lies in the input buffers.
        self.bus
            .write_instruction(request.id, request.instruction, parameters.len(), |buffer| {
                buffer.copy_from_slice(parameters);
            })
            .map_err(|error| fail(request.id, write_cause(error)))?;
        let sent = INSTRUCTION_OVERHEAD + parameters.len() + stuffing(parameters);
        let deadline = Instant::now() + self.reply_time(sent, request);
        if let Some(echo) = &mut self.echo {
            skip_echo(echo, sent, deadline).map_err(|error| fail(request.id, io_cause(error)))?;
        }
        let mut replies = Vec::with_capacity(request.replies.len());
        for &(id, count) in &request.replies {
            let status = self
                .bus
                .read_status_response_deadline(deadline)
                .map_err(|error| fail(id, read_cause(error)))?;
            if status.packet_id() != id {
                let cause = Cause::Damage(format!("id {} answered instead", status.packet_id()));
                return Err(fail(id, cause));
            }
            if status.parameters().len() != count {
                let found = status.parameters().len();
                return Err(fail(
                    id,
                    Cause::Damage(format!("it has {found} bytes instead of {count}")),
                ));
            }
            replies.push(Reply {
                alert: status.alert(),
                parameters: status.parameters().to_owned(),
            });
        }
        Ok(replies)
    }

    /// Longest time until all replies are there: bytes both ways, return delays, adapter, host.
    fn reply_time(&self, sent: usize, request: &Request) -> Duration {
        let received: usize = request.replies.iter().map(|(_, n)| STATUS_OVERHEAD + n).sum();
        let bytes = (sent + received) as f64;
        // 8 bits, start and stop bit.
        let wire = Duration::from_secs_f64(bytes * 10.0 / f64::from(self.settings.baud));
        wire + RETURN_DELAY_MAX * request.replies.len() as u32 + self.settings.latency + HOST_MARGIN
    }
}

fn bus(lock: &TTYPort) -> Result<Bus<Vec<u8>, Vec<u8>>, serialport::Error> {
    Bus::with_buffers(port::descriptor(lock)?, vec![0; BUFFER], vec![0; BUFFER])
        .map_err(|error| serialport::Error::new(serialport::ErrorKind::Unknown, error.to_string()))
}

fn echo(lock: &TTYPort, settings: &BusSettings) -> Result<Option<serial2::SerialPort>, serialport::Error> {
    settings.echo.then(|| port::descriptor(lock)).transpose()
}

/// Takes what was sent out of the input; `dynamixel2` would take it for a reply.
fn skip_echo(port: &mut serial2::SerialPort, mut left: usize, deadline: Instant) -> io::Result<()> {
    let mut buffer = [0; BUFFER];
    while left > 0 {
        port.set_read_timeout(deadline.saturating_duration_since(Instant::now()))?;
        match port.read(&mut buffer[..left.min(BUFFER)])? {
            0 => return Err(io::ErrorKind::TimedOut.into()),
            n => left -= n,
        }
    }
    Ok(())
}

/// Bytes that stuffing adds (e-manual, Protocol 2.0, "Byte Stuffing").
fn stuffing(parameters: &[u8]) -> usize {
    parameters
        .windows(3)
        .filter(|window| *window == [0xFF, 0xFF, 0xFD])
        .count()
}

fn io_cause(error: io::Error) -> Cause {
    match error.kind() {
        io::ErrorKind::TimedOut => Cause::Silence,
        io::ErrorKind::Interrupted => Cause::Damage("reading was interrupted".to_owned()),
        _ => Cause::Gone(error),
    }
}

fn write_cause(error: WriteError) -> Cause {
    match error {
        WriteError::DiscardBuffer(error) | WriteError::Write(error) => io_cause(error),
        // Cannot happen: no packet comes near the size of the buffer.
        error @ WriteError::BufferTooSmall(_) => Cause::Damage(error.to_string()),
    }
}

fn read_cause(error: ReadError) -> Cause {
    match error {
        ReadError::Io(error) => io_cause(error),
        ReadError::MotorError(error) => Cause::Refusal(error.error_number()),
        error @ (ReadError::BufferFull(_) | ReadError::InvalidMessage(_)) => Cause::Damage(error.to_string()),
    }
}
