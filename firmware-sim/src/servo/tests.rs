use std::time::Duration;

use proptest::prelude::*;

use crate::{Bench, Device, Disturbance, Fault, Refusal};

fn s(seconds: f64) -> Duration {
    Duration::from_secs_f64(seconds)
}

/// The default rig with its imperfections off; the light servo stands at −45°, count 1536.
fn bench(sim: &str) -> Bench {
    let text = format!("[sim]\nimperfections = \"none\"\n{sim}");
    let rig = rig::RigFile::parse(&text, "test.toml".as_ref()).unwrap();
    Bench::new(&rig).unwrap()
}

fn light(bench: &mut Bench) -> &mut dyn Device {
    bench.device(rig::Device::Light)
}

fn read(bench: &mut Bench, address: u16, size: u16) -> i64 {
    let mut bytes = light(bench).read(address, size).unwrap();
    let sign = if bytes[bytes.len() - 1] & 0x80 != 0 {
        0xFF
    } else {
        0
    };
    bytes.resize(8, if size == 1 { 0 } else { sign });
    i64::from_le_bytes(bytes.try_into().unwrap())
}

fn write(bench: &mut Bench, address: u16, size: usize, value: i64) -> Result<(), Refusal> {
    light(bench).write(address, &value.to_le_bytes()[..size])
}

/// Torque on, profile set, goal given.
fn go(bench: &mut Bench, velocity: i64, acceleration: i64, goal: i64) {
    write(bench, 112, 4, velocity).unwrap();
    write(bench, 108, 4, acceleration).unwrap();
    write(bench, 64, 1, 1).unwrap();
    write(bench, 116, 4, goal).unwrap();
}

/// Seconds until the motion is over.
fn motion_s(bench: &mut Bench) -> f64 {
    let start = bench.now();
    while read(bench, 122, 1) == 1 {
        let next = bench.next_event().unwrap();
        bench.advance_to(next);
    }
    (bench.now() - start).as_secs_f64()
}

#[test]
fn profiles_take_as_long_as_the_manual_says() {
    // Velocity and acceleration registers, degrees, seconds.
    let manual = [
        (20, 5, 1.0, 0.193),
        (20, 5, 5.0, 0.432),
        (20, 5, 90.0, 3.53),
        (20, 5, 160.0, 6.08),
        (100, 20, 90.0, 0.975),
    ];
    for (velocity, acceleration, deg, seconds) in manual {
        let mut bench = bench("start_light_deg = -80.0\nstart_sensor_deg = 88.0");
        let from = read(&mut bench, 132, 4);
        go(
            &mut bench,
            velocity,
            acceleration,
            from + (deg / 360.0 * 4096.0_f64).round() as i64,
        );
        let took = motion_s(&mut bench);
        // A degree is no whole number of counts: 11 instead of 11.4.
        assert!(
            (took / seconds - 1.0).abs() < 0.02,
            "{deg}° at V={velocity}, A={acceleration} took {took} s, not {seconds} s"
        );
    }
}

#[test]
fn a_goal_is_reached_and_said_to_be() {
    let mut bench = bench("");
    go(&mut bench, 43, 9, 1600);
    assert_eq!(
        read(&mut bench, 123, 1) & 0b11,
        0b10,
        "profile ongoing, not in position"
    );
    bench.advance_to(s(10.0));
    assert_eq!(read(&mut bench, 132, 4), 1600);
    assert_eq!(read(&mut bench, 123, 1), 1, "in position, nothing ongoing");
    assert_eq!(read(&mut bench, 122, 1), 0);
}

fn disturb(bench: &mut Bench, at: f64, what: Disturbance) {
    bench.schedule(Fault {
        device: rig::Device::Light,
        at: s(at),
        what,
    });
}

#[test]
fn initial_values_are_the_manuals() {
    let mut bench = bench("");
    // Address, size, XM430-W350.
    let manual = [
        (0, 2, 1020),
        (10, 1, 0),
        (11, 1, 3),
        (12, 1, 255),
        (13, 1, 2),
        (20, 4, 0),
        (24, 4, 10),
        (31, 1, 80),
        (32, 2, 160),
        (34, 2, 95),
        (36, 2, 885),
        (38, 2, 1193),
        (44, 4, 200),
        (63, 1, 52),
        (64, 1, 0),
        (68, 1, 2),
        (76, 2, 1920),
        (78, 2, 100),
        (84, 2, 800),
        (98, 1, 0),
        (108, 4, 0),
        (112, 4, 0),
        (168, 2, 224),
        (222, 2, 251),
        (224, 1, 0),
        (578, 2, 634),
        (632, 2, 661),
    ];
    for (address, size, value) in manual {
        assert_eq!(read(&mut bench, address, size), value, "address {address}");
    }
    assert_eq!(
        light(&mut bench).read(0, 147).unwrap().len(),
        147,
        "holes read as zero"
    );
    assert_eq!(
        light(&mut bench).read(661, 2),
        Err(Refusal::Access),
        "the table ends at 661"
    );
}

/// The default rig with a light servo of another model, at −45°.
fn bench_of(model: &str, zero_deg: f64) -> Bench {
    let text =
        format!("[light]\nmodel = \"{model}\"\nzero_deg = {zero_deg}\n[sim]\nimperfections = \"none\"\n");
    Bench::new(&rig::RigFile::parse(&text, "test.toml".as_ref()).unwrap()).unwrap()
}

/// Address, size and initial value of what differs from the XM430, from the e-manual page of each model.
#[test]
fn initial_values_of_other_models_are_those_of_their_pages() {
    type Values = &'static [(u16, u16, i64)];
    let models: [(&str, f64, Values); 8] = [
        (
            "XH430-V350-R",
            180.0,
            &[
                (0, 2, 1040),
                (32, 2, 300),
                (34, 2, 110),
                (38, 2, 689),
                (44, 4, 135),
                (144, 2, 240),
            ],
        ),
        (
            "XW540-T140",
            180.0,
            &[(0, 2, 1180), (44, 4, 304), (84, 2, 800), (65, 1, 0)],
        ),
        (
            "XL430-W250",
            180.0,
            &[
                (0, 2, 1060),
                (31, 1, 72),
                (32, 2, 140),
                (34, 2, 60),
                (44, 4, 415),
                (80, 2, 4000),
                (84, 2, 640),
                (144, 2, 111),
            ],
        ),
        (
            "XC430-W240-T",
            180.0,
            &[(0, 2, 1080), (32, 2, 160), (44, 4, 306), (84, 2, 700)],
        ),
        (
            "XL330-M288-T",
            180.0,
            &[
                (0, 2, 1200),
                (31, 1, 70),
                (32, 2, 70),
                (34, 2, 35),
                (38, 2, 1750),
                (44, 4, 445),
                (63, 1, 53),
                (84, 2, 400),
                (144, 2, 50),
                (168, 2, 208),
                (206, 2, 227),
            ],
        ),
        (
            "XC330-T181-T",
            180.0,
            &[
                (0, 2, 1210),
                (32, 2, 140),
                (34, 2, 55),
                (38, 2, 910),
                (44, 4, 510),
                (63, 1, 52),
            ],
        ),
        (
            "MX-28AR",
            180.0,
            &[
                (0, 2, 30),
                (40, 4, 32_767),
                (44, 4, 230),
                (84, 2, 850),
                (632, 2, 661),
            ],
        ),
        (
            "PH54-200-S500-R",
            0.0,
            &[
                (0, 2, 2020),
                (24, 4, 20),
                (32, 2, 350),
                (34, 2, 150),
                (36, 2, 2009),
                (38, 2, 22_740),
                (40, 4, 9982),
                (44, 4, 2900),
                (63, 1, 52),
                (168, 2, 634),
                (422, 2, 761),
                (516, 1, 2),
                (524, 2, 2209),
                (526, 2, 6153),
                (532, 2, 314),
                (546, 1, 0),
                (592, 2, 240),
                (580, 4, -125_481),
            ],
        ),
    ];
    for (model, zero_deg, values) in models {
        let mut bench = bench_of(model, zero_deg);
        for &(address, size, value) in values {
            assert_eq!(
                read(&mut bench, address, size),
                value,
                "address {address} of an {model}"
            );
        }
    }
}

#[test]
fn what_a_model_lacks_cannot_be_written() {
    let mut xl430 = bench_of("XL430-W250", 180.0);
    assert_eq!(
        write(&mut xl430, 38, 2, 100),
        Err(Refusal::Access),
        "Current Limit"
    );
    assert_eq!(
        write(&mut xl430, 102, 2, 100),
        Err(Refusal::Access),
        "Goal Current"
    );
    assert_eq!(
        write(&mut xl430, 11, 1, 5),
        Err(Refusal::DataRange),
        "current-based position"
    );
    let mut xw430 = bench_of("XW430-T200-R", 180.0);
    assert_eq!(write(&mut xw430, 65, 1, 1), Err(Refusal::Access), "LED");
    let mut p = bench_of("PM54-040-S250-R", 0.0);
    assert_eq!(
        write(&mut p, 64, 1, 1),
        Err(Refusal::Access),
        "what the X series has there"
    );
    assert_eq!(
        write(&mut p, 560, 4, 2841),
        Err(Refusal::DataLimit),
        "faster than the limit"
    );
    assert_eq!(write(&mut p, 556, 4, 11_038), Err(Refusal::DataLimit));
    write(&mut p, 512, 1, 1).unwrap();
    assert_eq!(
        write(&mut p, 168, 2, 512),
        Err(Refusal::Access),
        "indirect addresses are EEPROM"
    );
}

/// t₃ = t₁ + t₂ with t₁ = 600 · V / A ms (e-manual, PH54-200-S500-R, "Profile Velocity(560)"), t₂ = ΔP / v.
#[test]
fn a_p_series_moves_in_its_own_units() {
    let mut bench = bench_of("PH54-200-S500-R", 0.0);
    write(&mut bench, 560, 4, 1000).unwrap();
    write(&mut bench, 556, 4, 2000).unwrap();
    write(&mut bench, 512, 1, 1).unwrap();
    // 36° on: a tenth of a turn at 10 rev/min.
    write(&mut bench, 564, 4, -125_481 + 100_385).unwrap();
    let start = bench.now();
    while read(&mut bench, 570, 1) == 1 {
        let next = bench.next_event().unwrap();
        bench.advance_to(next);
    }
    let took_s = (bench.now() - start).as_secs_f64();
    assert!((took_s - (0.3 + 0.6)).abs() < 1e-3, "{took_s} s");
    assert_eq!(read(&mut bench, 580, 4), -25_096);
    let light_deg = bench.pose().light.deg();
    assert!((light_deg + 9.0).abs() < 1e-3, "{light_deg}");
}

#[test]
fn a_backup_brings_the_eeprom_back_and_nothing_else() {
    let mut bench = bench("");
    let [store, restore] = [1, 2].map(|what| [what, b'C', b'T', b'R', b'L']);
    assert_eq!(
        light(&mut bench).back_up(&restore),
        Err(Refusal::Result),
        "there is none"
    );
    assert_eq!(read(&mut bench, 147, 1), 0);
    light(&mut bench).back_up(&store).unwrap();
    light(&mut bench).factory_reset(2).unwrap();
    assert_eq!(read(&mut bench, 147, 1), 1, "it outlives a reset");
    assert_eq!((read(&mut bench, 52, 4), read(&mut bench, 48, 4)), (0, 4095));
    write(&mut bench, 84, 2, 640).unwrap();
    write(&mut bench, 64, 1, 1).unwrap();
    assert_eq!(
        light(&mut bench).back_up(&restore),
        Err(Refusal::Access),
        "locked"
    );
    write(&mut bench, 64, 1, 0).unwrap();
    light(&mut bench).back_up(&restore).unwrap();
    assert_eq!((read(&mut bench, 52, 4), read(&mut bench, 48, 4)), (1046, 3050));
    assert_eq!(read(&mut bench, 84, 2), 640, "gains are RAM");
    assert_eq!(
        light(&mut bench).back_up(&[1, b'C', b'T', b'R']),
        Err(Refusal::DataRange)
    );
    assert_eq!(
        light(&mut bench).back_up(&[3, b'C', b'T', b'R', b'L']),
        Err(Refusal::DataRange)
    );
    let mut mx = bench_of("MX-64", 180.0);
    assert_eq!(light(&mut mx).back_up(&store), Err(Refusal::Instruction));
}

#[test]
fn the_workshop_has_set_what_the_rig_file_says() {
    let mut bench = bench("");
    assert_eq!(light(&mut bench).baud(), 1_000_000);
    assert_eq!(light(&mut bench).return_delay(), Duration::ZERO);
    // −88° and 88° about count 2048.
    assert_eq!((read(&mut bench, 52, 4), read(&mut bench, 48, 4)), (1046, 3050));
    assert_eq!(read(&mut bench, 132, 4), 1536);
}

#[test]
fn writes_are_refused_as_the_manual_says_and_taken_whole_or_not_at_all() {
    let mut bench = bench("");
    let refusals = [
        (132, 4, 0, Refusal::Access),
        (66, 1, 0, Refusal::Access),
        (661, 2, 0, Refusal::Access),
        (116, 2, 0, Refusal::DataLength),
        (117, 1, 0, Refusal::DataLength),
        (64, 1, 2, Refusal::DataRange),
        (11, 1, 2, Refusal::DataRange),
        (98, 1, 128, Refusal::DataRange),
        (112, 4, 32_768, Refusal::DataRange),
        (116, 4, 1045, Refusal::DataLimit),
        (116, 4, 3051, Refusal::DataLimit),
        (104, 4, 201, Refusal::DataLimit),
        (104, 4, -201, Refusal::DataLimit),
        (102, 2, 1194, Refusal::DataLimit),
    ];
    for (address, size, value, refusal) in refusals {
        assert_eq!(
            write(&mut bench, address, size, value),
            Err(refusal),
            "{value} to {address}"
        );
    }
    // Velocity would do, the goal beside it would not.
    let both = [100i32.to_le_bytes(), 4000i32.to_le_bytes()].concat();
    assert_eq!(light(&mut bench).write(112, &both), Err(Refusal::DataLimit));
    assert_eq!(read(&mut bench, 112, 4), 0);
}

#[test]
fn torque_locks_the_eeprom_and_sets_the_goal_to_the_present_position() {
    let mut bench = bench("");
    write(&mut bench, 116, 4, 2000).unwrap();
    write(&mut bench, 64, 1, 1).unwrap();
    assert_eq!(read(&mut bench, 116, 4), 1536);
    assert_eq!(write(&mut bench, 9, 1, 0), Err(Refusal::Access));
    bench.advance_to(s(1.0));
    assert_eq!(read(&mut bench, 132, 4), 1536, "nothing moved");
    write(&mut bench, 64, 1, 0).unwrap();
    write(&mut bench, 9, 1, 10).unwrap();
    assert_eq!(light(&mut bench).return_delay(), Duration::from_micros(20));
}

#[test]
fn no_torque_no_motion() {
    let mut bench = bench("");
    write(&mut bench, 116, 4, 2000).unwrap();
    bench.advance_to(s(1.0));
    assert_eq!(read(&mut bench, 132, 4), 1536);
    go(&mut bench, 43, 9, 2000);
    bench.advance_to(s(1.5));
    write(&mut bench, 64, 1, 0).unwrap();
    let stopped = read(&mut bench, 132, 4);
    bench.advance_to(s(3.0));
    assert!((1537..2000).contains(&stopped));
    assert_eq!(read(&mut bench, 132, 4), stopped);
}

#[test]
fn a_goal_without_profile_is_a_step_of_the_trajectory() {
    let mut bench = bench("");
    go(&mut bench, 0, 0, 2036);
    assert_eq!(read(&mut bench, 140, 4), 2036);
    assert_eq!(read(&mut bench, 123, 1), 0b1000, "following error, no profile");
    bench.advance_to(s(0.1));
    // The motor does what it can, its velocity limit of 200 · 15.63 counts/s.
    assert_eq!(read(&mut bench, 128, 4), 200);
    assert_eq!(read(&mut bench, 132, 4), 1536 + 313);
    bench.advance_to(s(0.2));
    assert_eq!(read(&mut bench, 132, 4), 2036);
}

#[test]
fn profile_types_and_durations() {
    // Velocity, acceleration, drive mode, profile type, seconds for 1000 counts.
    let cases: [(i64, i64, i64, &[i64], f64); 6] = [
        (40, 0, 0, &[1], 63.967 * 1000.0 / 40.0 / 1e3),
        (
            40,
            10,
            0,
            &[3],
            (64.033 * 40.0 / 10.0 + 63.967 * 1000.0 / 40.0) / 1e3,
        ),
        (1000, 10, 0, &[2], 2.0 * (1000.0 / 2441.4_f64).sqrt()),
        (1500, 300, 4, &[3], 1.5),
        (1500, 0, 4, &[1], 1.5),
        // The acceleration time is at most half of the whole: a triangle, but for rounding.
        (1500, 1400, 4, &[2, 3], 1.5),
    ];
    for (velocity, acceleration, mode, kinds, seconds) in cases {
        let mut bench = bench("");
        write(&mut bench, 10, 1, mode).unwrap();
        go(&mut bench, velocity, acceleration, 2536);
        let case = format!("V={velocity}, A={acceleration}, drive mode {mode}");
        let kind = read(&mut bench, 123, 1) >> 4;
        assert!(kinds.contains(&kind), "{case}: type {kind}");
        let took = motion_s(&mut bench);
        assert!(
            (took / seconds - 1.0).abs() < 1e-3,
            "{case} took {took} s, not {seconds} s"
        );
        assert_eq!(read(&mut bench, 132, 4), 2536, "{case}");
    }
}

#[test]
fn the_velocity_limit_bounds_a_profile() {
    let mut bench = bench("");
    write(&mut bench, 44, 4, 20).unwrap();
    go(&mut bench, 100, 0, 2536);
    bench.advance_to(s(0.5));
    assert_eq!(read(&mut bench, 128, 4), 20);
}

#[test]
fn a_new_goal_takes_over_from_the_present_velocity() {
    let mut bench = bench("");
    go(&mut bench, 40, 5, 2800);
    bench.advance_to(s(1.0));
    let (position, velocity) = (read(&mut bench, 132, 4), read(&mut bench, 128, 4));
    assert_eq!(velocity, 40);
    write(&mut bench, 116, 4, 1400).unwrap();
    assert_eq!(
        (read(&mut bench, 132, 4), read(&mut bench, 128, 4)),
        (position, velocity)
    );
    bench.advance_to(s(1.1));
    assert!(read(&mut bench, 132, 4) > position, "it does not turn at once");
    bench.advance_to(s(8.0));
    assert_eq!(read(&mut bench, 132, 4), 1400);
}

#[test]
fn the_homing_offset_shifts_the_register_and_is_ignored_beyond_a_quarter_turn() {
    let mut bench = bench("");
    write(&mut bench, 20, 4, 100).unwrap();
    assert_eq!(read(&mut bench, 132, 4), 1636);
    go(&mut bench, 100, 0, 1736);
    bench.advance_to(s(2.0));
    assert_eq!(read(&mut bench, 132, 4), 1736);
    assert!(
        (bench.pose().light.deg() + 36.2).abs() < 0.05,
        "the arm went by 100 counts"
    );
    write(&mut bench, 64, 1, 0).unwrap();
    write(&mut bench, 20, 4, 1025).unwrap();
    assert_eq!(read(&mut bench, 132, 4), 1636, "ignored in position mode");
    write(&mut bench, 11, 1, 4).unwrap();
    assert_eq!(
        read(&mut bench, 132, 4),
        1636 + 1025,
        "taken in extended position mode"
    );
}

#[test]
fn reverse_mode_turns_the_other_way() {
    let mut bench = bench("");
    write(&mut bench, 10, 1, 1).unwrap();
    let from = read(&mut bench, 132, 4);
    assert_eq!(from, 4096 - 1536);
    go(&mut bench, 100, 0, from + 100);
    bench.advance_to(s(1.0));
    assert_eq!(read(&mut bench, 132, 4), from + 100);
    assert!((bench.pose().light.deg() + 53.8).abs() < 0.05);
}

#[test]
fn a_goal_may_switch_the_torque_on() {
    let mut bench = bench("");
    write(&mut bench, 10, 1, 8).unwrap();
    write(&mut bench, 112, 4, 100).unwrap();
    write(&mut bench, 116, 4, 1600).unwrap();
    assert_eq!(read(&mut bench, 64, 1), 1);
    bench.advance_to(s(1.0));
    assert_eq!(read(&mut bench, 132, 4), 1600);
}

#[test]
fn the_watchdog_stops_a_servo_that_hears_nothing() {
    let mut bench = bench("");
    go(&mut bench, 20, 5, 2800);
    write(&mut bench, 98, 1, 10).unwrap();
    bench.advance_to(s(0.15));
    light(&mut bench).heard();
    bench.advance_to(s(0.349_999));
    assert_eq!(read(&mut bench, 98, 1), 10);
    bench.advance_to(s(0.350_001));
    assert_eq!((read(&mut bench, 98, 1), read(&mut bench, 122, 1)), (255, 0));
    let stopped = read(&mut bench, 132, 4);
    assert_eq!(write(&mut bench, 116, 4, 2000), Err(Refusal::DataRange));
    assert_eq!(write(&mut bench, 98, 1, 5), Err(Refusal::DataRange));
    bench.advance_to(s(1.0));
    assert_eq!(read(&mut bench, 132, 4), stopped);
    write(&mut bench, 98, 1, 0).unwrap();
    write(&mut bench, 116, 4, 2000).unwrap();
    bench.advance_to(s(9.0));
    assert_eq!(read(&mut bench, 132, 4), 2000);
}

#[test]
fn overload_takes_the_torque_until_a_reboot() {
    let mut bench = bench("");
    disturb(&mut bench, 0.5, Disturbance::OVERLOAD);
    go(&mut bench, 43, 9, 2048);
    bench.advance_to(s(2.0));
    assert_eq!((read(&mut bench, 64, 1), read(&mut bench, 70, 1)), (0, 32));
    assert!(light(&mut bench).alert());
    let stopped = read(&mut bench, 132, 4);
    write(&mut bench, 64, 1, 1).unwrap();
    write(&mut bench, 116, 4, 2000).unwrap();
    bench.advance_to(s(4.0));
    assert_eq!(
        (read(&mut bench, 64, 1), read(&mut bench, 132, 4)),
        (0, stopped),
        "ignored"
    );
    light(&mut bench).reboot();
    assert!(!light(&mut bench).listens());
    bench.advance_to(s(4.5));
    assert!(light(&mut bench).listens());
    assert_eq!(
        (
            read(&mut bench, 70, 1),
            read(&mut bench, 112, 4),
            read(&mut bench, 132, 4)
        ),
        (0, 0, stopped)
    );
    go(&mut bench, 43, 9, 2000);
    bench.advance_to(s(9.0));
    assert_eq!(read(&mut bench, 132, 4), 2000);
}

#[test]
fn an_error_that_shutdown_does_not_name_only_alerts() {
    let mut bench = bench("");
    disturb(&mut bench, 0.5, Disturbance::ALERT);
    go(&mut bench, 43, 9, 2048);
    bench.advance_to(s(9.0));
    assert!(light(&mut bench).alert());
    assert_eq!((read(&mut bench, 64, 1), read(&mut bench, 132, 4)), (1, 2048));
}

#[test]
fn a_stalled_shaft_falls_behind_and_goes_on() {
    let mut bench = bench("");
    disturb(&mut bench, 0.5, Disturbance::Stall(s(2.0)));
    go(&mut bench, 43, 9, 2048);
    bench.advance_to(s(0.5));
    let stuck = read(&mut bench, 132, 4);
    bench.advance_to(s(1.5));
    assert_eq!(read(&mut bench, 132, 4), stuck);
    assert_eq!(read(&mut bench, 123, 1) & 0b1000, 0b1000, "following error");
    assert_eq!(read(&mut bench, 126, 2), 1193, "at its current limit");
    bench.advance_to(s(9.0));
    assert_eq!(read(&mut bench, 132, 4), 2048);
}

#[test]
fn the_shaft_is_late_by_the_lag() {
    let mut bench = bench("following_lag_ms = 20.0");
    go(&mut bench, 100, 0, 2536);
    bench.advance_to(s(0.2));
    let (planned, present) = (read(&mut bench, 140, 4), read(&mut bench, 132, 4));
    // 20 ms at 1563 counts/s, both rounded.
    assert!(
        (31..=32).contains(&(planned - present)),
        "{} counts behind",
        planned - present
    );
    bench.advance_to(s(5.0));
    assert_eq!(read(&mut bench, 132, 4), 2536);
}

#[test]
fn indirect_data_show_and_take_what_their_addresses_say() {
    let mut bench = bench("");
    // Torque enable, present position, goal position.
    let map = [64u16, 132, 133, 134, 135, 116, 117, 118, 119];
    let bytes: Vec<u8> = map.iter().flat_map(|address| address.to_le_bytes()).collect();
    light(&mut bench).write(168, &bytes).unwrap();
    go(&mut bench, 100, 0, 1600);
    bench.advance_to(s(1.0));
    let shown = light(&mut bench).read(224, 9).unwrap();
    assert_eq!(shown, [1, 0x40, 6, 0, 0, 0x40, 6, 0, 0]);
    light(&mut bench).write(229, &1700i32.to_le_bytes()).unwrap();
    assert_eq!(read(&mut bench, 116, 4), 1700);
    assert_eq!(
        light(&mut bench).write(225, &[0; 4]),
        Err(Refusal::Access),
        "present position"
    );
    // A cell that leads nowhere else keeps what it is given.
    light(&mut bench).write(240, &[7]).unwrap();
    assert_eq!(read(&mut bench, 240, 1), 7);
}

#[test]
fn turns_are_lost_on_clear_and_reboot() {
    let mut bench = bench("");
    write(&mut bench, 11, 1, 4).unwrap();
    go(&mut bench, 200, 0, 6000);
    assert_eq!(
        light(&mut bench).clear(&[1, 0x44, 0x58, 0x4C, 0x22]),
        Err(Refusal::Result),
        "it moves"
    );
    bench.advance_to(s(5.0));
    assert_eq!(read(&mut bench, 132, 4), 6000);
    assert_eq!(light(&mut bench).clear(&[1, 0, 0, 0, 0]), Err(Refusal::DataRange));
    light(&mut bench).clear(&[1, 0x44, 0x58, 0x4C, 0x22]).unwrap();
    assert_eq!(read(&mut bench, 132, 4), 6000 - 4096);
    write(&mut bench, 116, 4, -3000).unwrap();
    bench.advance_to(s(10.0));
    assert_eq!(read(&mut bench, 132, 4), -3000);
    light(&mut bench).reboot();
    assert_eq!(read(&mut bench, 132, 4), 4096 - 3000);
}

#[test]
fn a_factory_reset_keeps_what_it_is_told_to() {
    for (option, id, baud) in [(0xFF, 1, 57_600), (1, 9, 57_600), (2, 9, 2_000_000)] {
        let mut bench = bench("");
        write(&mut bench, 7, 1, 9).unwrap();
        write(&mut bench, 8, 1, 4).unwrap();
        light(&mut bench).factory_reset(option).unwrap();
        assert_eq!(
            (light(&mut bench).id(), light(&mut bench).baud()),
            (id, baud),
            "option {option}"
        );
        assert_eq!(read(&mut bench, 9, 1), 250);
    }
    assert_eq!(light(&mut bench("")).factory_reset(3), Err(Refusal::DataRange));
}

#[test]
fn a_registered_instruction_shows() {
    let mut bench = bench("");
    for waits in [true, false] {
        light(&mut bench).registered(waits);
        assert_eq!(read(&mut bench, 69, 1), i64::from(waits));
    }
}

#[test]
fn other_modes_hold_the_shaft_still() {
    for mode in [0, 1, 16] {
        let mut bench = bench("");
        write(&mut bench, 11, 1, mode).unwrap();
        go(&mut bench, 43, 9, 2048);
        write(&mut bench, 104, 4, 100).unwrap();
        bench.advance_to(s(2.0));
        assert_eq!(read(&mut bench, 132, 4), 1536, "mode {mode}");
    }
}

#[test]
fn the_realtime_tick_wraps() {
    let mut bench = bench("");
    bench.advance_to(s(32.767));
    assert_eq!(read(&mut bench, 120, 2), 32_767);
    bench.advance_to(s(32.768));
    assert_eq!(read(&mut bench, 120, 2), 0);
}

/// What is written to a moving servo, and when.
fn commands() -> impl Strategy<Value = Vec<(u64, i64)>> {
    prop::collection::vec((1u64..1_500_000, 1100i64..3000), 1..6)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// In how many steps time passes changes nothing: positions after random goals, a stall and a watchdog that may
    /// trip are the same for a host that polls every `step` and for one that does not poll.
    #[test]
    fn prop_motion_does_not_depend_on_polling(
        commands in commands(), step_us in 10u64..1_000_000, velocity in 0i64..150, acceleration in 0i64..40,
        lag_ms in 0u32..30, backlash_deg in 0.0f64..0.5, stall in any::<bool>(),
    ) {
        let run = |step: Option<Duration>| {
            let mut bench = bench(&format!("following_lag_ms = {lag_ms}.0\nlight_backlash_deg = {backlash_deg}"));
            if stall {
                disturb(&mut bench, 0.7, Disturbance::Stall(s(0.4)));
            }
            go(&mut bench, velocity, acceleration, 1600);
            write(&mut bench, 98, 1, 60).unwrap();
            let mut seen = Vec::new();
            let mut t = Duration::ZERO;
            for &(after_us, goal) in &commands {
                let until = t + Duration::from_micros(after_us);
                // At most 200 polls, else this takes long.
                let step = step.map(|step| step.max((until - t) / 200));
                while let Some(step) = step && t + step < until {
                    t += step;
                    bench.advance_to(t);
                    read(&mut bench, 132, 4);
                }
                t = until;
                bench.advance_to(t);
                seen.push((bench.pose().light.deg(), light(&mut bench).read(98, 49).unwrap()));
                light(&mut bench).heard();
                let _refused_once_tripped = write(&mut bench, 116, 4, goal);
            }
            bench.advance_to(t + s(1.0));
            seen.push((bench.pose().light.deg(), light(&mut bench).read(98, 49).unwrap()));
            seen
        };
        prop_assert_eq!(run(Some(Duration::from_micros(step_us))), run(None));
    }
}

/// A bench of arms with certain mechanics, its light arm sent from −45° on by a number of counts, and what is shown and
/// true a while later: counts off the goal.
fn ends(sim: &str, by: i64, after_s: f64) -> (f64, f64) {
    let mut bench = bench(sim);
    go(&mut bench, 40, 40, 1536 + by);
    bench.advance_to(s(after_s));
    let shown = read(&mut bench, 132, 4) - 1536 - by;
    let true_counts = (bench.pose().light.deg() + 45.0) * 4096.0 / 360.0 - by as f64;
    (shown as f64, true_counts)
}

#[test]
fn friction_stops_a_shaft_short_on_the_side_from_which_it_came() {
    assert_eq!(ends("static_error_counts = 5", 200, 9.0).0, -5.0);
    assert_eq!(ends("static_error_counts = 5", -200, 9.0).0, 5.0);
    assert_eq!(ends("[sim.light]\nstatic_error_counts = 5", -200, 9.0).0, 5.0);
    assert_eq!(ends("[sim.sensor]\nstatic_error_counts = 5", -200, 9.0).0, 0.0);
    // A goal nearer than what friction leaves moves nothing.
    assert_eq!(ends("static_error_counts = 5", 4, 9.0).0, -4.0);
}

#[test]
fn a_goal_moved_by_the_error_mends_a_static_error_and_not_stiction() {
    for (sim, first, trimmed) in [
        ("static_error_counts = 3", -3, 0),
        ("stiction_counts = 3", -3, -3),
    ] {
        let mut bench = bench(sim);
        go(&mut bench, 40, 40, 1736);
        bench.advance_to(s(9.0));
        assert_eq!(read(&mut bench, 132, 4) - 1736, first, "{sim}");
        write(&mut bench, 116, 4, 1736 - first).unwrap();
        bench.advance_to(s(18.0));
        assert_eq!(read(&mut bench, 132, 4) - 1736, trimmed, "{sim}");
    }
}

#[test]
fn gains_rule_what_friction_leaves_and_how_late_a_shaft_is() {
    let after = |p: i64, i: i64, at_s: f64| {
        let mut bench = bench("static_error_counts = 6\nfollowing_lag_ms = 40");
        write(&mut bench, 84, 2, p).unwrap();
        write(&mut bench, 82, 2, i).unwrap();
        go(&mut bench, 40, 0, 1736);
        bench.advance_to(s(at_s));
        read(&mut bench, 132, 4) - 1736
    };
    assert_eq!(
        [after(800, 0, 9.0), after(1600, 0, 9.0), after(400, 0, 9.0)],
        [-6, -3, -12]
    );
    assert_eq!(after(800, 200, 60.0), 0, "the integral takes it away");
    // 40 · 0.229 rpm are 625 counts/s: 25 counts in 40 ms.
    assert_eq!(after(800, 0, 0.2) - after(1600, 0, 0.2), -13);
}

#[test]
fn a_ring_dies_out_and_hunting_and_jitter_do_not() {
    let spread = |sim: &str, from_s: f64| {
        let mut bench = bench(sim);
        go(&mut bench, 40, 40, 1736);
        let seen: Vec<i64> = (0..200)
            .map(|i| {
                bench.advance_to(s(from_s + f64::from(i) * 0.003));
                read(&mut bench, 132, 4)
            })
            .collect();
        seen.iter().max().unwrap() - seen.iter().min().unwrap()
    };
    let ring = "ring = { counts = 20, hz = 6, tau_s = 0.4 }";
    // 200 counts with 40 · 0.229 rpm and 40 · 214.6 rev/min² take 0.38 s.
    assert!((25..=40).contains(&spread(ring, 0.4)), "{}", spread(ring, 0.4));
    assert_eq!(spread(ring, 8.0), 0);
    assert_eq!(spread("hunting = { counts = 2, hz = 10 }", 8.0), 4);
    assert!((1..=2).contains(&spread("jitter_counts = 1", 8.0)));
    assert!((3..=9).contains(&spread("encoder_noise_deg = 0.1", 8.0)));
    assert_eq!(spread("", 8.0), 0);
}

#[test]
fn gravity_hangs_an_arm_away_from_the_normal_and_an_arm_without_torque_falls() {
    let (shown, truth) = ends("gravity_counts = 8", -400, 9.0);
    // At −80.2° nearly all of it.
    assert_eq!(shown, -8.0);
    assert!(
        (truth + 8.0 * 80.16_f64.to_radians().sin()).abs() < 0.1,
        "{truth}"
    );
    let mut falling = bench("sag_deg_per_s = 10");
    falling.advance_to(s(2.0));
    assert!(
        (falling.pose().light.deg() + 65.0).abs() < 0.1,
        "{:?}",
        falling.pose()
    );
    falling.advance_to(s(60.0));
    assert!(
        (falling.pose().light.deg() + 100.0).abs() < 0.1,
        "{:?}",
        falling.pose()
    );
    write(&mut falling, 64, 1, 1).unwrap();
    write(&mut falling, 116, 4, 1536).unwrap();
    falling.advance_to(s(90.0));
    assert!(
        (falling.pose().light.deg() + 45.0).abs() < 0.1,
        "{:?}",
        falling.pose()
    );
}

#[test]
fn an_encoder_that_errs_sends_the_arm_elsewhere_and_does_not_show_it() {
    // On the way the light goes from −45° to −75°, where the error is 1° · sin(2 · 75°) more.
    let (shown, truth) = ends("encoder_error = { amplitude_deg = 1.0, periods = 2 }", -341, 9.0);
    assert_eq!(shown, 0.0);
    let expected = (2.0 * 75f64.to_radians()).sin() * 4096.0 / 360.0;
    assert!((truth - expected).abs() < 0.1, "{truth} instead of {expected}");
}

#[test]
fn a_hand_turns_an_arm_only_while_it_has_no_torque() {
    let turn = |torque: i64| {
        let mut bench = bench("");
        write(&mut bench, 64, 1, torque).unwrap();
        bench.schedule(Fault {
            device: rig::Device::Light,
            at: s(1.0),
            what: Disturbance::Turn(20.0),
        });
        bench.advance_to(s(2.0));
        bench.pose().light.deg() + 45.0
    };
    assert!((turn(0) - 20.0).abs() < 0.1, "{}", turn(0));
    assert!(turn(1).abs() < 0.1, "{}", turn(1));
}

proptest! {
    /// In how many steps time advances, and how often somebody looks, changes nothing.
    #[test]
    fn prop_mechanics_are_a_function_of_time_alone(
        goals in prop::collection::vec((1100..3000_i64, 0.01..2.0_f64), 1..5), looks in 1..40_u32,
        friction in 0.0..8.0_f64, tremble in 0.0..4.0_f64,
    ) {
        let sim = format!(
            "static_error_counts = {friction}\nstiction_counts = {tremble}\njitter_counts = {tremble}\n\
             gravity_counts = {friction}\nring = {{ counts = 20, hz = 6, tau_s = 0.4 }}\n\
             creep = {{ counts = 6, counts_per_s = 50 }}"
        );
        let run = |looks: u32| {
            let mut bench = bench(&sim);
            let mut now_s = 0.0;
            for &(goal, wait_s) in &goals {
                go(&mut bench, 40, 40, goal);
                for look in 1..=looks {
                    bench.advance_to(s(now_s + wait_s * f64::from(look) / f64::from(looks)));
                    read(&mut bench, 132, 4);
                }
                now_s += wait_s;
            }
            (bench.pose().light.deg(), read(&mut bench, 132, 4))
        };
        prop_assert_eq!(run(1), run(looks));
    }
}
