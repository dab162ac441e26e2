//! An instrument that speaks SCPI over TCP and looks at the same light as the photometer.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use rig::RigFile;

use crate::wire::Shared;
use crate::{Clock, SimError};

/// Ranges of a picoammeter, A: what the ranges of a Keithley 6485, 2 nA … 20 mA, can show.
const RANGES: std::ops::RangeInclusive<f64> = 2.1e-9..=2.1e-2;
/// Periods of the mains over which it integrates.
const NPLC: std::ops::RangeInclusive<f64> = 0.01..=50.0;
/// Time constant with which a reading settles after a change of range, s, and how far off it is at first.
const SETTLING_S: f64 = 0.02;
const UNSETTLED: f64 = 0.1;
/// What stands for an overflow.
const OVERFLOW: &str = "+9.900000E+37";
/// Entries that the error queue holds.
const QUEUE: usize = 10;
/// Longest line that is taken.
const LONGEST: u64 = 4096;

/// What goes wrong with the instrument, once each, from the next reading on.
#[derive(Clone, Debug, Default)]
pub struct InstrumentFaults {
    /// Readings during which it loses its connection.
    pub drops: u32,
    /// Readings that are answered late, and by how much, in the time of this computer.
    pub late: u32,
    /// By how much.
    pub late_by: Duration,
    /// Answers that come in the place of readings, the first one first.
    pub answers: VecDeque<String>,
}

/// A simulated picoammeter on a TCP port, served by threads of its own until this is dropped.
///
/// It knows the commands of a Keithley 6485 that a measurement needs, in their short forms: `*IDN?`, `*RST`, `*CLS`,
/// `SYST:ERR?`, `SYST:ZCH`, `FORM:ELEM`, `[SENS:]CURR:RANG`, `:RANG:AUTO`, `:NPLC`, `READ?`, and `SOUR2:TTL 0 | 1`, which
/// switches the lamp.
pub struct Instrument {
    address: SocketAddr,
    faults: Arc<Mutex<InstrumentFaults>>,
    ended: Arc<AtomicBool>,
    open: Arc<Mutex<Vec<TcpStream>>>,
    thread: Option<JoinHandle<()>>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Instrument {
    /// Serves it at an address, of whose port 0 makes any that is free.
    pub(crate) fn serve(shared: Arc<Shared>, rig: &RigFile, address: &str) -> Result<Self, SimError> {
        let failed = |source| SimError::Instrument {
            address: address.to_owned(),
            source,
        };
        let listener = TcpListener::bind(address).map_err(failed)?;
        let bound = listener.local_addr().map_err(failed)?;
        let faults = Arc::new(Mutex::new(InstrumentFaults::default()));
        let ended = Arc::new(AtomicBool::new(false));
        let open = Arc::new(Mutex::new(Vec::new()));
        let front = Front {
            shared,
            faults: Arc::clone(&faults),
            line_hz: rig.detector.line_hz,
            amperes_per_count: rig.detector.full_reading * f64::from(rig.photometer.integration_min_us)
                / f64::from(rig.photometer.full_scale),
        };
        let (stop, connections) = (Arc::clone(&ended), Arc::clone(&open));
        let thread = std::thread::Builder::new()
            .name("instrument".to_owned())
            .spawn(move || {
                for stream in listener.incoming().map_while(Result::ok) {
                    if stop.load(Ordering::Acquire) {
                        break;
                    }
                    if let Ok(copy) = stream.try_clone() {
                        locked(&connections).push(copy);
                    }
                    // One connection at a time, as such instruments have it; another waits.
                    if let Err(error) = Session::new(&front).serve(&stream) {
                        tracing::debug!(%error, "the connection with the instrument ended");
                    }
                    let _ = stream.shutdown(Shutdown::Both);
                    locked(&connections).clear();
                }
            })
            .map_err(failed)?;
        Ok(Self {
            address: bound,
            faults,
            ended,
            open,
            thread: Some(thread),
        })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Changes what goes wrong from now on.
    pub fn faults(&self, change: impl FnOnce(&mut InstrumentFaults)) {
        change(&mut locked(&self.faults));
    }
}

impl Drop for Instrument {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Release);
        for stream in locked(&self.open).drain(..) {
            let _ = stream.shutdown(Shutdown::Both);
        }
        // Wakes the thread where it waits for a connection.
        let woken = TcpStream::connect(self.address);
        if let Some(thread) = self.thread.take().filter(|_| woken.is_ok()) {
            let _ = thread.join();
        }
    }
}

/// What all connections share.
struct Front {
    shared: Arc<Shared>,
    faults: Arc<Mutex<InstrumentFaults>>,
    line_hz: f64,
    /// Current that makes one count a µs at gain ×1, times µs.
    amperes_per_count: f64,
}

/// One connection, and how the instrument is set up: another connection finds it as after power-on.
struct Session<'a> {
    front: &'a Front,
    range_a: f64,
    nplc: f64,
    zero_check: bool,
    /// Bench time of the last change of range.
    changed: Duration,
    errors: VecDeque<String>,
}

/// What an answer to a line is.
enum Reply {
    Nothing,
    Text(String),
    /// The connection is lost.
    Lost,
}

impl<'a> Session<'a> {
    fn new(front: &'a Front) -> Self {
        Self {
            front,
            range_a: *RANGES.end(),
            nplc: 1.0,
            zero_check: true,
            changed: Duration::ZERO,
            errors: VecDeque::new(),
        }
    }

    fn serve(mut self, stream: &TcpStream) -> std::io::Result<()> {
        let mut lines = BufReader::new(stream);
        loop {
            let mut line = String::new();
            if lines.by_ref().take(LONGEST).read_line(&mut line)? == 0 {
                return Ok(());
            }
            let mut answers = Vec::new();
            for command in line
                .trim()
                .split(';')
                .filter(|command| !command.trim().is_empty())
            {
                match self.command(command.trim()) {
                    Reply::Nothing => {}
                    Reply::Text(text) => answers.push(text),
                    Reply::Lost => return Ok(()),
                }
            }
            if !answers.is_empty() {
                let mut writer = stream;
                writer.write_all(format!("{}\n", answers.join(";")).as_bytes())?;
            }
        }
    }

    fn command(&mut self, command: &str) -> Reply {
        let (header, value) = command.split_once(' ').unwrap_or((command, ""));
        let header = header.trim_start_matches(':').to_ascii_uppercase();
        let header = header.strip_prefix("SENS:").unwrap_or(&header);
        let value = value.trim();
        match header {
            "*IDN?" => return Reply::Text("KEITHLEY INSTRUMENTS INC.,MODEL 6485,1234567,C01".to_owned()),
            "*RST" => {
                self.range_a = *RANGES.end();
                self.nplc = 1.0;
                self.zero_check = true;
            }
            "*CLS" => self.errors.clear(),
            "SYST:ERR?" => {
                let entry = self.errors.pop_front();
                return Reply::Text(entry.unwrap_or_else(|| "0,\"No error\"".to_owned()));
            }
            "FORM:ELEM" | "CURR:RANG:AUTO" => {}
            "SYST:ZCH" => self.zero_check = ["ON", "1"].contains(&value.to_ascii_uppercase().as_str()),
            "CURR:RANG?" => return Reply::Text(format!("{:+.6E}", self.range_a)),
            "CURR:NPLC?" => return Reply::Text(format!("{:+.6E}", self.nplc)),
            "CURR:RANG" => match value.parse::<f64>() {
                Ok(reading) if (0.0..=*RANGES.end()).contains(&reading) => {
                    let range_a = range_of(reading);
                    if range_a != self.range_a {
                        self.range_a = range_a;
                        self.changed = self.front.shared.bench(|bench| bench.now());
                    }
                }
                Ok(_) => self.complain("-222,\"Parameter data out of range\""),
                Err(_) => self.complain("-104,\"Data type error\""),
            },
            "CURR:NPLC" => match value.parse::<f64>() {
                Ok(nplc) if NPLC.contains(&nplc) => self.nplc = nplc,
                Ok(_) => self.complain("-222,\"Parameter data out of range\""),
                Err(_) => self.complain("-104,\"Data type error\""),
            },
            "SOUR2:TTL" => {
                let on = u8::from(["ON", "1"].contains(&value.to_ascii_uppercase().as_str()));
                let lamp = rig::dynamixel::register::photometer::LAMP_ENABLE.address;
                let switched = self
                    .front
                    .shared
                    .bench(|bench| bench.device(rig::Device::Photometer).write(lamp, &[on]));
                if switched.is_err() {
                    self.complain("-221,\"Settings conflict\"");
                }
            }
            "READ?" => return self.read(),
            _ => self.complain("-113,\"Undefined header\""),
        }
        Reply::Nothing
    }

    fn complain(&mut self, entry: &str) {
        if self.errors.len() < QUEUE {
            self.errors.push_back(entry.to_owned());
        }
    }

    /// One reading: takes as long as it integrates, of the bench's time.
    fn read(&mut self) -> Reply {
        let duration = Duration::from_secs_f64(self.nplc / self.front.line_hz);
        let shared = &self.front.shared;
        let real = shared.bench(|bench| {
            bench.begin_measuring();
            bench.clock() == Clock::Real
        });
        let (lost, late, instead) = {
            let mut faults = locked(&self.front.faults);
            let late = match faults.late {
                0 => Duration::ZERO,
                _ => faults.late_by,
            };
            let lost = faults.drops > 0;
            faults.drops = faults.drops.saturating_sub(1);
            faults.late = faults.late.saturating_sub(1);
            (lost, late, faults.answers.pop_front())
        };
        std::thread::sleep(late + if real { duration } else { Duration::ZERO });
        let (counts, now) = shared.bench(|bench| {
            if !real {
                let end = bench.now() + duration;
                bench.advance_to(end);
            }
            (bench.end_measuring(duration).unwrap_or_default(), bench.now())
        });
        if lost {
            return Reply::Lost;
        }
        if let Some(instead) = instead {
            return Reply::Text(instead);
        }
        let microseconds = duration.as_secs_f64() * 1e6;
        let true_a = match self.zero_check {
            true => 0.0,
            false => counts / microseconds * self.front.amperes_per_count,
        };
        let since_s = now.saturating_sub(self.changed).as_secs_f64();
        let current_a = true_a * (1.0 + UNSETTLED * (-since_s / SETTLING_S).exp());
        Reply::Text(match current_a > self.range_a {
            true => OVERFLOW.to_owned(),
            false => format!("{current_a:+.6E}"),
        })
    }
}

/// The smallest range that holds a reading.
fn range_of(reading: f64) -> f64 {
    let mut range_a = *RANGES.start();
    while range_a < *RANGES.end() && range_a < reading {
        range_a *= 10.0;
    }
    range_a
}
