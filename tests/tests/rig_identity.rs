//! Before the first motion: ports, identities, and that nothing moves.

// Set-up outside the test functions, which clippy does not take for tests.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::time::{Duration, Instant};

use arms::{Arm, Pose};
use firmware_sim::{Disturbance, Fault as Mishap, Server};
use rig::{Device, Drive, Dynamixel, Fault, FaultKind, Rig, RigError, RigFile};

fn file(text: &str) -> RigFile {
    RigFile::parse(text, Path::new("test.toml")).unwrap()
}

/// A simulator of the default rig, and a rig that sees it through another rig file.
fn rig(seen_as: &str) -> (Server, Drive<Dynamixel>) {
    let server = Server::start(&file("")).unwrap();
    let file = file(seen_as);
    let rig = Dynamixel::open(server.path(), &file).unwrap();
    (server, Drive::new(rig, file))
}

fn write(server: &Server, device: Device, address: u16, bytes: &[u8]) {
    server.bench(|bench| bench.device(device).write(address, bytes).unwrap());
}

fn torque(server: &Server, device: Device) -> u8 {
    server.bench(|bench| bench.device(device).read(64, 1).unwrap()[0])
}

/// Asserts that the arms stand where they stood, but for a servo's tremble of a count.
fn assert_holds(server: &Server, start: Pose, why: &str) {
    let now = server.bench(|bench| bench.pose());
    for (now, start) in [(now.light, start.light), (now.sensor, start.sensor)] {
        assert!(
            (now - start).abs().to_degrees() < 0.1,
            "{why}: {now:?}, {start:?}"
        );
    }
}

#[tokio::test]
async fn nothing_moves_until_it_is_told_to() {
    let (server, mut drive) = rig("");
    let start = server.bench(|bench| bench.pose());
    assert_eq!(server.counters().packets, 0, "opening a port sends nothing");

    let names = drive.identify_all().await.unwrap().map(|identity| identity.model);
    assert_eq!(names, ["XM430-W350", "XM430-W350", "photometer"]);
    drive.snapshot().await.unwrap();
    assert_eq!(server.counters().goals, 0, "looking commands no motion");
    for device in [Device::Light, Device::Sensor, Device::Photometer] {
        assert_eq!(torque(&server, device), 0, "looking switches nothing: {device}");
    }

    drive.engage_all().await.unwrap();
    drive.wait(Duration::from_secs(2)).await.unwrap();
    assert_eq!(torque(&server, Device::Light), 1);
    let snapshot = drive.snapshot().await.unwrap();
    assert!(
        snapshot
            .arms
            .iter()
            .all(|location| location.torque && !location.moving)
    );
    assert_holds(&server, start, "engaging holds the arms");

    drive.disengage_all().await;
    server.bench(|bench| bench.advance_to(bench.now() + Duration::from_secs(5)));
    assert_holds(&server, start, "no watchdog trips after disengaging");
    assert_eq!(torque(&server, Device::Light), 1, "estop = \"hold\" holds");
}

#[tokio::test]
async fn an_arm_that_is_not_engaged_is_not_started() {
    let (server, mut drive) = rig("");
    let error = drive.rig().start(Pose::from_deg(-40.0, 40.0)).await.unwrap_err();
    assert_eq!(error.to_string(), "light servo is not engaged, it must not move");
    assert_eq!(server.counters().packets, 0);
    drive.engage_all().await.unwrap();
    drive.halt_all().await;
    let error = drive.travel(&[Pose::from_deg(-40.0, 40.0)]).await.unwrap_err();
    assert_eq!(
        error.kind(),
        FaultKind::Refused,
        "halted arms have no profile: {error}"
    );
}

/// Address, bytes and what the error must say.
#[tokio::test]
async fn each_difference_is_named_with_its_remedy() {
    let table: [(u16, &[u8], &str); 8] = [
        (
            11,
            &[1],
            "operating mode is 1, not 3 (position): write 3 to address 11",
        ),
        (10, &[4], "drive mode is 0x04, not 0"),
        (
            9,
            &[250],
            "return delay is 500 µs, the rig file says 0 µs: write 0 to address 9",
        ),
        (
            20,
            &2000i32.to_le_bytes(),
            "homing offset is 2000, which position mode ignores beyond ±1024",
        ),
        (
            44,
            &20u32.to_le_bytes(),
            "velocity limit is 20, the arm's speed needs 43: lower `velocity_deg_s` to 27.480",
        ),
        (
            48,
            &3000u32.to_le_bytes(),
            "… 3000, the arm's limits need 1047 … 3049: narrow `min_deg` and `max_deg`",
        ),
        (52, &1100u32.to_le_bytes(), "position limits are 1100 … "),
        (68, &[1], "status return level is 1"),
    ];
    for (address, bytes, expected) in table {
        let (server, mut drive) = rig("");
        write(&server, Device::Sensor, address, bytes);
        let error = drive.identify_all().await.expect_err(expected);
        let source = std::error::Error::source(&error).unwrap().to_string();
        assert!(source.starts_with("sensor servo (id 2): "), "{source}");
        assert!(source.contains(expected), "{source:?} lacks {expected:?}");
        assert_eq!(
            (error.kind(), error.device()),
            (FaultKind::Mismatch, Some(Device::Sensor))
        );
        assert_eq!(server.counters().goals, 0);
    }
}

#[tokio::test]
async fn all_differences_of_a_device_come_at_once() {
    let (server, mut drive) = rig("");
    write(&server, Device::Light, 11, &[4]);
    write(&server, Device::Light, 9, &[10]);
    let error = drive.identify_all().await.unwrap_err();
    let source = std::error::Error::source(&error).unwrap().to_string();
    assert!(
        source.contains("operating mode") && source.contains("return delay"),
        "{source}"
    );
}

/// The rig file through which the default rig is seen, what kind of fault that is, and what is said.
#[tokio::test]
async fn wrong_model_id_or_baud_is_a_fault_within_a_second() {
    let table = [
        (
            "[sensor]\nmodel = \"XM540-W270\"",
            FaultKind::Mismatch,
            "it is XM430-W350, the rig file says XM540-W270",
        ),
        (
            "[photometer]\nid = 1\n[light]\nid = 3",
            FaultKind::Mismatch,
            "it is unknown model 18256",
        ),
        (
            "[sensor]\nid = 9",
            FaultKind::NoReply,
            "sensor servo (id 9) gives no reply: check its power, cable, id and baud rate",
        ),
        (
            "[bus]\nbaud = 57600",
            FaultKind::NoReply,
            "light servo (id 1) gives no reply",
        ),
    ];
    for (seen_as, kind, expected) in table {
        let (server, mut drive) = rig(seen_as);
        let begin = Instant::now();
        let error = drive.identify_all().await.expect_err(seen_as);
        let source = std::error::Error::source(&error).unwrap().to_string();
        assert_eq!(error.kind(), kind, "{error}: {source}");
        assert!(source.contains(expected), "{source:?} lacks {expected:?}");
        assert_eq!(server.counters().goals, 0, "nothing moved");
        let silence = begin.elapsed();
        if kind == FaultKind::NoReply {
            assert!(
                silence >= Duration::from_millis(500) && error.retries() > 2,
                "{silence:?}, {error}"
            );
        }
        assert!(silence < Duration::from_secs(2), "{silence:?}");
    }
}

#[tokio::test]
async fn an_ill_device_is_not_engaged() {
    for (device, what, expected) in [
        (
            Device::Light,
            Disturbance::OVERLOAD,
            "light servo (id 1) reports overload; remove the cause",
        ),
        (
            Device::Sensor,
            Disturbance::ALERT,
            "sensor servo (id 2) reports input voltage",
        ),
        (
            Device::Photometer,
            Disturbance::OVERLOAD,
            "photometer (id 3) reports lamp failure",
        ),
    ] {
        let (server, mut drive) = rig("");
        server.bench(|bench| {
            bench.schedule(Mishap {
                device,
                at: Duration::ZERO,
                what,
            });
        });
        let error = drive.identify_all().await.expect_err(expected);
        let source = std::error::Error::source(&error).unwrap().to_string();
        assert_eq!(
            (error.kind(), error.device()),
            (FaultKind::Hardware, Some(device))
        );
        assert!(source.contains(expected), "{source:?} lacks {expected:?}");
    }
}

#[tokio::test]
async fn a_port_is_ours_alone_until_it_is_dropped() {
    let (server, drive) = rig("");
    let again = || Dynamixel::open(server.path(), drive.file());
    let error = again().unwrap_err();
    assert!(matches!(error, RigError::PortLocked { .. }), "{error}");
    assert_eq!(error.kind(), FaultKind::Setup);
    assert!(
        error.to_string().contains("is in use by another program"),
        "{error}"
    );
    let file = drive.file().clone();
    drop(drive);
    Dynamixel::open(server.path(), &file).expect("dropping the rig releases its port");
}

#[test]
fn ports_that_cannot_be_opened_are_told_apart() {
    let file = file("");
    let missing = Dynamixel::open(Path::new("/dev/ttyNOWHERE"), &file).unwrap_err();
    assert!(
        missing
            .to_string()
            .starts_with("there is no serial port /dev/ttyNOWHERE; present: "),
        "{missing}"
    );
    let regular = tempfile::NamedTempFile::new().unwrap();
    let unusable = Dynamixel::open(regular.path(), &file).unwrap_err();
    assert!(matches!(unusable, RigError::PortUnusable { .. }), "{unusable}");
    assert!(
        [missing, unusable]
            .iter()
            .all(|error| error.kind() == FaultKind::Setup)
    );
    rig::ports().expect("the ports of this machine can be listed");
}

/// Also with a gear and a sign, where counts and angles are not the same thing.
#[tokio::test]
async fn a_geared_and_reversed_arm_is_told_in_counts() {
    let text = "[light]\nsign = -1\ngear = 1.5\n[sensor]\nzero_deg = 170.0\n[sim]\nimperfections = \"none\"";
    let file = file(text);
    let server = Server::start(&file).unwrap();
    let rig = Dynamixel::open(server.path(), &file).unwrap();
    let mut drive = Drive::new(rig, file);
    drive.identify_all().await.unwrap();
    drive.engage_all().await.unwrap();
    let goal = Pose::from_deg(-30.0, 20.0);
    let settled = drive.travel(&[goal]).await.unwrap().pose;
    let truth = server.bench(|bench| bench.pose());
    for arm in Arm::BOTH {
        let error = (settled.angle(arm) - goal.angle(arm)).to_degrees();
        assert!(error.abs() < 0.1, "{arm} measured {error}° off");
        let error = (truth.angle(arm) - goal.angle(arm)).to_degrees();
        assert!(error.abs() < 0.1, "{arm} really {error}° off");
    }
}
