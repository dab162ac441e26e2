//! A daemon that is killed in mid-move does not leave the arms moving: the servos' own watchdog stops them.

use std::time::{Duration, Instant};

use rig::Device;
use rig::dynamixel::register::{Register, common, photometer, servo};
use tests::{Service, Simulator};

/// Slow arms in real time, with a long way to go.
const RIG: &str = "
light.velocity_deg_s = 10.0
motion.watchdog_ms = 200
[sim]
clock = \"real\"
imperfections = \"none\"
";
const WATCHDOG: Duration = Duration::from_millis(200);
const JOB: &str = "on_stage = true\n[[plane]]\ntheta_r_deg = 60\nreadings = 12\n[arc]\nreadings = 8\n";

fn peek(simulator: &Simulator, device: Device, register: Register) -> i64 {
    let bytes = simulator.server.bench(|bench| {
        bench
            .device(device)
            .read(register.address, register.size)
            .expect("the table has it")
    });
    bytes
        .iter()
        .rev()
        .fold(0, |value, &byte| value << 8 | i64::from(byte))
}

#[test]
fn the_arms_stop_and_the_lamp_goes_out() {
    let folder = tempfile::tempdir().unwrap();
    let simulator = Simulator::new(RIG);
    let rig = simulator.rig_file(folder.path());
    let job = folder.path().join("job.toml");
    std::fs::write(&job, JOB).unwrap();
    let program = env!("CARGO_BIN_EXE_e2e-daemon");
    let mut service = Service::start(program, &rig, &folder.path().join("data"));
    service.ask(&format!("submit {}", job.display()));
    let goal_deg = service.until(|said| {
        (said["event"] == "step" && said["sweep"] != "dark").then(|| said["light_deg"].as_f64().unwrap())
    });
    let light_deg = || simulator.server.bench(|bench| bench.pose().light.deg());
    let begun_deg = light_deg();
    let patience = Instant::now() + Duration::from_secs(120);
    while (light_deg() - begun_deg).abs() < 2.0 {
        assert!(Instant::now() < patience, "the arm sets off");
        std::thread::yield_now();
    }
    assert_eq!(peek(&simulator, Device::Photometer, photometer::LAMP_ENABLE), 1);
    service.kill();
    let (killed_at, killed_deg) = simulator
        .server
        .bench(|bench| (bench.now(), bench.pose().light.deg()));
    assert!(
        (goal_deg - killed_deg).abs() > 10.0,
        "killed well before the goal: {killed_deg}° of {goal_deg}°"
    );
    while peek(&simulator, Device::Light, servo::MOVING) == 1 {
        assert!(Instant::now() < patience, "the arm stops");
        std::thread::yield_now();
    }
    let (stopped_at, stopped_deg) = simulator
        .server
        .bench(|bench| (bench.now(), bench.pose().light.deg()));
    println!(
        "killed at {killed_deg:.2}° on the way to {goal_deg:.2}°; stopped {:?} later at {stopped_deg:.2}°",
        stopped_at - killed_at
    );
    // Watchdog, braking from 10°/s at 200°/s², and a look that comes late on a busy machine: at 10°/s within 5°.
    assert!((stopped_deg - killed_deg).abs() < 10.0 * (WATCHDOG.as_secs_f64() + 0.3));
    assert!(
        (goal_deg - stopped_deg).abs() > 5.0,
        "it did not go on to its goal"
    );
    assert_eq!(
        peek(&simulator, Device::Light, common::BUS_WATCHDOG),
        255,
        "tripped"
    );
    while peek(&simulator, Device::Photometer, photometer::LAMP_ENABLE) == 1 {
        assert!(Instant::now() < patience, "the lamp goes out");
        std::thread::yield_now();
    }
}
