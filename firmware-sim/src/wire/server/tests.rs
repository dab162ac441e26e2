use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::symlink;

use rustix::fs::{Mode, OFlags};
use rustix::termios::{OptionalActions, ioctl_tiocexcl, tcgetattr, tcsetattr};

use super::*;
use crate::Clock;
use crate::wire::packet::Packet;
use crate::wire::parser::Parser;

/// Longer than any answer takes; a test that fails waits so long.
const PATIENCE: Duration = Duration::from_secs(5);

fn server(clock: Clock) -> Server {
    let rig = RigFile::default();
    let mut bench = Bench::new(&rig).unwrap();
    bench.set_clock(clock);
    Server::with_bench(bench, &WireSettings::new(&rig).unwrap()).unwrap()
}

/// A client that does only what every client must: open the port, set the baud rate, write, read.
struct Client {
    port: File,
    parser: Parser,
}

impl Client {
    fn open(path: &Path, baud: u32) -> io::Result<Self> {
        let port = rustix::fs::open(path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty())?;
        let mut settings = tcgetattr(&port)?;
        settings.set_speed(baud)?;
        tcsetattr(&port, OptionalActions::Now, &settings)?;
        Ok(Self {
            port: port.into(),
            parser: Parser::default(),
        })
    }

    fn send(&mut self, id: u8, instruction: u8, params: &[u8]) {
        let packet = Packet {
            id,
            instruction,
            params: params.to_vec(),
        };
        self.port.write_all(&packet.encode()).unwrap();
    }

    /// The next status packet, or `None` where none comes in time.
    fn hear(&mut self, patience: Duration) -> Option<Packet> {
        let wait = Timespec::try_from(patience).unwrap();
        loop {
            if let Some(received) = self.parser.take() {
                return Some(received.packet);
            }
            if poll(&mut [PollFd::new(&self.port, PollFlags::IN)], Some(&wait)).unwrap() == 0 {
                return None;
            }
            let mut bytes = [0; 256];
            let read = self.port.read(&mut bytes).unwrap();
            self.parser.push(&bytes[..read]);
        }
    }

    fn ping(&mut self, id: u8) -> Option<Packet> {
        self.send(id, 0x01, &[]);
        self.hear(PATIENCE)
    }
}

fn pong(id: u8) -> Option<Packet> {
    let model_and_firmware: &[u8] = if id == 3 {
        &[0x50, 0x47, 1]
    } else {
        &[0xFC, 0x03, 46]
    };
    Some(Packet::status(id, 0, model_and_firmware))
}

#[test]
fn clients_come_and_go() {
    for clock in [Clock::Real, Clock::Wire] {
        let server = server(clock);
        for id in [1, 2, 3] {
            let mut client = Client::open(server.path(), 1_000_000).unwrap();
            assert_eq!(client.ping(id), pong(id), "{clock:?}");
        }
        assert_eq!(server.counters().packets, 3);
    }
}

#[test]
fn a_client_at_the_wrong_baud_rate_is_heard_once_it_has_the_right_one() {
    let server = server(Clock::Wire);
    let mut wrong = Client::open(server.path(), 57_600).unwrap();
    wrong.send(1, 0x01, &[]);
    wrong.send(1, 0x01, &[]);
    let begun = Instant::now();
    while server.counters().unheard < 2 {
        assert!(begun.elapsed() < PATIENCE, "{:?}", server.counters());
        std::thread::yield_now();
    }
    let mut right = Client::open(server.path(), 1_000_000).unwrap();
    // What is written in turn is read in turn: this is the first answer, so the others got none.
    assert_eq!(right.ping(2), pong(2));
}

/// A client that is killed has no time to give up its exclusive hold.
#[test]
fn a_killed_client_does_not_lock_the_port() {
    let server = server(Clock::Wire);
    let mut other = Client::open(server.path(), 1_000_000).unwrap();
    let killed = Client::open(server.path(), 1_000_000).unwrap();
    ioctl_tiocexcl(&killed.port).unwrap();
    drop(killed);
    assert_eq!(other.ping(1), pong(1));
    // The mark does not stop root, so look as somebody else; capabilities belong to the thread.
    std::thread::spawn(move || {
        let mut rights = rustix::thread::capabilities(None).unwrap();
        rights.effective = rustix::thread::CapabilitySet::empty();
        rustix::thread::set_capabilities(None, rights).unwrap();
        let mut next = Client::open(server.path(), 1_000_000).expect("the port is free");
        assert_eq!(next.ping(2), pong(2));
    })
    .join()
    .unwrap();
}

#[test]
fn faults_and_the_bench_are_within_reach_while_it_serves() {
    let server = server(Clock::Wire);
    let mut client = Client::open(server.path(), 1_000_000).unwrap();
    server.faults(|faults| faults.wrong_id = 1.0);
    assert_eq!(client.ping(1).map(|reply| reply.id), Some(2));
    server.faults(|faults| *faults = WireFaults::default());
    assert_eq!(client.ping(1), pong(1));
    client.send(3, 0x03, &[64, 0, 1]);
    assert_eq!(client.hear(PATIENCE), Some(Packet::status(3, 0, &[])));
    let lamp = server.bench(|bench| bench.device(rig::Device::Photometer).read(64, 1));
    assert_eq!(lamp, Ok(vec![1]));
}

#[test]
fn a_trace_tells_every_kind_of_write_in_the_order_of_the_wire() {
    let server = server(Clock::Wire);
    let mut client = Client::open(server.path(), 1_000_000).unwrap();
    client.send(3, 0x03, &[64, 0, 1]);
    assert!(client.hear(PATIENCE).is_some(), "written before anybody traces");
    let trace = server.trace();
    let before = server.opened().elapsed();
    // Write, Reg Write, Sync Write; what is read is no write.
    client.send(1, 0x03, &[64, 0, 1]);
    client.send(2, 0x04, &[116, 0, 0, 8, 0, 0]);
    client.send(1, 0x02, &[132, 0, 4, 0]);
    client.send(0xFE, 0x83, &[65, 0, 1, 0, 1, 1, 2, 0]);
    assert_eq!(client.ping(1), Some(Packet::status(1, 0, &[])));
    for _ in 0..3 {
        assert!(client.hear(PATIENCE).is_some());
    }
    let told: Vec<_> = trace.try_iter().collect();
    let content: Vec<_> = told.iter().map(|w| (w.id, w.address, &w.bytes[..])).collect();
    let expected: [(u8, u16, &[u8]); 4] = [
        (1, 64, &[1]),
        (2, 116, &[0, 8, 0, 0]),
        (1, 65, &[1]),
        (2, 65, &[0]),
    ];
    assert_eq!(content, expected);
    assert!(told.is_sorted_by_key(|written| (written.at, written.received)));
    let now = server.opened().elapsed();
    assert!(
        told.iter()
            .all(|written| (before..=now).contains(&written.received))
    );
}

#[test]
fn dropping_the_server_hangs_up() {
    let server = server(Clock::Real);
    let mut client = Client::open(server.path(), 1_000_000).unwrap();
    assert_eq!(client.ping(1), pong(1));
    drop(server);
    assert!(client.port.write_all(&[0xFF]).is_err());
}

#[test]
fn the_link_is_stable_and_gone_afterwards() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("bus");
    symlink("/dev/pts/nobody", &path).unwrap();
    let mut server = server(Clock::Wire);
    server.link(&path).unwrap();
    assert_eq!(Client::open(&path, 1_000_000).unwrap().ping(1), pong(1));
    drop(server);
    assert!(path.symlink_metadata().is_err(), "the link is left");
}

#[test]
fn a_link_does_not_replace_a_file_nor_remove_anothers_link() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("bus");
    std::fs::write(&path, "precious").unwrap();
    let mut first = server(Clock::Wire);
    let error = first.link(&path).unwrap_err();
    assert!(
        matches!(&error, SimError::Link { path: named, .. } if *named == path),
        "{error}"
    );
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious");
    std::fs::remove_file(&path).unwrap();
    first.link(&path).unwrap();
    let mut second = server(Clock::Wire);
    second.link(&path).unwrap();
    drop(first);
    assert_eq!(std::fs::read_link(&path).unwrap(), second.path());
}
