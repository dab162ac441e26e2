//! What the fuzzer does with its bytes, one function a target. `tests/tests/fuzzed.rs` does the same with the corpora.

use std::cell::RefCell;
use std::io::{Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// Bytes of a reply stream that are heard: less than a terminal holds.
const STREAM_MAX: usize = 2000;

/// What is done with the bytes.
pub(crate) type Body = fn(&[u8]);

/// All targets by name.
pub(crate) const TARGETS: [(&str, Body); 5] = [
    ("device", device),
    ("status", status),
    ("rig", rig),
    ("job", job),
    ("merl", merl),
];

/// The device side of the bus: parser, instructions, control tables, physics. Odd first byte: what follows is taken
/// as it is, in pieces; even: as packets (id, instruction, length, parameters), which get header and CRC.
fn device(bytes: &[u8]) {
    let Some((&way, bytes)) = bytes.split_first() else {
        return;
    };
    let file = rig::RigFile::default();
    let bench = firmware_sim::Bench::new(&file).expect("the built-in file is sound");
    let settings = firmware_sim::WireSettings::new(&file).expect("the built-in file is sound");
    let mut line = firmware_sim::Line::new(bench, &settings);
    if way % 2 == 1 {
        for (i, piece) in bytes.chunks(usize::from(way / 2).max(1)).enumerate() {
            line.receive(piece, file.bus.baud, Duration::from_micros(i as u64));
        }
        return;
    }
    let mut rest = bytes;
    while let [id, instruction, length, parameters @ ..] = rest {
        let (parameters, after) = parameters.split_at(usize::from(*length).min(parameters.len()));
        line.receive(
            &packet(*id, *instruction, parameters),
            file.bus.baud,
            Duration::ZERO,
        );
        rest = after;
    }
}

/// The host side: status packets as the rig reads them. What is believed must have stood on the wire. Even first
/// byte: what follows gets header and CRC.
fn status(bytes: &[u8]) {
    let Some((&way, bytes)) = bytes.split_first() else {
        return;
    };
    let stream = match (way % 2, bytes) {
        (0, [id, parameters @ ..]) => packet(*id, 0x55, parameters),
        _ => bytes.to_vec(),
    };
    WIRE.with_borrow_mut(|wire| wire.hear(&stream));
}

thread_local! {
    static WIRE: RefCell<Wire> = RefCell::new(Wire::new());
}

/// A pseudo-terminal with the crate that the rig reads status packets with.
struct Wire {
    bus: dynamixel2::Bus<Vec<u8>, Vec<u8>>,
    other_end: std::fs::File,
}

impl Wire {
    fn new() -> Self {
        let end = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("pseudo-terminals are to be had");
        grantpt(&end).and_then(|()| unlockpt(&end)).expect("it is ours");
        let path = ptsname(&end, Vec::new()).expect("it has a name");
        let path = path.to_str().expect("the name is plain");
        Self {
            bus: dynamixel2::Bus::open_with_buffers(path, 1_000_000, vec![0; 256], vec![0; 256])
                .expect("it behaves as a serial port"),
            other_end: std::fs::File::from(end),
        }
    }

    /// Has the host read what comes back on a ping.
    fn hear(&mut self, stream: &[u8]) {
        let stream = &stream[..stream.len().min(STREAM_MAX)];
        self.bus
            .write_instruction(1, 1, 0, |_| ())
            .expect("the terminal is open");
        let mut ping = [0; 10];
        self.other_end
            .read_exact(&mut ping)
            .expect("a ping has ten bytes");
        self.other_end.write_all(stream).expect("the terminal is open");
        // The crate's panic at an impossible length is a known one, which the rig survives likewise.
        let mut receive = || {
            let reply = self
                .bus
                .read_status_response_deadline(Instant::now() + Duration::from_millis(2));
            reply.map(|reply| (reply.packet_id(), reply.error(), reply.parameters().to_vec()))
        };
        while let Ok(Ok((id, error, parameters))) = catch_unwind(AssertUnwindSafe(&mut receive)) {
            let believed = packet(id, 0x55, &[&[error], &parameters[..]].concat());
            // Unstuffed, a packet with stuffing looks different.
            let stuffed = stream
                .get(8..)
                .unwrap_or_default()
                .windows(3)
                .any(|window| window == [0xFF, 0xFF, 0xFD]);
            let stood = stream.windows(believed.len()).any(|window| window == believed);
            assert!(stood || stuffed, "{stream:02X?} gave {believed:02X?}");
        }
    }
}

/// A rig file, with the simulator's tables.
fn rig(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    if let Ok(file) = rig::RigFile::parse(text, Path::new("rig.toml")) {
        // A specimen may be a file of any size: only the settings are looked at.
        let _ = firmware_sim::Settings::new(&file);
        let _ = firmware_sim::WireSettings::new(&file);
    }
}

/// A job file.
fn job(bytes: &[u8]) {
    if let Ok(text) = std::str::from_utf8(bytes) {
        let _ = sweep::Job::parse(text, "job.toml");
    }
}

/// A MERL table: the bytes, then as many zeros as the first two say; 65,535 of them stand for as many as a whole table
/// needs, which takes longer to read than thousands of headers and torn tails.
fn merl(bytes: &[u8]) {
    let [low, high, bytes @ ..] = bytes else { return };
    let zeros = match u16::from_le_bytes([*low, *high]) {
        u16::MAX => brdf::MerlTable::FILE_BYTES.saturating_sub(bytes.len() as u64),
        some => some.into(),
    };
    if let Ok(table) = brdf::MerlTable::read_from(bytes.chain(std::io::repeat(0).take(zeros))) {
        assert!(table.nodes().iter().flatten().all(|value| value.is_finite()));
    }
}

/// A packet of Protocol 2.0, not stuffed.
fn packet(id: u8, instruction: u8, parameters: &[u8]) -> Vec<u8> {
    let length = (parameters.len() + 3) as u16;
    let mut bytes = vec![0xFF, 0xFF, 0xFD, 0x00, id];
    bytes.extend(length.to_le_bytes());
    bytes.push(instruction);
    bytes.extend(parameters);
    bytes.extend(crc(&bytes).to_le_bytes());
    bytes
}

/// CRC-16 of Protocol 2.0: polynomial 0x8005, no reflection.
fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte) << 8, |crc, _| {
            crc << 1 ^ if crc & 0x8000 == 0 { 0 } else { 0x8005 }
        })
    })
}
