//! Replies that come too late, from the wrong device or in an impossible shape, each at a moment of the test's choosing.

// Set-up outside the test functions, which clippy does not take for tests.
#![allow(clippy::unwrap_used)]

use std::fs::File;
use std::io::{Read, Write};
use std::time::Duration;

use arms::Arm;
use firmware_sim::{Bench, Line, WireSettings};
use proptest::prelude::*;
use rig::{Actuator, Dynamixel, Rig, RigError, RigFile};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

/// Ids of the rig file's servos.
const LIGHT: u8 = 1;
const SENSOR: u8 = 2;

/// A status packet's header up to its id.
const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];

/// Instruction of a status packet, and the error number of a register that may not be accessed (e-manual, Protocol 2.0).
const STATUS: u8 = 0x55;
const ACCESS_ERROR: u8 = 0x07;

/// A rig in front of the simulated bus, at whose terminal `tamper` stands: it gets the id that a request is for and the
/// replies to it, and says what the host hears instead.
fn tampered(mut tamper: impl FnMut(u8, Vec<u8>) -> Vec<u8> + Send + 'static) -> Dynamixel {
    let end = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&end).and_then(|()| unlockpt(&end)).unwrap();
    let path = ptsname(&end, Vec::new()).unwrap().into_string().unwrap();
    let file = RigFile::default();
    let rig = Dynamixel::open(path.as_ref(), &file).unwrap();
    let mut line = Line::new(Bench::new(&file).unwrap(), &WireSettings::new(&file).unwrap());
    std::thread::spawn(move || {
        let mut terminal = File::from(end);
        let mut request = [0; 256];
        // The read fails once the rig has closed its side.
        while let Ok(length) = terminal.read(&mut request) {
            let outgoing = line.receive(&request[..length], file.bus.baud, Duration::ZERO);
            let replies = outgoing.into_iter().flat_map(|part| part.bytes).collect();
            if terminal.write_all(&tamper(request[4], replies)).is_err() {
                return;
            }
        }
    });
    rig
}

/// Where an arm is, in as many requests as that takes, each made once.
async fn location(rig: &mut Dynamixel, arm: Arm) -> Result<arms::ArmAngle, RigError> {
    rig.axis(arm).location().await.map(|location| location.measured)
}

#[tokio::test]
async fn a_late_reply_of_another_device_is_passed_over() {
    // The sensor's first reply is late; it comes, again and again, before those of the light arm.
    let mut late = None;
    let mut rig = tampered(move |id, reply| match (id, &late) {
        (SENSOR, None) => {
            late = Some(reply);
            Vec::new()
        }
        (LIGHT, Some(late)) => [&late[..], &reply].concat(),
        _ => reply,
    });
    let lost = location(&mut rig, Arm::Sensor).await.unwrap_err();
    assert!(matches!(lost, RigError::NoReply { id: SENSOR, .. }), "{lost:?}");
    let light = location(&mut rig, Arm::Light).await.unwrap();
    assert!((light.deg() + 45.0).abs() < 0.2, "{}°", light.deg());

    // Once the sensor has caught up it owes nothing: then such a reply is damage.
    let sensor = location(&mut rig, Arm::Sensor).await.unwrap();
    assert!((sensor.deg() - 45.0).abs() < 0.2, "{}°", sensor.deg());
    let wrong = location(&mut rig, Arm::Light).await.unwrap_err();
    assert!(matches!(wrong, RigError::BadReply { .. }), "{wrong:?}");
    assert!(wrong.to_string().contains("id 2 answered instead"), "{wrong}");
}

/// The packet library tells of a refusal without its sender.
#[tokio::test]
async fn a_late_refusal_of_another_device_is_passed_over() {
    let refusal = |id: u8| {
        let bytes = [&HEADER[..], &[id, 4, 0, STATUS, ACCESS_ERROR]].concat();
        let crc = crc(&bytes);
        [&bytes[..], &crc.to_le_bytes()].concat()
    };
    let mut answered = false;
    let mut rig = tampered(move |id, reply| match id {
        // The sensor's first reply is late.
        SENSOR if !answered => {
            answered = true;
            Vec::new()
        }
        LIGHT => [refusal(SENSOR), reply].concat(),
        _ => reply,
    });
    let lost = location(&mut rig, Arm::Sensor).await.unwrap_err();
    assert!(matches!(lost, RigError::NoReply { id: SENSOR, .. }), "{lost:?}");
    let light = location(&mut rig, Arm::Light).await.unwrap();
    assert!((light.deg() + 45.0).abs() < 0.2, "{}°", light.deg());

    // Once the sensor has caught up it owes nothing: then such a refusal is damage, and not the light arm's.
    location(&mut rig, Arm::Sensor).await.unwrap();
    let wrong = location(&mut rig, Arm::Light).await.unwrap_err();
    assert!(matches!(wrong, RigError::BadReply { .. }), "{wrong:?}");
    assert!(wrong.to_string().contains("id 2 answered instead"), "{wrong}");

    // The light arm's own refusal is one.
    let mut rig = tampered(move |_, _| refusal(LIGHT));
    let refused = location(&mut rig, Arm::Light).await.unwrap_err();
    let own = matches!(
        refused,
        RigError::Refused {
            id: LIGHT,
            number: ACCESS_ERROR,
            ..
        }
    );
    assert!(own, "{refused:?}");
}

#[tokio::test]
async fn a_reply_of_a_device_that_was_never_asked_is_damage() {
    let mut rig = tampered(|_, mut reply| {
        reply[4] = 9;
        let end = reply.len() - 2;
        let crc = crc(&reply[..end]);
        reply[end..].copy_from_slice(&crc.to_le_bytes());
        reply
    });
    for _ in 0..2 {
        let wrong = location(&mut rig, Arm::Light).await.unwrap_err();
        assert!(matches!(wrong, RigError::BadReply { .. }), "{wrong:?}");
    }
}

/// `dynamixel2` 0.9.1 would panic at each of these, at the third and fourth only where the CRC is right. To the rig they are
/// damage, whether the reply proper comes so or that to the ping that follows, and the next good one is believed.
#[tokio::test]
async fn replies_too_short_for_a_status_packet_are_damage() {
    let with_crc = |bytes: &[u8]| [bytes, &crc(bytes).to_le_bytes()].concat();
    let packet = |rest: &[u8]| [&HEADER[..], &[LIGHT], rest].concat();
    let short = [
        packet(&[0, 0, 0x55, 0, 0, 0]),
        packet(&[1, 0, 0x55, 0, 0, 0]),
        [with_crc(&packet(&[2, 0])), vec![0; 4]].concat(),
        with_crc(&packet(&[3, 0, 0x55])),
        // What an adapter that echoes says to a ping.
        with_crc(&packet(&[3, 0, 0x01])),
    ];
    for bytes in short {
        let says = format!("{bytes:02X?}");
        let mut left = 2;
        let mut rig = tampered(move |_, reply| {
            if left == 0 {
                return reply;
            }
            left -= 1;
            bytes.clone()
        });
        for _ in 0..2 {
            let error = location(&mut rig, Arm::Light).await.unwrap_err();
            assert!(matches!(error, RigError::BadReply { .. }), "{says}: {error:?}");
            assert!(error.to_string().contains("impossible length"), "{says}: {error}");
        }
        let light = location(&mut rig, Arm::Light).await.unwrap();
        assert!((light.deg() + 45.0).abs() < 0.2, "{says}: {}°", light.deg());
    }
}

/// Whatever stands behind a status packet's header, with a right CRC somewhere or with none: no thread panics, it is a fault of the device (a
/// refusal, where it has the form of one), and the next
/// good reply is believed.
#[test]
fn no_reply_makes_the_bus_panic() {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let bytes = (
        proptest::bool::ANY,
        0..16_u16,
        proptest::collection::vec(proptest::num::u8::ANY, 0..24),
        proptest::bool::ANY,
    );
    proptest!(ProptestConfig { cases: 48, ..ProptestConfig::default() }, |((headed, length, rest, right) in bytes)| {
        let [low, high] = length.to_le_bytes();
        let front: &[u8] = if headed { &HEADER } else { &[] };
        let mut said = [front, &[LIGHT, low, high, STATUS], &rest].concat();
        if right {
            said.extend(crc(&said).to_le_bytes());
        }
        let mut left = 2;
        let mut rig = tampered(move |_, reply| {
            if left == 0 {
                return reply;
            }
            left -= 1;
            said.clone()
        });
        runtime.block_on(async {
            let mut errors = 0;
            let light = loop {
                match location(&mut rig, Arm::Light).await {
                    Ok(light) => break light,
                    Err(error) => {
                        errors += 1;
                        prop_assert!(matches!(error, RigError::BadReply { .. } | RigError::NoReply { .. } | RigError::Refused { .. }), "{error:?}");
                    }
                }
            };
            prop_assert!(errors <= 3, "{errors} errors of two replies");
            prop_assert!((light.deg() + 45.0).abs() < 0.2, "{}°", light.deg());
            Ok(())
        })?;
    });
}

/// CRC-16 of Protocol 2.0: polynomial 0x8005, no reflection.
fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(crc ^ u16::from(byte) << 8, |crc, _| {
            crc << 1 ^ if crc & 0x8000 == 0 { 0 } else { 0x8005 }
        })
    })
}
