use std::path::Path;

use rig::RigFile;

use super::*;
use crate::wire::packet::STATUS_LENGTH;

const BAUD: u32 = 1_000_000;
/// One byte at 1 Mbaud.
const BYTE: Duration = Duration::from_micros(10);
const AT_ONCE: Duration = Duration::ZERO;
const READ_POSITION: [u8; 4] = [0x84, 0, 4, 0];

/// The default rig without imperfections, changed by a rig file.
fn line(clock: Clock, text: &str) -> Line {
    let rig = RigFile::parse(
        &format!("[sim]\nimperfections = \"none\"\n{text}"),
        Path::new("test.toml"),
    )
    .unwrap();
    let mut bench = Bench::new(&rig).unwrap();
    bench.set_clock(clock);
    Line::new(bench, &WireSettings::new(&rig).unwrap())
}

fn packet(id: u8, instruction: u8, params: &[u8]) -> Vec<u8> {
    Packet {
        id,
        instruction,
        params: params.to_vec(),
    }
    .encode()
}

/// What the host hears, as packets.
fn heard(outgoing: &[Outgoing]) -> Vec<Packet> {
    outgoing
        .iter()
        .map(|outgoing| Packet::decode(&outgoing.bytes).expect("a whole status packet"))
        .collect()
}

#[test]
fn wire_time_is_the_bytes_both_ways() {
    let mut line = line(Clock::Wire, "");
    let request = packet(1, 0x02, &READ_POSITION);
    let outgoing = line.receive(&request, BAUD, AT_ONCE);
    // 180° - 45° is count 1536.
    assert_eq!(heard(&outgoing), [Packet::status(1, 0, &[0, 6, 0, 0])]);
    assert_eq!(outgoing[0].due, AT_ONCE, "answered at once in host time");
    assert_eq!(line.bench(AT_ONCE).now(), BYTE * 14 + BYTE * 15);
}

#[test]
fn each_answer_of_a_sync_read_waits_for_its_return_delay() {
    let mut line = line(
        Clock::Wire,
        "[light]\nreturn_delay_us = 500\n[sensor]\nreturn_delay_us = 20\n",
    );
    let request = packet(0xFE, 0x82, &[0x84, 0, 4, 0, 1, 2]);
    assert_eq!(heard(&line.receive(&request, BAUD, AT_ONCE)).len(), 2);
    assert_eq!(
        line.bench(AT_ONCE).now(),
        BYTE * 16 + BYTE * 30 + Duration::from_micros(520)
    );
}

#[test]
fn an_answer_that_does_not_come_costs_the_deadline() {
    let deadline = Duration::from_millis(12);
    let mut line = line(Clock::Wire, "");
    assert_eq!(line.receive(&packet(9, 0x01, &[]), BAUD, AT_ONCE), []);
    let silent = BYTE * 10 + BYTE * 14 + deadline;
    assert_eq!(line.bench(AT_ONCE).now(), silent);
    line.faults().drop_reply = 1.0;
    assert_eq!(line.receive(&packet(1, 0x01, &[]), BAUD, AT_ONCE), []);
    assert_eq!(line.bench(AT_ONCE).now(), silent * 2);
    assert_eq!(line.counters().dropped, 1);
    // Nobody waits for an answer to a sync write.
    line.receive(&packet(0xFE, 0x83, &[0x41, 0, 1, 0, 1, 1]), BAUD, AT_ONCE);
    assert_eq!(line.bench(AT_ONCE).now(), silent * 2 + BYTE * 16);
}

#[test]
fn a_write_to_delay_lets_time_pass_before_its_answer() {
    let mut line = line(Clock::Wire, "");
    let request = packet(3, 0x03, &[204, 0, 0x40, 0x0D, 0x03, 0]);
    let outgoing = line.receive(&request, BAUD, AT_ONCE);
    assert_eq!(heard(&outgoing), [Packet::status(3, 0, &[])]);
    assert_eq!(outgoing[0].due, AT_ONCE);
    assert_eq!(
        line.bench(AT_ONCE).now(),
        BYTE * 16 + Duration::from_millis(200) + BYTE * 11
    );
}

#[test]
fn in_real_time_delay_is_refused_and_answers_are_due_when_the_wire_has_carried_them() {
    let mut line = line(Clock::Real, "[photometer]\nid = 3\n");
    let host = Duration::from_millis(5);
    let outgoing = line.receive(&packet(3, 0x03, &[204, 0, 0x40, 0x0D, 0x03, 0]), BAUD, host);
    assert_eq!(heard(&outgoing), [Packet::status(3, 7, &[])]);
    assert_eq!(outgoing[0].due, host + BYTE * 16 + BYTE * 11);
    // Sent while the line is still taken: after it.
    let next = line.receive(&packet(1, 0x01, &[]), BAUD, host);
    assert_eq!(next[0].due, outgoing[0].due + BYTE * 10 + BYTE * 14);
}

#[test]
fn in_real_time_motion_goes_on_between_packets() {
    let mut line = line(Clock::Real, "");
    for params in [&[64, 0, 1][..], &[112, 0, 40, 0, 0, 0], &[116, 0, 0, 7, 0, 0]] {
        line.receive(&packet(1, 0x03, params), BAUD, AT_ONCE);
    }
    let start = line.bench(Duration::from_millis(1)).pose().light;
    let end = line.bench(Duration::from_secs(5)).pose().light;
    assert!(
        (end.deg() - start.deg() - 22.5).abs() < 0.1,
        "from {start:?} to {end:?}"
    );
    assert_eq!(line.counters().goals, 1);
}

#[test]
fn a_client_at_another_baud_rate_is_not_heard() {
    let mut line = line(Clock::Wire, "");
    assert_eq!(line.receive(&packet(1, 0x01, &[]), 57_600, AT_ONCE), []);
    assert_eq!(line.counters().unheard, 1);
    assert_eq!(
        line.receive(&packet(1, 0x01, &[]), 1_020_000, AT_ONCE).len(),
        1,
        "2 % off is near enough"
    );
    // A new baud rate counts after the answer.
    assert_eq!(line.receive(&packet(1, 0x03, &[8, 0, 1]), BAUD, AT_ONCE).len(), 1);
    assert_eq!(line.receive(&packet(1, 0x01, &[]), BAUD, AT_ONCE), []);
    assert_eq!(line.receive(&packet(1, 0x01, &[]), 57_600, AT_ONCE).len(), 1);
}

#[test]
fn a_rebooting_servo_is_deaf_until_it_is_up() {
    let mut line = line(Clock::Real, "boot_ms = 300\n");
    assert_eq!(line.receive(&packet(1, 0x08, &[]), BAUD, AT_ONCE).len(), 1);
    assert_eq!(
        line.receive(&packet(1, 0x01, &[]), BAUD, Duration::from_millis(100)),
        []
    );
    assert_eq!(
        line.receive(&packet(1, 0x01, &[]), BAUD, Duration::from_millis(400))
            .len(),
        1
    );
}

#[test]
fn an_id_that_is_cut_off_neither_hears_nor_answers() {
    let mut line = line(Clock::Wire, "");
    line.faults().silent.insert(1, Duration::ZERO);
    assert_eq!(line.receive(&packet(1, 0x03, &[64, 0, 1]), BAUD, AT_ONCE), []);
    line.faults().silent.clear();
    let torque = line.receive(&packet(1, 0x02, &[64, 0, 1, 0]), BAUD, AT_ONCE);
    assert_eq!(heard(&torque), [Packet::status(1, 0, &[0])]);
}

#[test]
fn an_echo_comes_before_the_answer() {
    let mut line = line(Clock::Real, "");
    line.faults().echo = true;
    let request = packet(1, 0x01, &[]);
    let outgoing = line.receive(&request, BAUD, AT_ONCE);
    assert_eq!(
        outgoing[0],
        Outgoing {
            due: BYTE * 10,
            bytes: request
        }
    );
    assert_eq!(outgoing[1].bytes.len(), STATUS_LENGTH + 3);
}

#[test]
fn a_late_answer_comes_late_even_in_wire_time() {
    let mut line = line(Clock::Wire, "");
    line.faults().late_reply = 1.0;
    line.faults().late_by = Duration::from_millis(50);
    let outgoing = line.receive(&packet(1, 0x01, &[]), BAUD, Duration::from_secs(2));
    assert_eq!(outgoing[0].due, Duration::from_millis(2050));
}

#[test]
fn a_packet_in_pieces_and_two_in_one_piece_are_heard() {
    let mut line = line(Clock::Wire, "");
    let ping = packet(1, 0x01, &[]);
    assert_eq!(line.receive(&ping[..4], BAUD, AT_ONCE), []);
    assert_eq!(line.receive(&ping[4..], BAUD, AT_ONCE).len(), 1);
    assert_eq!(
        line.receive(&[ping.clone(), ping].concat(), BAUD, AT_ONCE).len(),
        2
    );
    assert_eq!(line.counters().packets, 3);
}
