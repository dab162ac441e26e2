use std::time::Duration;

use super::*;
use crate::wire::crc::crc16;
use crate::wire::memory::Memory;
use crate::wire::packet::STATUS;

/// Three devices with ids 1, 2 and 3, listed out of order.
fn three() -> [Memory; 3] {
    [Memory::new(2), Memory::new(3), Memory::new(1)]
}

fn dispatch(dispatcher: &mut Dispatcher, devices: &mut [Memory], packet: &Packet) -> Vec<Slot> {
    let mut devices: Vec<&mut dyn Device> = devices
        .iter_mut()
        .map(|device| device as &mut dyn Device)
        .collect();
    dispatcher.dispatch(packet, &mut devices)
}

fn send(devices: &mut [Memory], id: u8, instruction: u8, params: &[u8]) -> Vec<Slot> {
    let packet = Packet {
        id,
        instruction,
        params: params.to_vec(),
    };
    dispatch(&mut Dispatcher::default(), devices, &packet)
}

fn status(id: u8, error: u8, data: &[u8]) -> Slot {
    Slot::Status {
        delay: Duration::ZERO,
        bytes: Packet::status(id, error, data).encode(),
    }
}

fn silence(bytes: usize) -> Slot {
    Slot::Silence { bytes }
}

const ACKNOWLEDGED: &[u8] = &[];

#[test]
fn ping_answers_model_and_firmware() {
    assert_eq!(send(&mut three(), 1, 0x01, &[]), [status(1, 0, &[0, 1, 6])]);
    assert_eq!(send(&mut three(), 9, 0x01, &[]), [silence(14)]);
}

#[test]
fn a_ping_to_all_is_answered_in_order_of_ids() {
    let wanted = [1, 2, 3].map(|id| status(id, 0, &[0, 1, 6]));
    let answer = send(&mut three(), 0xFE, 0x01, &[]);
    assert_eq!(answer[..3], wanted);
    assert_eq!(answer[3..], [silence(0)], "the host listens for more");
}

#[test]
fn read_and_write_reach_the_table() {
    let mut devices = three();
    assert_eq!(
        send(&mut devices, 2, 0x02, &[0x84, 0, 4, 0]),
        [status(2, 0, &[0x84, 0x85, 0x86, 0x87])]
    );
    assert_eq!(
        send(&mut devices, 2, 0x03, &[0x74, 0, 1, 2, 3, 4]),
        [status(2, 0, ACKNOWLEDGED)]
    );
    assert_eq!(devices[0].table[0x74..0x78], [1, 2, 3, 4]);
    assert_eq!(devices[1].table[0x74], 0x74, "id 3 was not meant");
    assert_eq!(
        devices.each_ref().map(|device| device.heard),
        [2; 3],
        "whom a packet is for is nothing to a watchdog"
    );
}

#[test]
fn a_read_to_all_is_not_answered_and_a_write_to_all_is_done_in_silence() {
    let mut devices = three();
    assert_eq!(send(&mut devices, 0xFE, 0x02, &[0x84, 0, 4, 0]), []);
    assert_eq!(send(&mut devices, 0xFE, 0x03, &[0x74, 0, 9]), []);
    assert!(devices.iter().all(|device| device.table[0x74] == 9));
}

#[test]
fn a_new_id_counts_from_the_next_packet_on() {
    let mut devices = three();
    assert_eq!(
        send(&mut devices, 1, 0x03, &[7, 0, 8]),
        [status(1, 0, ACKNOWLEDGED)]
    );
    assert_eq!(send(&mut devices, 1, 0x01, &[]), [silence(14)]);
    assert_eq!(send(&mut devices, 8, 0x01, &[]), [status(8, 0, &[0, 1, 6])]);
}

#[test]
fn refusals_are_error_numbers_and_alert_is_a_bit_beside_them() {
    let mut devices = three();
    assert_eq!(send(&mut devices, 1, 0x02, &[0xFE, 0, 4, 0]), [status(1, 4, &[])]);
    assert_eq!(
        send(&mut devices, 1, 0x02, &[0x84, 0, 4]),
        [status(1, 5, &[])],
        "parameters too short"
    );
    assert_eq!(
        send(&mut devices, 1, 0x77, &[]),
        [status(1, 2, &[])],
        "unknown instruction"
    );
    assert_eq!(
        send(&mut devices, 1, 0x83, &[0x74, 0, 1, 0, 1, 9]),
        [status(1, 2, &[])],
        "sync write to one"
    );
    devices[2].alert = true;
    assert_eq!(
        send(&mut devices, 1, 0x02, &[10, 0, 1, 0]),
        [status(1, 0x80, &[10])],
        "alert with good data"
    );
    assert_eq!(
        send(&mut devices, 1, 0x02, &[0xFE, 0, 4, 0]),
        [status(1, 0x84, &[])]
    );
}

#[test]
fn status_packets_are_nobodys_instruction() {
    assert_eq!(send(&mut three(), 1, STATUS, &[0]), []);
}

#[test]
fn the_status_return_level_says_what_is_answered() {
    // (level, ping, read, write answered)
    for (level, read, write) in [(0, false, false), (1, true, false), (2, true, true)] {
        let mut devices = three();
        devices[2].status_return_level = level;
        let speaks = |slots: &[Slot]| matches!(slots, [Slot::Status { .. }]);
        assert!(speaks(&send(&mut devices, 1, 0x01, &[])), "ping at level {level}");
        assert_eq!(
            speaks(&send(&mut devices, 1, 0x02, &[10, 0, 1, 0])),
            read,
            "read at level {level}"
        );
        assert_eq!(
            speaks(&send(&mut devices, 1, 0x03, &[0x74, 0, 9])),
            write,
            "write at level {level}"
        );
        assert_eq!(devices[2].table[0x74], 9, "a write is done all the same");
        assert_eq!(
            send(&mut devices, 0xFE, 0x8A, &[10, 0, 1, 0, 1]) == [silence(13)],
            !read,
            "fast at level {level}"
        );
    }
}

#[test]
fn a_registered_write_waits_for_action() {
    let mut devices = three();
    let mut dispatcher = Dispatcher::default();
    let mut send = |devices: &mut [Memory], id, instruction, params: &[u8]| {
        dispatch(
            &mut dispatcher,
            devices,
            &Packet {
                id,
                instruction,
                params: params.to_vec(),
            },
        )
    };
    assert_eq!(
        send(&mut devices, 1, 0x05, &[]),
        [status(1, 2, &[])],
        "action without reg write"
    );
    for id in [1, 2] {
        assert_eq!(
            send(&mut devices, id, 0x04, &[0x74, 0, id]),
            [status(id, 0, ACKNOWLEDGED)]
        );
    }
    assert_eq!(devices[2].table[0x74], 0x74, "not yet");
    assert_eq!(devices[2].table[69], 1, "register 69 says that a write waits");
    assert_eq!(send(&mut devices, 0xFE, 0x05, &[]), [], "action to all is silent");
    assert_eq!([devices[2].table[0x74], devices[0].table[0x74]], [1, 2]);
    assert_eq!(devices[2].table[69], 0);
    assert_eq!(
        send(&mut devices, 1, 0x05, &[]),
        [status(1, 2, &[])],
        "it is done once"
    );
    send(&mut devices, 1, 0x04, &[0x74, 0, 7]);
    send(&mut devices, 1, 0x08, &[]);
    assert_eq!(
        send(&mut devices, 1, 0x05, &[]),
        [status(1, 2, &[])],
        "a reboot forgets it"
    );
}

/// The manual's example (e-manual, XM430-W350, "Secondary(Shadow) ID(12)") with two servos, ids 1 and 2.
#[test]
fn a_group_takes_writes_to_its_ram_and_does_not_answer() {
    const SECONDARY_ID: u16 = 12;
    const LED: u16 = 65;
    let rig = rig::RigFile::parse("", "test.toml".as_ref()).unwrap();
    let mut bench = crate::Bench::new(&rig).unwrap();
    let mut dispatcher = Dispatcher::default();
    let mut write = |bench: &mut crate::Bench, id: u8, instruction: u8, address: u16, value: u8| {
        let [low, high] = address.to_le_bytes();
        let params = match instruction {
            0x05 => Vec::new(),
            _ => vec![low, high, value],
        };
        let packet = Packet {
            id,
            instruction,
            params,
        };
        dispatcher.dispatch(&packet, &mut bench.devices())
    };
    let leds = |bench: &mut crate::Bench| {
        [rig::Device::Light, rig::Device::Sensor].map(|device| bench.device(device).read(LED, 1).unwrap()[0])
    };
    for id in [1, 2] {
        assert_eq!(
            write(&mut bench, id, 0x03, SECONDARY_ID, 2),
            [status(id, 0, ACKNOWLEDGED)]
        );
    }
    assert_eq!(write(&mut bench, 1, 0x03, LED, 1), [status(1, 0, ACKNOWLEDGED)]);
    assert_eq!(leds(&mut bench), [1, 0], "its own id alone");
    assert_eq!(write(&mut bench, 2, 0x03, LED, 1), [status(2, 0, ACKNOWLEDGED)]);
    assert_eq!(leds(&mut bench), [1, 1], "one answers, both obey");

    for id in [1, 2] {
        assert_eq!(
            write(&mut bench, id, 0x03, SECONDARY_ID, 100),
            [status(id, 0, ACKNOWLEDGED)]
        );
    }
    assert_eq!(write(&mut bench, 100, 0x03, LED, 0), [silence(11)]);
    assert_eq!(leds(&mut bench), [0, 0]);
    assert_eq!(write(&mut bench, 100, 0x04, LED, 1), [silence(11)], "registered");
    assert_eq!(write(&mut bench, 100, 0x05, 0, 0), [silence(11)], "done");
    assert_eq!(leds(&mut bench), [1, 1]);
    assert_eq!(write(&mut bench, 100, 0x03, 9, 33), [silence(11)]);
    let delay = bench.device(rig::Device::Light).read(9, 1).unwrap();
    assert_eq!(delay, [0], "the EEPROM is not the group's");

    for id in [1, 2] {
        assert_eq!(
            write(&mut bench, id, 0x03, SECONDARY_ID, 253),
            [status(id, 0, ACKNOWLEDGED)]
        );
    }
    assert_eq!(write(&mut bench, 253, 0x03, LED, 0), [silence(11)]);
    assert_eq!(leds(&mut bench), [1, 1], "253 and beyond are no group");
}

/// All instruction packets are communication (e-manual, "Bus Watchdog(98)"), to whatever id they are.
#[test]
fn a_watchdog_is_fed_by_what_is_said_to_others() {
    let rig = rig::RigFile::parse("", "test.toml".as_ref()).unwrap();
    let mut bench = crate::Bench::new(&rig).unwrap();
    let light = rig::Device::Light;
    bench.device(light).write(64, &[1]).unwrap();
    bench.device(light).write(98, &[10]).unwrap();
    let mut dispatcher = Dispatcher::default();
    let mut tell = |bench: &mut crate::Bench, ms: u64, id: u8, instruction: u8| {
        bench.advance_to(Duration::from_millis(ms));
        let packet = Packet {
            id,
            instruction,
            params: Vec::new(),
        };
        dispatcher.dispatch(&packet, &mut bench.devices());
        bench.device(light).read(98, 1).unwrap()[0]
    };
    assert_eq!(tell(&mut bench, 150, 2, 0x01), 10, "a ping of the other servo");
    assert_eq!(
        tell(&mut bench, 300, 77, 0x02),
        10,
        "a read of nobody, without parameters"
    );
    assert_eq!(
        tell(&mut bench, 450, 1, STATUS),
        10,
        "a status packet is in time, and feeds nothing"
    );
    assert_eq!(
        tell(&mut bench, 510, 2, 0x01),
        255,
        "200 ms after the last instruction"
    );
}

#[test]
fn reboot_clear_and_factory_reset_reach_the_device() {
    let mut devices = three();
    assert_eq!(send(&mut devices, 1, 0x08, &[]), [status(1, 0, ACKNOWLEDGED)]);
    assert_eq!(
        send(&mut devices, 1, 0x10, &[1, 0x44, 0x58, 0x4C, 0x22]),
        [status(1, 0, ACKNOWLEDGED)]
    );
    assert_eq!(send(&mut devices, 1, 0x06, &[0x02]), [status(1, 0, ACKNOWLEDGED)]);
    assert_eq!(
        devices[2].log,
        ["reboot", "clear [01, 44, 58, 4C, 22]", "factory reset 02"]
    );
    assert_eq!(send(&mut devices, 0xFE, 0x06, &[0xFF]), []);
    assert_eq!(devices[2].log.len(), 3, "a full reset of all is refused");
}

#[test]
fn a_sync_read_is_answered_in_the_order_asked_and_leaves_gaps() {
    let mut devices = three();
    devices[0].return_delay = Duration::from_micros(500);
    let slots = send(&mut devices, 0xFE, 0x82, &[0x84, 0, 2, 0, 3, 9, 2, 1]);
    let second = Slot::Status {
        delay: Duration::from_micros(500),
        bytes: Packet::status(2, 0, &[0x84, 0x85]).encode(),
    };
    assert_eq!(
        slots,
        [
            status(3, 0, &[0x84, 0x85]),
            silence(13),
            second,
            status(1, 0, &[0x84, 0x85])
        ]
    );
}

#[test]
fn a_bulk_read_takes_from_each_what_was_asked() {
    let slots = send(&mut three(), 0xFE, 0x92, &[2, 0x90, 0, 2, 0, 1, 0x92, 0, 1, 0]);
    assert_eq!(slots, [status(2, 0, &[0x90, 0x91]), status(1, 0, &[0x92])]);
}

#[test]
fn sync_and_bulk_writes_reach_each_device_in_silence() {
    let mut devices = three();
    assert_eq!(
        send(
            &mut devices,
            0xFE,
            0x83,
            &[0x74, 0, 2, 0, 1, 10, 11, 9, 0, 0, 3, 30, 31]
        ),
        []
    );
    assert_eq!(devices[2].table[0x74..0x76], [10, 11]);
    assert_eq!(devices[1].table[0x74..0x76], [30, 31]);
    assert_eq!(
        send(
            &mut devices,
            0xFE,
            0x93,
            &[1, 0x50, 0, 1, 0, 5, 3, 0x60, 0, 2, 0, 6, 7]
        ),
        []
    );
    assert_eq!(devices[2].table[0x50], 5);
    assert_eq!(devices[1].table[0x60..0x62], [6, 7]);
    assert_eq!(
        send(&mut devices, 0xFE, 0x83, &[0x74, 0, 2, 0, 1, 99]),
        [],
        "cut off: not done"
    );
    assert_eq!(devices[2].table[0x74], 10);
}

#[test]
fn a_fast_sync_read_is_one_packet_with_running_crcs_and_no_stuffing() {
    let mut devices = three();
    devices[2].table[0x84..0x88].copy_from_slice(&[0xFF, 0xFF, 0xFD, 0xFF]);
    let slots = send(&mut devices, 0xFE, 0x8A, &[0x84, 0, 4, 0, 1, 2]);
    let mut wanted = vec![
        0xFF, 0xFF, 0xFD, 0, 0xFE, 17, 0, 0x55, 0, 1, 0xFF, 0xFF, 0xFD, 0xFF,
    ];
    wanted.extend(crc16(&wanted).to_le_bytes());
    wanted.extend([0, 2, 0x84, 0x85, 0x86, 0x87]);
    wanted.extend(crc16(&wanted).to_le_bytes());
    assert_eq!(
        slots,
        [Slot::Status {
            delay: Duration::ZERO,
            bytes: wanted
        }]
    );
}

#[test]
fn a_fast_sync_read_ends_at_the_first_silent_device() {
    let whole = send(&mut three(), 0xFE, 0x8A, &[0x84, 0, 1, 0, 1, 2, 3]);
    let [Slot::Status { bytes: whole, .. }] = whole.as_slice() else {
        panic!("{whole:?}")
    };
    let cut = send(&mut three(), 0xFE, 0x8A, &[0x84, 0, 1, 0, 1, 9, 3]);
    let [Slot::Status { bytes: cut, .. }, Slot::Silence { bytes: 10 }] = cut.as_slice() else {
        panic!("{cut:?}")
    };
    assert_eq!(cut[..], whole[..13]);
}

#[test]
fn two_devices_with_one_id_garble_each_other() {
    let mut devices = three();
    devices[0].id = 1;
    let slots = send(&mut devices, 1, 0x02, &[7, 0, 1, 0]);
    let [Slot::Status { bytes, .. }] = slots.as_slice() else {
        panic!("{slots:?}")
    };
    assert_eq!(Packet::decode(bytes), None, "{bytes:02X?}");
}
