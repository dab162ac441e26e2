//! A broken bus, broken devices and a rig that must not break with them.

// Set-up outside the test functions, which clippy does not take for tests.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::time::{Duration, Instant};

use arms::{Arm, Pose};
use firmware_sim::{Disturbance, Fault as Mishap, Server, WireFaults};
use rig::{
    Actuator, Device, Drive, DriveError, Dynamixel, Exposure, FaultKind, Gain, Rig, RigError, RigFile,
};

const EXPOSURE: Exposure = Exposure {
    integration_us: 1_000,
    gain: Gain::X1,
};

/// A simulator with its imperfections off, and the rig in front of it, engaged.
async fn engaged(text: &str) -> (Server, Drive<Dynamixel>) {
    let (server, mut drive) = connected(text);
    drive.identify_all().await.unwrap();
    drive.engage_all().await.unwrap();
    (server, drive)
}

fn connected(text: &str) -> (Server, Drive<Dynamixel>) {
    let text = format!("{text}\n[sim]\nimperfections = \"none\"\nboot_ms = 50.0\n");
    let file = RigFile::parse(&text, Path::new("test.toml")).unwrap();
    let server = Server::start(&file).unwrap();
    let rig = Dynamixel::open(server.path(), &file).unwrap();
    (server, Drive::new(rig, file))
}

fn schedule(server: &Server, device: Device, after: Duration, what: Disturbance) {
    server.bench(|bench| {
        let at = bench.now() + after;
        bench.schedule(Mishap { device, at, what });
    });
}

fn lamp(server: &Server) -> u8 {
    server.bench(|bench| bench.device(Device::Photometer).read(64, 1).unwrap()[0])
}

fn sequence(server: &Server) -> u32 {
    let bytes = server.bench(|bench| bench.device(Device::Photometer).read(124, 4).unwrap());
    u32::from_le_bytes(bytes.try_into().unwrap())
}

fn source(error: &dyn std::error::Error) -> String {
    error.source().map(ToString::to_string).unwrap_or_default()
}

/// Positions of eight readings, both arms moving.
fn poses() -> impl Iterator<Item = Pose> {
    (0..8).map(|i| Pose::from_deg(-40.0 + 2.0 * f64::from(i), 42.0 + f64::from(i)))
}

#[tokio::test]
async fn arms_settle_where_they_are_told_and_readings_come() {
    let (server, mut drive) = engaged("").await;
    drive.lamp(true).await.unwrap();
    for (i, pose) in poses().enumerate() {
        let settled = drive.travel(&[pose]).await.unwrap();
        for arm in Arm::BOTH {
            let error = (settled.pose.angle(arm) - pose.angle(arm)).to_degrees().abs();
            assert!(error <= 0.1, "{arm} arm {error}° off at reading {i}");
        }
        let counts = drive.expose(EXPOSURE).await.unwrap();
        assert_eq!(counts.exposure, EXPOSURE);
        assert_eq!(counts.sequence, i as u32 + 1);
        assert!(counts.monitor > 0, "the lamp is on");
    }
    assert!(drive.disengage_all().await.is_empty());
    assert_eq!(lamp(&server), 0);
}

/// Waiting costs the simulated bench what it says and the host next to nothing.
#[tokio::test]
async fn waits_pass_in_wire_time() {
    let (server, mut drive) = engaged("").await;
    let (host, bench) = (Instant::now(), server.bench(|bench| bench.now()));
    drive.wait(Duration::from_secs(60)).await.unwrap();
    let passed = server.bench(|bench| bench.now()) - bench;
    assert!(
        passed >= Duration::from_secs(60) && passed < Duration::from_secs(61),
        "{passed:?}"
    );
    assert!(host.elapsed() < Duration::from_secs(20), "{:?}", host.elapsed());
}

/// One request broken in each way that the simulator knows, often: nothing wrong is believed, nothing exposed twice.
#[tokio::test]
async fn a_broken_bus_costs_retries_and_nothing_else() {
    // Corruption and loss as bad as a bus may be from the start; the rest, much worse, once the arms are engaged.
    type Worsen = fn(&mut WireFaults);
    let table: [(&str, Worsen); 7] = [
        ("corrupt_byte = 0.002\ndrop_reply = 0.005", |_| {}),
        ("", |faults| faults.truncate_reply = 0.1),
        ("", |faults| faults.noise = 0.2),
        ("", |faults| faults.duplicate_reply = 0.2),
        ("", |faults| faults.wrong_id = 0.1),
        // The crate would panic at such a length in a debug build.
        ("", |faults| faults.wrong_length = 0.1),
        ("", |faults| {
            faults.late_reply = 0.1;
            faults.late_by = Duration::from_millis(40);
        }),
    ];
    for (wire, worsen) in table {
        let (server, mut drive) = engaged(&format!("[sim.wire]\n{wire}")).await;
        server.faults(worsen);
        let mut wire = WireFaults::default();
        server.faults(|faults| wire = faults.clone());
        drive.lamp(true).await.unwrap();
        for (i, pose) in poses().enumerate() {
            let settled = drive
                .travel(&[pose])
                .await
                .unwrap_or_else(|error| panic!("{wire:?}: {error:?}"));
            let truth = server.bench(|bench| bench.pose());
            for arm in Arm::BOTH {
                let error = (settled.pose.angle(arm) - truth.angle(arm)).to_degrees().abs();
                assert!(
                    error < 0.1,
                    "{wire:?}: {arm} arm believed {error}° off at reading {i}"
                );
            }
            let counts = drive
                .expose(EXPOSURE)
                .await
                .unwrap_or_else(|error| panic!("{wire:?}: {error:?}"));
            assert_eq!(counts.sequence, i as u32 + 1, "{wire:?}: exposed twice");
        }
        assert_eq!(sequence(&server), 8, "{wire:?}");
        let hurt = server.counters().hurt + server.counters().dropped;
        assert!(hurt > 0, "{wire:?}: nothing was broken");
        // Stray bytes and second copies are skipped without a second request.
        if wire.noise == 0.0 && wire.duplicate_reply == 0.0 {
            assert!(
                drive.retries() > 0,
                "{wire:?}: {hurt} replies broken, none asked again"
            );
        }
        drive.disengage_all().await;
    }
}

#[tokio::test]
async fn a_lost_acknowledgement_does_not_expose_twice() {
    let (server, mut drive) = engaged("").await;
    for i in 1..=3 {
        schedule(
            &server,
            Device::Photometer,
            Duration::ZERO,
            Disturbance::LostAcknowledgement,
        );
        let counts = drive.expose(EXPOSURE).await.unwrap();
        assert_eq!((counts.sequence, sequence(&server)), (i, i));
    }
    assert!(drive.retries() >= 3, "{} retries", drive.retries());
}

#[tokio::test]
async fn a_refused_trigger_is_a_fault() {
    let (server, mut drive) = engaged("").await;
    schedule(
        &server,
        Device::Photometer,
        Duration::ZERO,
        Disturbance::RefusedTrigger,
    );
    let error = drive.expose(EXPOSURE).await.unwrap_err();
    assert_eq!(
        (error.kind(), error.device()),
        (FaultKind::Refused, Some(Device::Photometer))
    );
    assert_eq!(sequence(&server), 0);
}

/// As on a host that shares its processors with many others: late with everything, and by more than any reply is waited for.
#[tokio::test]
async fn replies_that_all_come_late_are_waited_for() {
    for late_ms in [60, 100, 150] {
        let (server, mut drive) = engaged("").await;
        server.faults(|faults| {
            faults.late_reply = 1.0;
            faults.late_by = Duration::from_millis(late_ms);
        });
        for look in 0..4 {
            let seen = drive.snapshot().await;
            assert!(seen.is_ok(), "{late_ms} ms late, look {look}: {seen:?}");
        }
    }
}

/// What is read singly after a late reply of the same length: goal and position differ, since the arm is stuck.
#[tokio::test]
async fn a_late_reply_is_not_taken_for_the_next() {
    let (server, mut drive) = engaged("").await;
    let start = drive.snapshot().await.unwrap().pose();
    schedule(
        &server,
        Device::Light,
        Duration::ZERO,
        Disturbance::Stall(Duration::from_secs(3600)),
    );
    let goal = drive.file().nearest(Pose::from_deg(-30.0, 45.0));
    drive.rig().start(goal).await.unwrap();
    drive.wait(Duration::from_secs(2)).await.unwrap();
    let file = drive.file().clone();
    drop(drive);
    // A rig that has not engaged reads each register by itself.
    let mut rig = Dynamixel::open(server.path(), &file).unwrap();
    server.faults(|faults| {
        faults.late_reply = 0.1;
        faults.late_by = Duration::from_millis(40);
    });
    let mut good = 0;
    for _ in 0..40 {
        let Ok(location) = rig.axis(Arm::Light).location().await else {
            continue;
        };
        good += 1;
        assert!(location.torque && location.hardware_error == 0, "{location:?}");
        assert!((location.goal - goal.light).abs() < 1e-9, "{location:?}");
        assert!((location.measured - start.light).abs() < 1e-9, "{location:?}");
    }
    assert!(good > 5 && server.counters().hurt > 5, "{good} of 40 were good");
}

#[tokio::test]
async fn a_silent_servo_is_a_fault_and_the_others_are_stopped() {
    let (server, mut drive) = engaged("").await;
    drive.lamp(true).await.unwrap();
    drive.rig().start(Pose::from_deg(-85.0, 85.0)).await.unwrap();
    drive.wait(Duration::from_millis(200)).await.unwrap();
    server.faults(|faults| {
        faults.silent.insert(2, Duration::ZERO);
    });
    let begin = Instant::now();
    let error = drive.travel(&[Pose::from_deg(-85.0, 85.0)]).await.unwrap_err();
    assert_eq!(
        (error.kind(), error.device()),
        (FaultKind::NoReply, Some(Device::Sensor))
    );
    assert!(error.retries() > 1, "{error}");
    assert!(
        source(&error).contains("sensor servo (id 2) gives no reply"),
        "{}",
        source(&error)
    );
    let failed = drive.stop_all().await;
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
    let devices: Vec<_> = failed.iter().map(DriveError::device).collect();
    assert_eq!(
        devices,
        [Some(Device::Sensor)],
        "only the silent one could not be told"
    );
    assert_eq!(lamp(&server), 0);
    server.bench(|bench| bench.advance_to(bench.now() + Duration::from_secs(3)));
    let light = server.bench(|bench| bench.pose()).light.deg();
    assert!(light > -80.0, "the light arm stopped on its way, at {light}°");
}

#[tokio::test]
async fn a_servo_that_trips_ends_the_motion() {
    for (what, kind, expected) in [
        (
            Disturbance::OVERLOAD,
            FaultKind::Hardware,
            "light servo reports overload",
        ),
        // An error that does not shut the servo down is one all the same.
        (
            Disturbance::ALERT,
            FaultKind::Hardware,
            "light servo reports input voltage",
        ),
        (
            Disturbance::Stall(Duration::from_secs(60)),
            FaultKind::Motion,
            "light arm stands at",
        ),
    ] {
        let (server, mut drive) = engaged("").await;
        drive.lamp(true).await.unwrap();
        schedule(&server, Device::Light, Duration::from_millis(300), what);
        let begin = Instant::now();
        let error = drive
            .travel(&[Pose::from_deg(-85.0, 45.0)])
            .await
            .expect_err(expected);
        assert!(error.to_string().starts_with(expected), "{error}");
        assert_eq!((error.kind(), error.device()), (kind, Some(Device::Light)));
        assert!(
            drive.stop_all().await.is_empty(),
            "an ill servo can still be told to stop"
        );
        assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
        assert_eq!(lamp(&server), 0);
    }
}

#[tokio::test]
async fn a_restarted_servo_is_noticed_and_engages_again() {
    let (server, mut drive) = engaged("").await;
    server.bench(|bench| bench.device(Device::Sensor).reboot());
    let error = drive.travel(&[Pose::from_deg(-30.0, 30.0)]).await.unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("sensor servo has lost its torque at 45.0"),
        "{error}"
    );
    assert_eq!(error.kind(), FaultKind::Motion);
    drive.engage_all().await.unwrap();
    drive.travel(&[Pose::from_deg(-30.0, 30.0)]).await.unwrap();
}

#[tokio::test]
async fn a_failing_lamp_is_a_fault_of_the_photometer() {
    let (server, mut drive) = engaged("").await;
    drive.lamp(true).await.unwrap();
    schedule(
        &server,
        Device::Photometer,
        Duration::from_millis(5),
        Disturbance::OVERLOAD,
    );
    drive
        .wait(Duration::from_secs(1))
        .await
        .expect_err("noticed while waiting");
    let error = drive.expose(EXPOSURE).await.unwrap_err();
    assert_eq!(
        (error.kind(), error.device()),
        (FaultKind::Hardware, Some(Device::Photometer))
    );
    assert!(
        source(&error).contains("reports lamp failure"),
        "{}",
        source(&error)
    );
}

#[tokio::test]
async fn a_vanished_port_is_told_from_a_silent_device() {
    let (server, mut drive) = engaged("").await;
    drop(server);
    let error = drive.snapshot().await.unwrap_err();
    assert_eq!(error.kind(), FaultKind::Disconnected);
    assert_eq!(source(&error), "the serial port is gone (adapter unplugged?)");
    let failed = drive.stop_all().await;
    assert!(!failed.is_empty() && failed.iter().all(|error| error.kind() == FaultKind::Disconnected));
}

#[tokio::test]
async fn an_echoing_adapter_is_understood_where_the_rig_file_says_so() {
    let (_server, mut drive) = engaged("[bus]\necho = true\n[sim.wire]\necho = true").await;
    drive.travel(&[Pose::from_deg(-40.0, 40.0)]).await.unwrap();
    drive.expose(EXPOSURE).await.unwrap();

    let (_server, mut drive) = connected("[sim.wire]\necho = true");
    let error = drive.identify_all().await.unwrap_err();
    assert_eq!(error.kind(), FaultKind::NoReply, "an echo is no reply: {error}");
}

#[tokio::test]
async fn motions_that_leave_the_envelope_are_refused_before_they_begin() {
    let (server, mut drive) = engaged("").await;
    let before = server.counters().goals;
    for (to, expected) in [
        (
            Pose::from_deg(-89.0, 45.0),
            "light arm at -89.000° is outside its limits",
        ),
        (Pose::from_deg(44.0, 45.0), "arms 1.000° apart"),
        (Pose::from_deg(60.0, 20.0), "arms would pass each other"),
        (Pose::from_deg(f64::NAN, 20.0), "outside its limits"),
    ] {
        let error = drive.travel(&[to]).await.expect_err(expected);
        assert!(source(&error).contains(expected), "{}", source(&error));
        assert_eq!(error.kind(), FaultKind::Refused);
    }
    assert_eq!(server.counters().goals, before, "nothing was commanded");
}

/// Stopping in full swing: the arm comes to rest further on, within its braking distance, and does not swing back.
#[tokio::test]
async fn a_stop_decelerates_and_a_halt_stands() {
    for (halt, least, most) in [(false, 5.0, 12.0), (true, -0.5, 1.0)] {
        let (server, mut drive) = engaged("").await;
        drive.rig().start(Pose::from_deg(-45.0, 88.0)).await.unwrap();
        drive.wait(Duration::from_millis(400)).await.unwrap();
        let sensor = || server.bench(|bench| bench.pose()).sensor.deg();
        let before = sensor();
        let failed = if halt {
            drive.halt_all().await
        } else {
            drive.stop_all().await
        };
        assert!(failed.is_empty(), "{failed:?}");
        let mut furthest = before;
        for _ in 0..200 {
            server.bench(|bench| bench.advance_to(bench.now() + Duration::from_millis(5)));
            furthest = furthest.max(sensor());
        }
        let (on, back) = (sensor() - before, furthest - sensor());
        assert!(on > least && on < most, "halt {halt}: went on by {on}°");
        assert!(back < 0.2 || halt, "halt {halt}: swung back by {back}°");
    }
}

#[tokio::test]
async fn limp_means_torque_off() {
    let (server, mut drive) = engaged("[motion]\nestop = \"limp\"").await;
    assert!(drive.halt_all().await.is_empty());
    for device in [Device::Light, Device::Sensor] {
        let torque = server.bench(|bench| bench.device(device).read(64, 1).unwrap()[0]);
        assert_eq!(torque, 0, "{device}");
    }
}

/// The last approach to every pose comes from below, with the overshoot where the way there would not.
#[tokio::test]
async fn poses_are_approached_from_the_side_that_was_asked_for() {
    let (server, mut drive) = engaged("[motion]\napproach = \"up\"\novershoot_deg = 2.0").await;
    for (to, goals) in [
        // Both arms once; the light arm comes down, so it goes beyond first.
        (Pose::from_deg(-40.0, 50.0), 2),
        (Pose::from_deg(-50.0, 55.0), 4),
        // Neither has far to go: nothing is to be gained.
        (Pose::from_deg(-50.0, 55.0), 2),
    ] {
        let before = server.counters().goals;
        drive.travel(&[to]).await.unwrap();
        assert_eq!(server.counters().goals - before, goals, "towards {to:?}");
    }
}

/// Another program, or a tripped watchdog, keeps a servo from taking its goal.
#[tokio::test]
async fn a_goal_that_is_not_taken_is_a_fault() {
    let (server, mut drive) = engaged("").await;
    server.bench(|bench| bench.advance_to(bench.now() + Duration::from_secs(2)));
    let error = drive.travel(&[Pose::from_deg(-40.0, 40.0)]).await.unwrap_err();
    assert!(
        error.to_string().contains("did not take or keep the goal") && error.to_string().contains("watchdog"),
        "{error}"
    );
    drive
        .engage_all()
        .await
        .expect("engaging clears a tripped watchdog");
    drive.travel(&[Pose::from_deg(-40.0, 40.0)]).await.unwrap();
}

/// In real time a travel takes at least its profile.
#[tokio::test]
async fn a_real_clock_is_slept_through() {
    let text = "[sim]\nclock = \"real\"";
    let file = RigFile::parse(text, Path::new("test.toml")).unwrap();
    let server = Server::start(&file).unwrap();
    let mut drive = Drive::new(Dynamixel::open(server.path(), &file).unwrap(), file);
    drive.identify_all().await.unwrap();
    drive.engage_all().await.unwrap();
    let profile = drive.file().arm(Arm::Light).profile;
    let begin = Instant::now();
    drive.travel(&[Pose::from_deg(-42.0, 45.0)]).await.unwrap();
    assert!(begin.elapsed().as_secs_f64() >= profile.duration_s(3f64.to_radians()));
    drive.expose(EXPOSURE).await.unwrap();
    drive.disengage_all().await;
}

/// A rig that is cloned into a task must be usable there: its futures are `Send`.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_drive_moves_between_threads() {
    let (server, mut drive) = connected("");
    let task = tokio::spawn(async move {
        drive.identify_all().await?;
        drive.engage_all().await?;
        drive.travel(&[Pose::from_deg(-40.0, 40.0)]).await?;
        drive.expose(EXPOSURE).await?;
        Ok::<_, DriveError<RigError>>(drive.disengage_all().await.len())
    });
    assert_eq!(task.await.unwrap().unwrap(), 0);
    drop(server);
}
