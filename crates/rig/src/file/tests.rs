use std::path::Path;

use super::*;
use crate::ServoUnits;
use crate::dynamixel::MODELS;

fn parse(text: &str) -> Result<RigFile, RigError> {
    RigFile::parse(text, Path::new("bench.toml"))
}

fn message(text: &str) -> String {
    parse(text).expect_err(text).to_string()
}

#[test]
fn the_shipped_file_is_the_default() {
    assert_eq!(parse(RigFile::BUILT_IN).unwrap(), RigFile::default());
    let rig = RigFile::default();
    assert_eq!(rig.bus.port, Port::Sim);
    assert_eq!(rig.bus.baud, 1_000_000);
    assert_eq!(rig.arm(Arm::Sensor).id, 2);
    assert_eq!(rig.arm(Arm::Light).axis.zero_count, 2048.0);
    assert_eq!(rig.motion.park, Pose::from_deg(-45.0, 45.0));
    assert_eq!(rig.sim["seed"].as_integer(), Some(1));
}

#[test]
fn own_keys_stand_over_the_built_in_ones() {
    let rig = parse(
        "[bus]\nport = \"/dev/ttyUSB0\"\n[light]\nzero_deg = 90\n[sim]\nseed = 7\n[sim.noise]\nlamp = 0.1",
    )
    .unwrap();
    assert_eq!(rig.bus.port, Port::Path("/dev/ttyUSB0".into()));
    assert_eq!(rig.bus.baud, 1_000_000);
    assert_eq!(rig.arm(Arm::Light).axis.zero_count, 1024.0);
    assert_eq!(rig.sim["seed"].as_integer(), Some(7));
    assert_eq!(rig.sim["specimen"].as_str(), Some("gold-paint"));
    assert_eq!(rig.sim["noise"]["lamp"].as_float(), Some(0.1));
}

#[test]
fn speed_is_what_the_servo_can_hold() {
    let axis = RigFile::default().arms[0].axis;
    let profile = RigFile::default().arms[0].profile;
    assert_eq!(axis.profile_registers(profile), [43, 9]);
    assert_eq!(axis.quantised(profile), profile);
    let geared = parse("[light]\ngear = 2\n").unwrap().arms[0].clone();
    assert_eq!(geared.axis.profile_registers(geared.profile), [87, 18]);
}

/// Every message with file, line, key and what is allowed.
#[test]
fn errors_say_where_and_what_is_allowed() {
    let table = [
        (
            "[bus]\nbaud = 19200",
            "bench.toml, line 2: bus.baud is 19200, allowed: 9600, 57600, 115200, 1000000, 2000000, 3000000, 4000000, 4500000",
        ),
        (
            "[bus]\nbaud = 4500000\n[sensor]\nmodel = \"XC330-T288-T\"",
            "bench.toml, line 2: bus.baud is 4500000, allowed: 9600, 57600, 115200, 1000000, 2000000, 3000000, 4000000 with an XC330-T288",
        ),
        (
            "[sensor]\nmodel = \"PH54-200-S500-R\"",
            "bench.toml: sensor.max_deg is 88, which is servo count 747308, allowed: servo counts -501923 … 501923 after zero_deg, sign and gear",
        ),
        (
            "[sensor]\nmodel = \"PH42-020-S300\"\nzero_deg = 200",
            "bench.toml, line 3: sensor.zero_deg is 200, allowed: -180 … 180",
        ),
        (
            "[suspend]\nsupply_v = \"battery\"",
            "bench.toml, line 2: suspend.supply_v is \"battery\", allowed: \"model\", or [hold, release] in V for both servos",
        ),
        (
            "[bus]\nlatency_ms = -1",
            "bench.toml, line 2: bus.latency_ms is -1, allowed: 0 … 100",
        ),
        (
            "[bus]\nsilence_ms = nan",
            "bench.toml, line 2: bus.silence_ms is NaN, allowed: 50 … 5000",
        ),
        (
            "[bus]\nport = \"\"",
            "bench.toml, line 2: bus.port is empty, allowed: \"sim\" or a serial port",
        ),
        (
            "[light]\n\nid = 300",
            "bench.toml, line 3: light.id is 300, allowed: 0 … 252",
        ),
        (
            "[light]\nid = 2",
            "bench.toml: sensor.id is 2, allowed: an id that no other device of the rig has",
        ),
        (
            "[photometer]\nid = 1",
            "bench.toml, line 2: photometer.id is 1, allowed: an id that no other device of the rig has",
        ),
        (
            "[sensor]\nsign = 0",
            "bench.toml, line 2: sensor.sign is 0, allowed: 1, -1",
        ),
        (
            "[sensor]\nvelocity_deg_s = 1",
            "bench.toml, line 2: sensor.velocity_deg_s is 1, allowed: 1.374 … 1405.602",
        ),
        (
            "[sensor]\nacceleration_deg_s2 = 0",
            "bench.toml, line 2: sensor.acceleration_deg_s2 is 0, allowed: 21.458 … 703104.455",
        ),
        (
            "[sensor]\nreturn_delay_us = 3",
            "bench.toml, line 2: sensor.return_delay_us is 3, allowed: 0 … 508 in steps of 2",
        ),
        (
            "[sensor]\nmin_deg = 20\nmax_deg = 10",
            "bench.toml, line 3: sensor.max_deg is 10, allowed: above sensor.min_deg, which is 20",
        ),
        (
            "[sensor]\nmax_deg = 95",
            "bench.toml, line 2: sensor.max_deg is 95, allowed: -90 … 90",
        ),
        (
            "[light]\nzero_deg = 350",
            "bench.toml: light.max_deg is 88, which is servo count 4983, allowed: servo counts 0 … 4095 after zero_deg, sign and gear",
        ),
        (
            "[motion]\nestop = \"drop\"",
            "bench.toml, line 2: motion.estop is \"drop\", allowed: \"hold\", \"limp\"",
        ),
        (
            "[motion]\nwatchdog_ms = 30",
            "bench.toml, line 2: motion.watchdog_ms is 30, allowed: 0, or 20 … 2540 in steps of 20",
        ),
        (
            "[motion]\npark_light_deg = 89",
            "bench.toml, line 2: motion.park_light_deg is 89, allowed: -88 … 88",
        ),
        (
            "[motion]\npark_light_deg = 1\npark_sensor_deg = 3",
            "bench.toml, line 3: motion.park_sensor_deg is 3: arms 2.000° apart with light at 1.000° and sensor at 3.000°, at least 5.000° are needed, allowed: a pose within [envelope]",
        ),
        (
            "[photometer]\nintegration_min_us = 500\nintegration_max_us = 400",
            "bench.toml, line 3: photometer.integration_max_us is 400, allowed: 500 … 10000000",
        ),
        (
            "[photometer]\nintegration_max_us = 300000",
            "bench.toml, line 2: photometer.integration_max_us is 300000, allowed: below 209715, where the lamp monitor is full (calibration.monitor)",
        ),
        (
            "[calibration]\nresponsivity = [1.0, 0.0, 1.0]",
            "bench.toml, line 2: calibration.responsivity is [1.0, 0.0, 1.0], allowed: three finite values > 0",
        ),
        (
            "[calibration]\nmonitor = inf",
            "bench.toml, line 2: calibration.monitor is inf, allowed: a finite value > 0",
        ),
    ];
    for (text, expected) in table {
        assert_eq!(message(text), expected);
    }
}

#[test]
fn a_model_that_is_not_known_is_answered_with_all_that_are() {
    let message = message("[light]\nmodel = \"AX-12\"");
    assert!(
        message.starts_with("bench.toml, line 2: light.model is \"AX-12\", allowed: \"XM430-W350\", "),
        "{message}"
    );
    for model in MODELS {
        assert!(message.contains(&format!("\"{}\"", model.name)), "{message}");
    }
}

/// What a P series counts, and in which units: 1,003,846 counts a turn, 0.01 rev/min, 1 rev/min².
#[test]
fn an_arm_has_the_units_of_its_servo() {
    let rig = parse("[light]\nmodel = \"PH54-200-S500-R\"\nzero_deg = 10\n").unwrap();
    let light = rig.arm(Arm::Light);
    assert_eq!(light.model.number, 2020);
    assert_eq!(light.axis.zero_count, 1_003_846.0 / 36.0);
    // 60 °/s are 10 rev/min; 200 °/s² are 2000 rev/min².
    assert_eq!(light.axis.profile_registers(light.profile), [1000, 2000]);
    let quarter = light.axis.counts(ArmAngle::from_deg(90.0)) - light.axis.zero_count;
    assert!((quarter - 250_961.5).abs() < 1e-6, "{quarter}");
    let sensor = rig.arm(Arm::Sensor);
    assert_eq!((sensor.model.number, sensor.axis.units), (1020, ServoUnits::X));
}

#[test]
fn the_supply_that_is_watched_follows_each_model() {
    let bounds = |text: &str| {
        let suspend = parse(text).unwrap().suspend;
        suspend
            .supply_v
            .map(|band| band.map(|band| [band.hold, band.release]))
    };
    assert_eq!(bounds(""), [Some([10.5, 11.0]); 2]);
    let mixed = "[light]\nmodel = \"XH430-V350\"\nvelocity_deg_s = 30\n[sensor]\nmodel = \"XL330-M288\"\n";
    assert_eq!(bounds(mixed), [Some([21.0, 22.0]), Some([4.4, 4.6])]);
    assert_eq!(bounds("[suspend]\nsupply_v = [9, 9.5]\n"), [Some([9.0, 9.5]); 2]);
    assert_eq!(bounds("[suspend]\nsupply_v = [0, 0]\n"), [None; 2]);
}

/// What was stored before an axis had units of its own is of the X series, and what is stored of the X series has none.
#[test]
fn a_stored_axis_without_units_is_of_the_x_series() {
    let axis = RigFile::default().arms[0].axis;
    let text = toml::to_string(&axis).unwrap();
    assert_eq!(text, "sign = 1.0\nzero_count = 2048.0\ngear = 1.0\n");
    assert_eq!(toml::from_str::<Axis>(&text).unwrap(), axis);
    let other = parse("[light]\nmodel = \"PM42-010-S260\"\nzero_deg = 0\n")
        .unwrap()
        .arms[0]
        .axis;
    let text = toml::to_string(&other).unwrap();
    assert_eq!(toml::from_str::<Axis>(&text).unwrap(), other);
}

#[test]
fn bad_toml_unknown_keys_and_wrong_types_name_their_line() {
    for (text, parts) in [
        ("[bus\nport = 1", vec!["bench.toml, line 1: "]),
        (
            "[bus]\n\nboud = 1",
            vec!["bench.toml, line 3: ", "unknown field `boud`", "`baud`"],
        ),
        ("[buss]\n", vec!["bench.toml, line 1: ", "unknown field `buss`"]),
        (
            "[bus]\nbaud = \"fast\"",
            vec!["bench.toml, line 2: bus.baud: ", "string \"fast\""],
        ),
        (
            "[bus]\nbaud = 1e6",
            vec!["bench.toml, line 2: bus.baud: ", "floating point"],
        ),
        ("bus = 3", vec!["bench.toml, line 1: bus: "]),
        (
            "[sim]\nseed = 1\nseed = 2",
            vec!["bench.toml, line 3: ", "duplicate key"],
        ),
        (
            "[calibration]\nresponsivity = [1.0]",
            vec!["bench.toml, line 2: calibration.responsivity: ", "length"],
        ),
    ] {
        let message = message(text);
        for part in parts {
            assert!(message.contains(part), "{message:?} lacks {part:?}");
        }
    }
}

#[test]
fn a_missing_file_is_named() {
    let error = RigFile::load("/nowhere/rig.toml").unwrap_err();
    assert_eq!(error.to_string(), "cannot read the rig file /nowhere/rig.toml");
    assert_eq!(crate::Fault::kind(&error), crate::FaultKind::Setup);
}

#[test]
fn a_key_by_its_old_name_is_read_and_not_beside_its_new_one() {
    let near = |text: &str| parse(text).map(|file| file.motion.near_rad.to_degrees());
    assert!((near("[motion]\ntolerance_deg = 0.25").unwrap() - 0.25).abs() < 1e-12);
    let error = near("[motion]\nnear_deg = 0.3\ntolerance_deg = 0.25")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("motion.tolerance_deg") && error.contains("near_deg"),
        "{error}"
    );
    let range = near("\n[motion]\ntolerance_deg = 50").unwrap_err().to_string();
    assert!(range.contains("0.05 … 5") && range.contains('3'), "{range}");
}

#[test]
fn angles_are_as_unsure_as_the_servos_manual_says_unless_told_otherwise() {
    let deg = |text: &str| {
        let known = parse(text).unwrap().uncertainty;
        [known.play_rad, known.angle_rad].map(|of| of.map(f64::to_degrees))
    };
    let close = |[a, b]: [f64; 2], [x, y]: [f64; 2]| (a - x).abs() < 1e-9 && (b - y).abs() < 1e-9;
    let [play, angle] = deg("");
    assert!(close(play, [0.25; 2]), "{play:?}");
    assert!(close(angle, [360.0 / 4096.0 / 12_f64.sqrt(); 2]), "{angle:?}");
    let [play, angle] = deg("[light]\ngear = 2.0\n[sensor]\nmodel = \"MX-28\"");
    assert!(close(play, [0.125, 1.0 / 3.0]), "{play:?}");
    assert!((angle[1] / angle[0] - 2.0).abs() < 1e-9, "{angle:?}");
    let [play, angle] = deg("[uncertainty]\nplay_deg = 0\nangle_deg = 0.01");
    assert!(close(play, [0.0; 2]) && close(angle, [0.01; 2]));
    for bad in [
        "play_deg = \"manual\"",
        "play_deg = -1",
        "angle_deg = [1, 2]",
        "play_deg = nan",
    ] {
        let error = parse(&format!("[uncertainty]\n{bad}")).unwrap_err().to_string();
        let key = bad.split(' ').next().unwrap();
        assert!(error.contains(&format!("uncertainty.{key}")), "{error}");
    }
}

#[test]
fn the_fingerprint_follows_what_a_calibration_depends_on() {
    let print = |text: &str| parse(text).unwrap().fingerprint;
    let plain = print("");
    assert_eq!(plain.len(), 64);
    for same in [
        "[sim]\nseed = 3",
        "[bus]\nport = \"/dev/ttyUSB1\"",
        "[calibration]\nmax_age_h = 1\ncertificate = \"required\"",
        "[light]\nvelocity_deg_s = 60 # the default\n",
    ] {
        assert_eq!(print(same), plain, "{same}");
    }
    for other in [
        "[light]\nzero_deg = 181",
        "[photometer]\nfull_scale = 1000000",
        "[calibration]\nfilling = \"under\"",
        "[calibration]\nmonitor = 5.1",
        "[motion]\napproach = \"up\"",
    ] {
        assert_ne!(print(other), plain, "{other}");
    }
}

#[test]
fn bounds_of_suspension_need_room_between_them() {
    let parse = |suspend: &str| RigFile::parse(&format!("[suspend]\n{suspend}"), Path::new("test.toml"));
    let suspend = parse("lamp_percent = [10, 5]\ndisk_mb = [0, 0]\nsupply_v = [9.8, 11.5]")
        .unwrap()
        .suspend;
    let lamp = suspend.lamp_rel.unwrap();
    assert!((lamp.hold - 0.1).abs() < 1e-12 && (lamp.release - 0.05).abs() < 1e-12);
    assert_eq!(suspend.disk_bytes, None);
    // Too high holds above the first and goes on at the second, too low likewise below.
    assert!(lamp.holds(0.11, false) && !lamp.holds(0.07, false) && lamp.holds(0.07, true));
    assert!(!lamp.holds(0.05, true) && !lamp.holds(f64::NAN, true));
    let supply = suspend.supply_v[1].unwrap();
    assert!(supply.holds(9.7, false) && !supply.holds(11.0, false) && supply.holds(11.0, true));
    for bad in [
        "lamp_percent = [5, 10]",
        "supply_v = [11, 10]",
        "temperature_c = [-5, -6]",
        "disk_mb = [nan, 1]",
    ] {
        let text = parse(bad).unwrap_err().to_string();
        assert!(text.contains("hold") && text.contains("line 2"), "{bad}: {text}");
    }
    assert!(parse("every_s = 0").is_err());
}
