use std::f64::consts::PI;
use std::time::Duration;

use arms::ArmAngle;
use proptest::prelude::*;

use crate::{Bench, Clock, Device, Disturbance, Fault, Refusal};

fn us(us: u64) -> Duration {
    Duration::from_micros(us)
}

/// The default rig; the arms stand at −45° and 45°.
fn bench(sim: &str) -> Bench {
    let rig = rig::RigFile::parse(&format!("[sim]\n{sim}"), "test.toml".as_ref()).unwrap();
    Bench::new(&rig).unwrap()
}

const IDEAL: &str = "imperfections = \"none\"\nspecimen = \"lambert:0.5\"";

fn photometer(bench: &mut Bench) -> &mut dyn Device {
    bench.device(rig::Device::Photometer)
}

fn read(bench: &mut Bench, address: u16, size: u16) -> u64 {
    let mut bytes = photometer(bench).read(address, size).unwrap();
    bytes.resize(8, 0);
    u64::from_le_bytes(bytes.try_into().unwrap())
}

fn write(bench: &mut Bench, address: u16, size: usize, value: u64) -> Result<(), Refusal> {
    photometer(bench).write(address, &value.to_le_bytes()[..size])
}

fn trigger(bench: &mut Bench, integration_us: u32, gain: u8) -> Result<(), Refusal> {
    let mut bytes = integration_us.to_le_bytes().to_vec();
    bytes.extend([gain, 1]);
    photometer(bench).write(104, &bytes)
}

fn disturb(bench: &mut Bench, what: Disturbance) {
    bench.schedule(Fault {
        device: rig::Device::Photometer,
        at: Duration::ZERO,
        what,
    });
}

#[test]
fn initial_values_are_the_documented_ones() {
    let mut bench = bench(IDEAL);
    let documented = [
        (0, 2, 0x4750),
        (6, 1, 1),
        (7, 1, 3),
        (8, 1, 3),
        (9, 1, 0),
        (64, 1, 0),
        (68, 1, 2),
        (70, 1, 0),
        (98, 1, 0),
        (104, 4, 1000),
        (108, 1, 0),
        (109, 1, 0),
        (120, 1, 0),
        (124, 4, 0),
        (132, 4, 0),
        (152, 1, 23),
        (156, 4, 0),
        (200, 1, 1),
    ];
    for (address, size, value) in documented {
        assert_eq!(read(&mut bench, address, size), value, "address {address}");
    }
}

#[test]
fn a_trigger_makes_a_reading_of_the_lit_specimen() {
    let mut bench = bench(IDEAL);
    write(&mut bench, 64, 1, 1).unwrap();
    bench.advance_to(us(5_000));
    trigger(&mut bench, 20_000, 1).unwrap();
    assert_eq!(
        (read(&mut bench, 120, 1), read(&mut bench, 124, 4)),
        (1, 1),
        "integrating, counted at once"
    );
    bench.advance_to(us(24_999));
    assert_eq!((read(&mut bench, 120, 1), read(&mut bench, 132, 4)), (1, 0));
    bench.advance_to(us(25_000));
    assert_eq!(read(&mut bench, 120, 1), 2);
    let expected = (0.5 / PI * 45f64.to_radians().cos() * 20_000.0 * 16.0).round() as u64;
    for address in [132, 136, 140] {
        assert_eq!(read(&mut bench, address, 4), expected);
    }
    assert_eq!(read(&mut bench, 144, 4), 100_000, "the monitor integrates at ×1");
    assert_eq!((read(&mut bench, 121, 1), read(&mut bench, 128, 4)), (1, 20_000));
    assert_eq!(read(&mut bench, 148, 4), 1_500, "mid-integration in 10 µs");
}

#[test]
fn the_lamp_counts_only_while_it_is_on() {
    let mut bench = bench(IDEAL);
    trigger(&mut bench, 100_000, 0).unwrap();
    bench.advance_to(us(30_000));
    write(&mut bench, 64, 1, 1).unwrap();
    bench.advance_to(us(70_000));
    write(&mut bench, 64, 1, 0).unwrap();
    bench.advance_to(us(100_000));
    assert_eq!(read(&mut bench, 144, 4), 200_000);
}

#[test]
fn a_full_channel_saturates() {
    let mut bench = bench("imperfections = \"none\"\nspecimen = \"lambert:1\"");
    write(&mut bench, 64, 1, 1).unwrap();
    trigger(&mut bench, 100_000, 2).unwrap();
    bench.advance_to(us(100_000));
    assert_eq!(
        (read(&mut bench, 120, 1), read(&mut bench, 132, 4)),
        (3, 1_048_575)
    );
}

#[test]
fn a_second_trigger_is_refused_and_changes_nothing() {
    let mut bench = bench(IDEAL);
    trigger(&mut bench, 20_000, 1).unwrap();
    assert_eq!(trigger(&mut bench, 10, 2), Err(Refusal::DataRange));
    assert_eq!((read(&mut bench, 104, 4), read(&mut bench, 124, 4)), (20_000, 1));
    assert_eq!(write(&mut bench, 104, 4, 9), Err(Refusal::DataRange));
    assert_eq!(write(&mut bench, 108, 1, 3), Err(Refusal::DataRange));
    assert_eq!(write(&mut bench, 132, 4, 1), Err(Refusal::Access));
}

#[test]
fn the_lamp_locks_the_eeprom() {
    let mut bench = bench(IDEAL);
    write(&mut bench, 64, 1, 1).unwrap();
    assert_eq!(write(&mut bench, 7, 1, 4), Err(Refusal::Access));
    write(&mut bench, 64, 1, 0).unwrap();
    write(&mut bench, 7, 1, 4).unwrap();
    assert_eq!(photometer(&mut bench).id(), 4);
}

#[test]
fn the_watchdog_puts_the_lamp_out_until_it_is_cleared() {
    let mut bench = bench(IDEAL);
    write(&mut bench, 98, 1, 5).unwrap();
    bench.advance_to(us(1_000_000));
    assert_eq!(read(&mut bench, 98, 1), 5, "nothing to put out yet");
    write(&mut bench, 64, 1, 1).unwrap();
    bench.advance_to(us(1_099_999));
    assert_eq!(read(&mut bench, 64, 1), 1);
    bench.advance_to(us(1_100_000));
    assert_eq!((read(&mut bench, 64, 1), read(&mut bench, 98, 1)), (0, 255));
    assert_eq!(write(&mut bench, 64, 1, 1), Err(Refusal::DataRange));
    write(&mut bench, 98, 1, 0).unwrap();
    write(&mut bench, 64, 1, 1).unwrap();
    assert_eq!(read(&mut bench, 64, 1), 1);
}

#[test]
fn a_lamp_failure_keeps_it_dark_until_a_reboot() {
    let mut bench = bench(IDEAL);
    write(&mut bench, 64, 1, 1).unwrap();
    disturb(&mut bench, Disturbance::HardwareError(1 << 5));
    assert!(photometer(&mut bench).alert());
    write(&mut bench, 64, 1, 1).unwrap();
    assert_eq!(read(&mut bench, 64, 1), 0);
    trigger(&mut bench, 1000, 0).unwrap();
    bench.advance_to(us(1000));
    photometer(&mut bench).reboot();
    assert!(!photometer(&mut bench).listens());
    bench.advance_to(us(501_000));
    assert!(photometer(&mut bench).listens() && !photometer(&mut bench).alert());
    assert_eq!(
        (read(&mut bench, 124, 4), read(&mut bench, 120, 1)),
        (0, 0),
        "RAM is lost"
    );
    assert_eq!(read(&mut bench, 156, 4), 50_000, "the clock starts again");
    write(&mut bench, 64, 1, 1).unwrap();
    assert_eq!(read(&mut bench, 64, 1), 1);
}

#[test]
fn delay_is_for_wire_time_alone() {
    let mut bench = bench(IDEAL);
    write(&mut bench, 204, 4, 2_500).unwrap();
    assert_eq!((bench.take_delay(), bench.take_delay()), (Some(us(2_500)), None));
    bench.set_clock(Clock::Real);
    assert_eq!(read(&mut bench, 200, 1), 0);
    assert_eq!(write(&mut bench, 204, 4, 2_500), Err(Refusal::Access));
    assert_eq!(bench.take_delay(), None);
}

#[test]
fn the_clock_has_24_bits() {
    let mut bench = bench(IDEAL);
    let wrap_us = (1u64 << 24) * 10;
    bench.advance_to(us(wrap_us - 10));
    assert_eq!(read(&mut bench, 156, 4), (1 << 24) - 1);
    bench.advance_to(us(wrap_us));
    assert_eq!(read(&mut bench, 156, 4), 0);
}

#[test]
fn a_moving_arm_is_integrated_over() {
    let mut bench = bench(IDEAL);
    write(&mut bench, 64, 1, 1).unwrap();
    let light = bench.device(rig::Device::Light);
    light.write(112, &40u32.to_le_bytes()).unwrap();
    light.write(64, &[1]).unwrap();
    light.write(116, &1100u32.to_le_bytes()).unwrap();
    bench.advance_to(us(50_000));
    let from = bench.pose().light;
    trigger(&mut bench, 200_000, 1).unwrap();
    bench.advance_to(us(250_000));
    let to = bench.pose().light;
    // At constant speed the mean of cos α is (sin α₂ − sin α₁) / (α₂ − α₁).
    let mean = |a: ArmAngle, b: ArmAngle| (b.rad().sin() - a.rad().sin()) / (b - a);
    let expected = (0.5 / PI * mean(from, to) * 200_000.0 * 16.0).round() as u64;
    assert_eq!(read(&mut bench, 132, 4), expected);
    assert!((to - from).abs() > 0.05, "it moved by {} rad", to - from);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// A reading does not depend on how often the bench is polled meanwhile, whatever moves and is switched.
    #[test]
    fn prop_readings_do_not_depend_on_polling(step_us in 10u64..40_000, goal in 1100u32..2000, seed in 0u32..1000) {
        let run = |step_us: u64| {
            let mut bench = bench(&format!("specimen = \"chrome\"\nseed = {seed}"));
            let pass = |bench: &mut Bench, until_us: u64| {
                let mut t = bench.now();
                while t < us(until_us) {
                    t = (t + us(step_us)).min(us(until_us));
                    bench.advance_to(t);
                }
            };
            write(&mut bench, 64, 1, 1).unwrap();
            pass(&mut bench, 30_000);
            let light = bench.device(rig::Device::Light);
            light.write(108, &[&5u32.to_le_bytes()[..], &60u32.to_le_bytes()].concat()).unwrap();
            light.write(64, &[1]).unwrap();
            light.write(116, &goal.to_le_bytes()).unwrap();
            trigger(&mut bench, 30_000, 1).unwrap();
            pass(&mut bench, 45_000);
            bench.device(rig::Device::Light).write(116, &1500u32.to_le_bytes()).unwrap();
            pass(&mut bench, 100_000);
            photometer(&mut bench).read(120, 40).unwrap()
        };
        prop_assert_eq!(run(step_us), run(100_000));
    }
}
