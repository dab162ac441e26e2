use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use dynamixel2::{Bus, ReadError, WriteError};
use serialport::TTYPort;

use super::buffer::{BUFFER, Received};
use super::node::BROADCAST;
use super::port;
use crate::{BusSettings, RigError};

/// Longest return delay that a device can be set to (e-manual, "Return Delay Time(9)").
const RETURN_DELAY_MAX: Duration = Duration::from_micros(508);

/// What a host may add to a reply time, waited for in slices: the price of a lost reply, so not more than needed. On an idle
/// host they are 30 ms. On a busy one this program is woken late from each of them by as much as the kernel, an adapter's
/// driver or the simulator are late with the reply, and so it waits for longer.
const HOST_MARGIN: Duration = Duration::from_millis(30);
/// The port waits for whole milliseconds: two of a slice.
const SLICE: Duration = Duration::from_millis(3);
const SLICES: u32 = (HOST_MARGIN.as_millis() / 2) as u32;

/// Where replies came after they were given up, those of the requests that follow are waited for so many times as long: a host
/// that shares its processors with too many others is late with every reply by about as much, and would never hear one. Three
/// devices that must catch up and one request take less than a usual bus watchdog, a second, at that.
const LONGEST: u32 = 6;
/// Late replies that are looked for at once.
const LATE_MAX: usize = 8;

/// No reply comes later than this after its request. ROBOTIS' SDK gives up 34 ms after the last byte is due, and
/// nobody reports replies that it missed; this is half as much again.
const LATEST_REPLY: Duration = Duration::from_millis(50);

/// Bytes of an instruction packet besides its parameters: header 4, id, length 2, instruction, CRC 2.
const INSTRUCTION_OVERHEAD: usize = 10;

/// Bytes of a status packet besides its parameters: those of an instruction and the error byte.
const STATUS_OVERHEAD: usize = 11;

/// Ping (e-manual, Protocol 2.0).
pub(super) const PING: u8 = 0x01;

/// Parameters of the answer to a ping: model number and firmware version. No register block of this length is read.
pub(super) const PING_REPLY: usize = 3;

/// All answers to a ping to all are there after this and their time on the wire: each device waits for its turn, 3 ms
/// for each id before it (ROBOTIS' SDK, `broadcastPing`).
const ALL_ANSWERED: Duration = Duration::from_millis(3 * 253 + 16);

/// Devices whose answers to a ping to all are waited for; a rig has three.
const DEVICES: u32 = 32;

/// Damaged answers to a ping to all after which no more are read.
const DAMAGED_MAX: usize = 16;

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

/// A status packet: whose it is, and its reply or its error number.
type Status = (u8, Result<Reply, u8>);

/// Ids that answered, and what they said.
pub(super) type Answers = Vec<(u8, Vec<u8>)>;

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
    bus: Bus<Received, Vec<u8>>,
    /// Id of the device whose status packet came last.
    sender: Arc<AtomicU8>,
    echo: Option<serial2::SerialPort>,
    _lock: TTYPort,
    path: PathBuf,
    settings: BusSettings,
    /// After a failure nothing is sent before this: a late reply shall not collide with the next request.
    quiet_until: Option<Instant>,
    /// Ids of which a reply may still be under way.
    suspects: BTreeSet<u8>,
    /// How many of the pings by which an id was to catch up it may still answer.
    pinged: BTreeMap<u8, u32>,
    /// Slices of [`HOST_MARGIN`] that are left of the request in hand.
    slices: u32,
    /// Id whose reply was last given up since it did not come.
    given_up: Option<u8>,
    /// How many times as long as on an idle host a reply is waited for, 1 … [`LONGEST`].
    patience: u32,
}

impl Line {
    pub(super) fn open(path: &Path, settings: &BusSettings) -> Result<Self, RigError> {
        let lock = port::open(path, settings.baud)?;
        let unusable = |source| RigError::PortUnusable {
            port: path.to_owned(),
            source,
        };
        let sender = Arc::default();
        Ok(Self {
            bus: bus(&lock, &sender).map_err(unusable)?,
            sender,
            echo: echo(&lock, settings).map_err(unusable)?,
            _lock: lock,
            path: path.to_owned(),
            settings: settings.clone(),
            quiet_until: None,
            slices: 0,
            given_up: None,
            patience: 1,
            suspects: BTreeSet::new(),
            pinged: BTreeMap::new(),
        })
    }

    /// Sends a packet and collects its replies.
    pub(super) fn transact(&mut self, request: &Request) -> Result<Vec<Reply>, Failure> {
        if let Some(quiet) = self.quiet_until.take() {
            std::thread::sleep(quiet.saturating_duration_since(Instant::now()));
        }
        self.listen();
        let started = Instant::now();
        let result = self.attempt(request);
        if result.is_ok() {
            self.patience = (self.patience - 1).max(1);
            // They answer in order, so nothing is owed from before.
            for (id, _) in &request.replies {
                self.pinged.remove(id);
            }
        }
        self.given_up = match &result {
            Err(Failure {
                id,
                cause: Cause::Silence,
            }) => Some(*id),
            _ => None,
        };
        if let Err(Failure { id, cause }) = &result {
            tracing::debug!(id, ?cause, port = %self.path.display(), "transaction failed");
            if matches!(cause, Cause::Silence | Cause::Damage(_)) {
                self.suspects.extend(request.replies.iter().map(|&(id, _)| id));
            }
            self.quiet_until = match cause {
                Cause::Refusal(_) | Cause::Gone(_) => None,
                // Something came; the rest of it, or the reply proper, is due by then.
                Cause::Damage(_) => Some(started + self.reply_time(BUFFER, request)),
                Cause::Silence => Some(started + self.reply_time(BUFFER, request).max(LATEST_REPLY)),
            };
        }
        result
    }

    /// Hears what came of the last request after it was given up, which sending would throw away.
    fn listen(&mut self) {
        for _ in 0..LATE_MAX {
            if self.given_up.is_none() {
                return;
            }
            match self.receive_by(Instant::now() + Duration::from_millis(1)) {
                Ok((answered, _)) if self.given_up == Some(answered) => self.heard_late(),
                // Of a device that was asked together with that one, and answered after it should have.
                Ok(_) => {}
                Err(_) => return,
            }
        }
    }

    /// A reply that was given up has come: it was the host that was late.
    fn heard_late(&mut self) {
        self.patience = LONGEST;
        self.slices = SLICES * self.patience;
        tracing::debug!(patience = self.patience, "a reply came after it was given up");
    }

    fn attempt(&mut self, request: &Request) -> Result<Vec<Reply>, Failure> {
        for &(id, _) in &request.replies {
            if self.suspects.contains(&id) {
                self.catch_up(id).map_err(|cause| Failure { id, cause })?;
                self.suspects.remove(&id);
            }
        }
        let deadline = self.send(request).map_err(|cause| Failure {
            id: request.id,
            cause,
        })?;
        let mut replies = Vec::with_capacity(request.replies.len());
        for &(id, count) in &request.replies {
            let (answered, said) = loop {
                let (answered, said) = self
                    .receive_fresh(deadline)
                    .map_err(|cause| Failure { id, cause })?;
                let asked = answered == id && count == PING_REPLY;
                if asked || !self.is_late_ping(answered, &said) {
                    break (answered, said);
                }
                self.heard_late();
            };
            let cause = match said {
                Ok(reply) if answered == id && reply.parameters.len() == count => {
                    replies.push(reply);
                    continue;
                }
                Ok(reply) if answered == id => {
                    let found = reply.parameters.len();
                    Cause::Damage(format!("it has {found} bytes instead of {count}"))
                }
                Err(number) if answered == id => Cause::Refusal(number),
                // The next device of a bulk read spoke up: this one has missed its turn.
                _ if request.replies.iter().any(|&(other, _)| other == answered) => Cause::Silence,
                _ => stranger(answered),
            };
            return Err(Failure { id, cause });
        }
        Ok(replies)
    }

    /// Waits for whatever a device may still have to say to an earlier request: it answers in order, so all of that
    /// comes before its answer to this ping. Nothing else that is asked for has the length of that answer.
    fn catch_up(&mut self, id: u8) -> Result<(), Cause> {
        let ping = Request {
            id,
            instruction: PING,
            parameters: Vec::new(),
            replies: vec![(id, PING_REPLY)],
        };
        let deadline = self.send(&ping)?;
        *self.pinged.entry(id).or_default() += 1;
        loop {
            // Damage is not passed over: of a reply that claims to be too long, the crate tells again and again.
            match self.receive(deadline)? {
                (answered, Ok(reply)) if answered == id && reply.parameters.len() == PING_REPLY => {
                    self.pinged
                        .entry(id)
                        .and_modify(|owed| *owed = owed.saturating_sub(1));
                    return Ok(());
                }
                (answered, said) if self.is_late_ping(answered, &said) => self.heard_late(),
                (answered, _) if !self.suspects.contains(&answered) => return Err(stranger(answered)),
                (answered, Ok(reply))
                    if self.given_up == Some(answered) && reply.parameters.len() != PING_REPLY =>
                {
                    self.heard_late();
                }
                _ => {}
            }
        }
    }

    /// Whether this is the answer to a ping of before, which is then no longer owed.
    fn is_late_ping(&mut self, answered: u8, said: &Result<Reply, u8>) -> bool {
        let form = said
            .as_ref()
            .is_ok_and(|reply| reply.parameters.len() == PING_REPLY);
        let owed = self.pinged.get_mut(&answered).filter(|owed| form && **owed > 0);
        owed.map(|owed| *owed -= 1).is_some()
    }

    /// The next status packet of a device that owes none. Those whom the request in hand asks have caught up; what a
    /// suspect says now answers an earlier request, late, and is passed over.
    fn receive_fresh(&mut self, deadline: Instant) -> Result<Status, Cause> {
        loop {
            let (answered, said) = self.receive(deadline)?;
            if !self.suspects.contains(&answered) {
                return Ok((answered, said));
            }
            tracing::debug!(id = answered, "late reply passed over");
        }
    }

    /// Pings all devices at once; gives the ids and parameters of all answers, and how many more were damaged.
    pub(super) fn ping_all(&mut self) -> Result<(Answers, usize), Cause> {
        let request = Request {
            id: BROADCAST,
            instruction: PING,
            parameters: Vec::new(),
            replies: Vec::new(),
        };
        self.send(&request)?;
        let answer = Duration::from_secs_f64(
            ((STATUS_OVERHEAD + PING_REPLY) * 10) as f64 / f64::from(self.settings.baud),
        );
        let deadline = Instant::now() + ALL_ANSWERED + DEVICES * answer;
        let (mut answers, mut damaged) = (Answers::new(), 0);
        while damaged < DAMAGED_MAX {
            match self.receive(deadline) {
                Ok((id, Ok(reply))) if reply.parameters.len() == PING_REPLY => {
                    answers.push((id, reply.parameters));
                }
                Err(Cause::Silence) => break,
                Err(cause @ Cause::Gone(_)) => return Err(cause),
                _ => damaged += 1,
            }
        }
        Ok((answers, damaged))
    }

    /// Throws away what lies in the input buffers, sends a packet and says until when its replies are due.
    fn send(&mut self, request: &Request) -> Result<Instant, Cause> {
        let parameters = &request.parameters;
        self.bus
            .write_instruction(request.id, request.instruction, parameters.len(), |buffer| {
                buffer.copy_from_slice(parameters);
            })
            .map_err(write_cause)?;
        let sent = INSTRUCTION_OVERHEAD + parameters.len() + stuffing(parameters);
        let deadline = Instant::now() + self.reply_time(sent, request);
        self.slices = SLICES * self.patience;
        if let Some(echo) = &mut self.echo {
            skip_echo(echo, sent, deadline + HOST_MARGIN).map_err(io_cause)?;
        }
        Ok(deadline)
    }

    /// The next status packet, which is due at the deadline: after that nothing but the host may be late.
    fn receive(&mut self, mut deadline: Instant) -> Result<Status, Cause> {
        loop {
            match self.receive_by(deadline) {
                Err(Cause::Silence) if self.slices > 0 => {
                    self.slices -= 1;
                    deadline = Instant::now() + SLICE;
                }
                received => return received,
            }
        }
    }

    fn receive_by(&mut self, deadline: Instant) -> Result<Status, Cause> {
        match self.bus.read_status_response_deadline(deadline) {
            Ok(status) => {
                let reply = Reply {
                    alert: status.alert(),
                    parameters: status.parameters().to_owned(),
                };
                Ok((status.packet_id(), Ok(reply)))
            }
            Err(ReadError::MotorError(error)) => {
                Ok((self.sender.load(Ordering::Relaxed), Err(error.error_number())))
            }
            Err(ReadError::Io(error)) => Err(io_cause(error)),
            Err(ReadError::BufferFull(_)) => Err(Cause::Damage("it has an impossible length".to_owned())),
            Err(error) => Err(Cause::Damage(error.to_string())),
        }
    }

    /// Longest time until all replies are there, the host aside: bytes both ways, return delays, adapter.
    fn reply_time(&self, sent: usize, request: &Request) -> Duration {
        let received: usize = request.replies.iter().map(|(_, n)| STATUS_OVERHEAD + n).sum();
        let bytes = (sent + received) as f64;
        // 8 bits, start and stop bit.
        let wire = Duration::from_secs_f64(bytes * 10.0 / f64::from(self.settings.baud));
        wire + RETURN_DELAY_MAX * request.replies.len() as u32 + self.settings.latency
    }
}

/// A reply of a device that was not asked.
fn stranger(id: u8) -> Cause {
    Cause::Damage(format!("id {id} answered instead"))
}

fn bus(lock: &TTYPort, sender: &Arc<AtomicU8>) -> Result<Bus<Received, Vec<u8>>, serialport::Error> {
    let received = Received::new(Arc::clone(sender));
    Bus::with_buffers(port::descriptor(lock)?, received, vec![0; BUFFER])
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
