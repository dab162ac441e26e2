use std::collections::VecDeque;
use std::sync::mpsc::Sender;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::answer::Slot;
use super::counters::GOAL_POSITION;
use super::dispatch::Dispatcher;
use super::instruction::writes;
use super::packet::Packet;
use super::parser::Parser;
use super::written::Written;
use super::{Counters, WireFaults, WireSettings};
use crate::{Bench, Clock, Device};

/// How far a client's baud rate may be off for a device to understand it.
const BAUD_TOLERANCE: f64 = 0.03;

/// Bytes for the host, and when they are due.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outgoing {
    /// Host time, since the line was opened.
    pub due: Duration,
    /// As they stand on the wire.
    pub bytes: Vec<u8>,
}

/// The half-duplex line between host and devices: knows how long bytes take, and moves the bench's time.
///
/// Bytes and times are arguments; it reads no clock and touches no terminal.
pub struct Line {
    bench: Bench,
    /// Bench time at which the line was opened.
    opened: Duration,
    deadline: Duration,
    faults: WireFaults,
    /// Faults to come, earliest first.
    to_come: VecDeque<(Duration, WireFaults)>,
    rng: ChaCha8Rng,
    parser: Parser,
    dispatcher: Dispatcher,
    counters: Counters,
    /// Who is told what the host writes.
    trace: Option<Sender<Written>>,
    /// Bench time until which the line is taken.
    free: Duration,
}

impl Line {
    /// A line between a host and the devices of a bench, whose time goes on from where it is.
    pub fn new(bench: Bench, settings: &WireSettings) -> Self {
        Self {
            opened: bench.now(),
            free: bench.now(),
            bench,
            deadline: settings.deadline,
            faults: settings.faults.clone(),
            to_come: VecDeque::new(),
            rng: ChaCha8Rng::seed_from_u64(settings.seed),
            parser: Parser::default(),
            dispatcher: Dispatcher::default(),
            counters: Counters::default(),
            trace: None,
        }
    }

    /// The bench, its time being now.
    pub fn bench(&mut self, host: Duration) -> &mut Bench {
        if self.bench.clock() == Clock::Real {
            self.advance_to(self.opened + host);
        }
        &mut self.bench
    }

    /// Has the faults change at a time of the bench.
    pub fn schedule(&mut self, at: Duration, faults: WireFaults) {
        let place = self.to_come.partition_point(|&(earlier, _)| earlier <= at);
        self.to_come.insert(place, (at, faults));
    }

    /// How long the port takes nothing, if it is busy with what is about to come.
    pub(crate) fn busy(&mut self) -> Option<Duration> {
        self.rng
            .random_bool(self.faults.busy)
            .then_some(self.faults.late_by)
    }

    /// What goes wrong on it, to be changed.
    pub fn faults(&mut self) -> &mut WireFaults {
        &mut self.faults
    }

    /// What passed over it so far.
    pub fn counters(&self) -> Counters {
        Counters {
            damaged: self.parser.damaged(),
            ..self.counters
        }
    }

    /// Has all that the host writes from now on told to one listener, in the place of an earlier one.
    pub fn trace(&mut self, listener: Sender<Written>) {
        self.trace = Some(listener);
    }

    /// Takes bytes that the host sent at `baud`, and gives what it will hear.
    pub fn receive(&mut self, bytes: &[u8], baud: u32, host: Duration) -> Vec<Outgoing> {
        let begin = match self.bench.clock() {
            Clock::Real => (self.opened + host).max(self.free),
            Clock::Wire => self.bench.now().max(self.free),
        };
        let end = begin + wire_time(bytes.len(), baud);
        self.free = end;
        while let Some((_, faults)) = self.to_come.pop_front_if(|(at, _)| *at <= begin) {
            self.faults = faults;
        }
        self.counters.bytes_in += bytes.len() as u64;
        let mut outgoing = Vec::new();
        if self.faults.echo {
            outgoing.push(Outgoing {
                due: self.due(end, Duration::ZERO, host),
                bytes: bytes.to_vec(),
            });
        }
        match self.faults.take(bytes, &mut self.rng) {
            Some(arrived) if arrived == bytes => self.parser.push(bytes),
            hurt => {
                self.parser.push(&hurt.unwrap_or_default());
                self.counters.requests_hurt += 1;
                // Whoever waits for an answer waits in vain.
                if self.bench.clock() == Clock::Wire {
                    self.free += self.deadline;
                }
            }
        }
        while let Some(received) = self.parser.take() {
            let arrival = end.saturating_sub(wire_time(received.bytes_after, baud));
            self.advance_to(arrival);
            self.answer(&received.packet, baud, host, &mut outgoing);
        }
        if self.bench.clock() == Clock::Wire {
            self.advance_to(self.free);
        }
        outgoing
    }

    /// Has a packet carried out at the bench's present time, and the answers sent.
    fn answer(&mut self, packet: &Packet, baud: u32, host: Duration, outgoing: &mut Vec<Outgoing>) {
        let now = self.bench.now();
        let mut heard = Vec::new();
        for device in self.bench.devices() {
            if device.listens() && hears(device, baud) && !self.faults.silences(device.id(), now) {
                heard.push(device);
            }
        }
        let writes = writes(packet);
        let goal = |id: u8| {
            let device = heard.iter().find(|device| device.id() == id);
            device.map_or(GOAL_POSITION.0, |device| device.place(GOAL_POSITION.0))
        };
        self.counters.note(&writes, heard.is_empty(), goal);
        if let Some(listener) = &self.trace {
            for write in &writes {
                // A listener that is gone needs to hear nothing more.
                let _ = listener.send(Written::new(write, now, host));
            }
        }
        let slots = self.dispatcher.dispatch(packet, &mut heard);
        let lost = self.bench.take_lost_acknowledgement();
        self.free = self.free.max(now) + self.bench.take_delay().unwrap_or_default();
        let mut in_vain = false;
        for slot in slots {
            match slot {
                Slot::Silence { bytes } => {
                    self.free += wire_time(bytes, baud);
                    in_vain = true;
                }
                Slot::Status { delay, bytes } => {
                    self.free += delay + wire_time(bytes.len(), baud);
                    let sent = self.send(&bytes, lost, host);
                    in_vain |= !matches!(&sent[..], [whole] if whole.bytes == bytes);
                    outgoing.extend(sent);
                }
            }
        }
        if in_vain && self.bench.clock() == Clock::Wire {
            self.free += self.deadline;
        }
    }

    /// Sends one status packet, which leaves the line when that is free again; nothing where it is lost.
    fn send(&mut self, bytes: &[u8], lost: bool, host: Duration) -> Vec<Outgoing> {
        let parts = self.faults.deliver(bytes, &mut self.rng);
        if lost || parts.is_empty() {
            self.counters.dropped += 1;
            return Vec::new();
        }
        self.counters.replies += 1;
        let hurt = parts
            .iter()
            .any(|part| part.bytes != bytes || !part.late.is_zero());
        self.counters.hurt += u64::from(hurt);
        let outgoing = parts.into_iter().map(|part| Outgoing {
            due: self.due(self.free, part.late, host),
            bytes: part.bytes,
        });
        outgoing.collect()
    }

    /// Host time at which what leaves the line at `time` reaches the host. In wire time that is at once, but for what
    /// is late: the host's own patience is in host time.
    fn due(&self, time: Duration, late: Duration, host: Duration) -> Duration {
        match self.bench.clock() {
            Clock::Real => time.saturating_sub(self.opened) + late,
            Clock::Wire => host + late,
        }
    }

    fn advance_to(&mut self, time: Duration) {
        if time > self.bench.now() {
            self.bench.advance_to(time);
        }
    }
}

/// Ten bits a byte.
fn wire_time(bytes: usize, baud: u32) -> Duration {
    Duration::from_secs_f64(bytes as f64 * 10.0 / f64::from(baud.max(1)))
}

fn hears(device: &dyn Device, baud: u32) -> bool {
    (f64::from(baud) / f64::from(device.baud()) - 1.0).abs() <= BAUD_TOLERANCE
}

#[cfg(test)]
mod tests;
