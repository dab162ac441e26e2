use std::f64::consts::PI;
use std::time::Duration;

use arms::{Arm, Pose};
use rig::dynamixel::Model;
use rig::{Detector, Drive, Exposure, FaultKind, Gain, Rig, RigFile};

use super::InProcessRig;
use crate::{Disturbance, Fault};

fn file(sim: &str) -> RigFile {
    RigFile::parse(&format!("[sim]\n{sim}"), "test.toml".as_ref()).unwrap()
}

async fn drive(file: RigFile) -> Drive<InProcessRig> {
    let rig = InProcessRig::new(&file).unwrap();
    let mut drive = Drive::new(rig, file);
    drive.identify_all().await.unwrap();
    drive.engage_all().await.unwrap();
    drive.lamp(true).await.unwrap();
    drive.wait(Duration::from_millis(200)).await.unwrap();
    drive
}

const EXPOSURE: Exposure = Exposure {
    integration_us: 100_000,
    gain: Gain::X1,
};

#[tokio::test(start_paused = true)]
async fn a_lambertian_specimen_reads_albedo_over_pi_times_cosine() {
    let file = file("specimen = \"lambert:0.5\"\nimperfections = \"none\"");
    let mut drive = drive(file.clone()).await;
    for (light, sensor) in [(-45.0, 45.0), (-60.0, 10.0), (0.0, 70.0), (-80.0, 80.0)] {
        let pose = file.nearest(Pose::from_deg(light, sensor));
        drive.travel(&[pose]).await.unwrap();
        let counts = drive.expose(EXPOSURE).await.unwrap();
        let expected = 0.5 / PI * pose.light.rad().cos() * 100_000.0;
        assert_eq!(
            counts.rgb,
            [expected.round() as u32; 3],
            "light {light}°, sensor {sensor}°"
        );
        assert_eq!(counts.monitor, 500_000);
    }
}

#[tokio::test(start_paused = true)]
async fn a_capture_is_the_same_for_the_same_seed() {
    async fn capture(seed: u32) -> (Vec<[u32; 3]>, u32) {
        let mut drive = drive(file(&format!("specimen = \"gold-paint\"\nseed = {seed}"))).await;
        let mut readings = Vec::new();
        for i in 0..20 {
            drive
                .travel(&[Pose::from_deg(-40.0 - f64::from(i), 45.0)])
                .await
                .unwrap();
            readings.push(drive.expose(EXPOSURE).await.unwrap().rgb);
        }
        (readings, drive.ticks().await.unwrap())
    }
    let host = std::time::Instant::now();
    let (first, again, other) = (capture(1).await, capture(1).await, capture(2).await);
    assert_eq!(first, again);
    assert_ne!(first.0, other.0);
    assert!(
        first.1 > 20 * 10_000,
        "{} ticks for 20 readings of 100 ms",
        first.1
    );
    println!("60 readings in {:?}", host.elapsed());
}

#[tokio::test(start_paused = true)]
async fn time_passes_as_asked_not_as_timers_round() {
    let mut rig = InProcessRig::new(&file("")).unwrap();
    for _ in 0..1000 {
        rig.wait(Duration::from_micros(130)).await.unwrap();
    }
    assert_eq!(rig.bench().now(), Duration::from_millis(130));
    assert_eq!(rig.photometer().ticks().await.unwrap(), 13_000);
    // Longer than by what a timer's clock may run ahead.
    for _ in 0..100 {
        rig.wait(Duration::from_micros(2_730)).await.unwrap();
    }
    assert_eq!(rig.bench().now(), Duration::from_millis(403));
}

#[tokio::test(start_paused = true)]
async fn time_that_passes_elsewhere_reaches_the_bench() {
    let rig = InProcessRig::new(&file("")).unwrap();
    tokio::time::sleep(Duration::from_secs(3)).await;
    assert_eq!(rig.bench().now(), Duration::from_secs(3));
}

#[tokio::test(start_paused = true)]
async fn a_silent_servo_is_a_fault_once_it_has_been_silent_too_long() {
    let mut drive = drive(file("")).await;
    let silence = |duration| Fault {
        device: rig::Device::Sensor,
        at: Duration::ZERO,
        what: Disturbance::Silence(duration),
    };
    let bench = drive.rig().bench();
    bench.schedule(silence(Duration::from_millis(200)));
    drive.snapshot().await.unwrap();
    assert!(drive.retries() > 0);
    bench.schedule(silence(Duration::from_secs(60)));
    let error = drive.snapshot().await.unwrap_err();
    assert_eq!(
        (error.kind(), error.device()),
        (FaultKind::NoReply, Some(rig::Device::Sensor))
    );
}

#[tokio::test(start_paused = true)]
async fn an_overload_on_the_way_is_told_and_the_arm_stands() {
    let mut drive = drive(file("")).await;
    let bench = drive.rig().bench();
    bench.schedule(Fault {
        device: rig::Device::Light,
        at: bench.now() + Duration::from_millis(500),
        what: Disturbance::OVERLOAD,
    });
    let error = drive.travel(&[Pose::from_deg(-85.0, 45.0)]).await.unwrap_err();
    assert_eq!(
        (error.kind(), error.device()),
        (FaultKind::Hardware, Some(rig::Device::Light))
    );
    let stuck = bench.pose().angle(Arm::Light).deg();
    assert!((-84.0..-46.0).contains(&stuck), "light arm at {stuck}°");
}

#[tokio::test(start_paused = true)]
async fn a_stalled_arm_does_not_arrive() {
    let mut drive = drive(file("")).await;
    let bench = drive.rig().bench();
    bench.schedule(Fault {
        device: rig::Device::Sensor,
        at: bench.now() + Duration::from_millis(300),
        what: Disturbance::Stall(Duration::from_secs(60)),
    });
    let error = drive.travel(&[Pose::from_deg(-45.0, 80.0)]).await.unwrap_err();
    assert_eq!(
        (error.kind(), error.device()),
        (FaultKind::Motion, Some(rig::Device::Sensor))
    );
}

#[tokio::test(start_paused = true)]
async fn a_lost_acknowledgement_exposes_once() {
    let mut drive = drive(file("")).await;
    let before = drive.expose(EXPOSURE).await.unwrap().sequence;
    drive.rig().bench().schedule(Fault {
        device: rig::Device::Photometer,
        at: Duration::ZERO,
        what: Disturbance::LostAcknowledgement,
    });
    let counts = drive.expose(EXPOSURE).await.unwrap();
    assert_eq!(counts.sequence, before + 1);
    assert_eq!(drive.retries(), 1);
}

#[tokio::test(start_paused = true)]
async fn a_refused_trigger_is_a_fault() {
    let mut drive = drive(file("")).await;
    drive.rig().bench().schedule(Fault {
        device: rig::Device::Photometer,
        at: Duration::ZERO,
        what: Disturbance::RefusedTrigger,
    });
    assert_eq!(
        drive.expose(EXPOSURE).await.unwrap_err().kind(),
        FaultKind::Refused
    );
    drive.expose(EXPOSURE).await.unwrap();
}

#[tokio::test(start_paused = true)]
async fn a_silent_host_puts_the_lamp_out_and_stops_the_arms() {
    let mut drive = drive(file("")).await;
    drive.rig().start(Pose::from_deg(-88.0, 88.0)).await.unwrap();
    let bench = drive.rig().bench();
    tokio::time::sleep(Duration::from_secs(5)).await;
    use rig::dynamixel::register::{common, photometer};
    let peek = |device, register| bench.peek(device, register).unwrap();
    assert_eq!(peek(rig::Device::Photometer, photometer::LAMP_ENABLE), 0);
    for device in [rig::Device::Light, rig::Device::Sensor, rig::Device::Photometer] {
        assert_eq!(peek(device, common::BUS_WATCHDOG), 255, "{device}");
    }
}

#[tokio::test(start_paused = true)]
async fn another_model_is_told_before_anything_moves() {
    let simulated = file("");
    let mut claimed = simulated.clone();
    claimed.arms[0].model = Model::named("XM540-W270").unwrap();
    let rig = InProcessRig::over(crate::Bench::new(&simulated).unwrap(), &claimed);
    let error = Drive::new(rig, claimed).identify_all().await.unwrap_err();
    assert_eq!(
        (error.kind(), error.device()),
        (FaultKind::Mismatch, Some(rig::Device::Light))
    );
}
