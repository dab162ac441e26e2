use std::time::Duration;

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

#[test]
fn overload_takes_the_torque_until_a_reboot() {
    let mut bench = bench("");
    bench.schedule(Fault {
        device: rig::Device::Light,
        at: s(0.5),
        what: Disturbance::OVERLOAD,
    });
    go(&mut bench, 43, 9, 2048);
    bench.advance_to(s(2.0));
    assert_eq!((read(&mut bench, 64, 1), read(&mut bench, 70, 1)), (0, 32));
    assert!(light(&mut bench).alert());
}
