//! The simulated bus under a client that nobody here wrote: the crate rustypot over serialport.

// All of it is test code, the functions beside the tests too.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::time::Duration;

use firmware_sim::Server;
use rig::RigFile;
use rustypot::DynamixelProtocolHandler;
use serialport::SerialPort;

const LIGHT: u8 = 1;
const SENSOR: u8 = 2;
const PHOTOMETER: u8 = 3;

// Registers of the X series (e-manual).
const RETURN_DELAY: u8 = 9;
const TORQUE_ENABLE: u8 = 64;
const LED: u8 = 65;
const PROFILE_VELOCITY: u8 = 112;
const GOAL_POSITION: u8 = 116;
const MOVING: u8 = 122;
const PRESENT_POSITION: u8 = 132;
const INDIRECT_DATA: u8 = 224;

/// Error number of a write to what is read-only.
const ACCESS: u8 = 7;

/// The simulator in one of its clocks, and rustypot connected to it.
struct Bus {
    server: Server,
    port: Box<dyn SerialPort>,
    client: DynamixelProtocolHandler,
}

impl Bus {
    fn new(clock: &str) -> Self {
        let rig = RigFile::parse(&format!("[sim]\nclock = \"{clock}\"\n"), Path::new("test.toml")).unwrap();
        let server = Server::start(&rig).unwrap();
        let port = serialport::new(server.path().to_string_lossy(), rig.bus.baud)
            // Much, for a machine that is busy; only what is silent on purpose takes so long.
            .timeout(Duration::from_millis(500))
            .open()
            .unwrap();
        Self {
            server,
            port,
            client: DynamixelProtocolHandler::v2(),
        }
    }

    fn read(&mut self, id: u8, address: u8, length: u8) -> Vec<u8> {
        self.client.read(self.port.as_mut(), id, address, length).unwrap()
    }

    fn write(&mut self, id: u8, address: u8, bytes: &[u8]) {
        let answer = self
            .client
            .write_with_error(self.port.as_mut(), id, address, bytes)
            .unwrap();
        assert!(answer.is_ok(), "id {id}, address {address}: {answer:?}");
    }

    fn positions(&mut self) -> [i32; 2] {
        let ids = [LIGHT, SENSOR];
        let bytes = self
            .client
            .sync_read(self.port.as_mut(), &ids, PRESENT_POSITION, 4)
            .unwrap();
        [0, 1].map(|arm| i32::from_le_bytes(bytes[arm].as_slice().try_into().unwrap()))
    }
}

fn in_both_clocks(check: impl Fn(&mut Bus)) {
    for clock in ["real", "wire"] {
        println!("{clock} time");
        check(&mut Bus::new(clock));
    }
}

#[test]
fn ping_finds_who_is_there() {
    in_both_clocks(|bus| {
        for id in [LIGHT, SENSOR, PHOTOMETER] {
            assert!(bus.client.ping(bus.port.as_mut(), id).unwrap(), "id {id}");
        }
        assert!(!bus.client.ping(bus.port.as_mut(), 9).unwrap());
        assert_eq!(
            bus.client.broadcast_ping(bus.port.as_mut()).unwrap(),
            [LIGHT, SENSOR, PHOTOMETER]
        );
    });
}

#[test]
fn reads_and_writes_go_through() {
    in_both_clocks(|bus| {
        bus.write(LIGHT, LED, &[1]);
        assert_eq!(bus.read(LIGHT, LED, 1), [1]);
        // The bytes of a header, with and without a longer run before it: stuffed on the wire, both ways.
        for pattern in [
            &[0xFF, 0xFF, 0xFD, 0x00][..],
            &[0xFF, 0xFF, 0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFF],
        ] {
            bus.write(LIGHT, INDIRECT_DATA, pattern);
            let length = u8::try_from(pattern.len()).unwrap();
            assert_eq!(bus.read(LIGHT, INDIRECT_DATA, length), pattern);
        }
        let refused = bus
            .client
            .write_with_error(bus.port.as_mut(), LIGHT, PRESENT_POSITION, &[0; 4])
            .unwrap();
        assert_eq!(
            (refused.v2_instruction_error(), refused.v2_alert()),
            (ACCESS, false)
        );
    });
}

#[test]
fn sync_writes_are_seen_by_sync_and_fast_sync_reads() {
    in_both_clocks(|bus| {
        // With a return delay of its own for each, which a sync read must live with.
        bus.write(LIGHT, RETURN_DELAY, &[250]);
        bus.write(SENSOR, RETURN_DELAY, &[5]);
        let (ids, values) = ([SENSOR, LIGHT], [vec![30, 0, 0, 0], vec![40, 0, 0, 0]]);
        bus.client
            .sync_write(bus.port.as_mut(), &ids, PROFILE_VELOCITY, &values)
            .unwrap();
        assert_eq!(
            bus.client
                .sync_read(bus.port.as_mut(), &ids, PROFILE_VELOCITY, 4)
                .unwrap(),
            values
        );
        assert_eq!(
            bus.client
                .fast_sync_read(bus.port.as_mut(), &ids, PROFILE_VELOCITY, 4)
                .unwrap(),
            values
        );
        let absent = [LIGHT, 9, SENSOR];
        bus.client
            .fast_sync_read(bus.port.as_mut(), &absent, PROFILE_VELOCITY, 4)
            .expect_err("id 9 is not there");
    });
}

#[test]
fn both_arms_move_and_arrive() {
    in_both_clocks(|bus| {
        let ids = [LIGHT, SENSOR];
        let both = |value: i32| [value.to_le_bytes().to_vec(), value.to_le_bytes().to_vec()];
        bus.client
            .sync_write(bus.port.as_mut(), &ids, PROFILE_VELOCITY, &both(100))
            .unwrap();
        bus.client
            .sync_write(bus.port.as_mut(), &ids, TORQUE_ENABLE, &[vec![1], vec![1]])
            .unwrap();
        let goals = [1300_i32, 2900];
        let packets = goals.map(|goal| goal.to_le_bytes().to_vec());
        bus.client
            .sync_write(bus.port.as_mut(), &ids, GOAL_POSITION, &packets)
            .unwrap();
        let mut on_the_way = 0;
        while ids.iter().any(|&id| bus.read(id, MOVING, 1) == [1]) {
            on_the_way += 1;
            bus.positions();
        }
        assert!(on_the_way > 3, "no motion, a jump");
        for (position, goal) in bus.positions().into_iter().zip(goals) {
            // Friction takes three counts, and a tremble and the rounding one each.
            assert!((position - goal).abs() <= 5, "at {position}, wanted {goal}");
        }
        assert_eq!(bus.server.counters().goals, 2);
    });
}

#[test]
fn a_reboot_loses_ram_and_takes_a_while() {
    in_both_clocks(|bus| {
        bus.write(LIGHT, PROFILE_VELOCITY, &[77, 0, 0, 0]);
        assert!(bus.client.reboot(bus.port.as_mut(), LIGHT).unwrap());
        let mut asked = 0;
        while !bus.client.ping(bus.port.as_mut(), LIGHT).unwrap() {
            asked += 1;
            let now = bus.server.bench(|bench| bench.now());
            bus.server
                .bench(|bench| bench.advance_to(now + Duration::from_millis(100)));
        }
        assert!(asked > 0, "it answered while it booted");
        assert_eq!(bus.read(LIGHT, PROFILE_VELOCITY, 4), [0; 4]);
    });
}
