//! Bad input is found before anything moves: exit 2, and a message that names the file, the key and what is allowed.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use tests::{Finished, Simulator, run};

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

const JOB: &str = "
[[plane]]
theta_r_deg = 70.0
readings = 10
[arc]
readings = 10
";

/// One thing that is wrong, and what the message must say.
struct Case {
    name: &'static str,
    job: &'static str,
    /// Lines of the rig file; `PORT` stands for the simulator's terminal.
    rig: &'static str,
    says: &'static [&'static str],
}

const CASES: [Case; 12] = [
    Case {
        name: "unknown key in the job",
        job: "speciment = \"x\"\n[[plane]]\ntheta_r_deg = 70.0\nreadings = 10\n",
        rig: "[bus]\nport = \"PORT\"\n",
        says: &["job.toml", "line 1", "speciment"],
    },
    Case {
        name: "wrong type in the job",
        job: "[[plane]]\ntheta_r_deg = 70.0\nreadings = \"many\"\n",
        rig: "[bus]\nport = \"PORT\"\n",
        says: &["job.toml", "line 3", "readings"],
    },
    Case {
        name: "plane out of range",
        job: "[[plane]]\ntheta_r_deg = 89.0\nreadings = 10\n",
        rig: "[bus]\nport = \"PORT\"\n",
        says: &["job.toml", "theta_r_deg", "89", "0 … 85"],
    },
    Case {
        name: "plane beyond the limits of this rig",
        job: JOB,
        rig: "[bus]\nport = \"PORT\"\n[sensor]\nmax_deg = 60.0\n",
        says: &["job.toml", "plane[0].theta_r_deg", "70", "60"],
    },
    Case {
        name: "arms that would meet",
        job: JOB,
        rig: "[bus]\nport = \"PORT\"\n[motion]\npark_light_deg = 42.0\npark_sensor_deg = 45.0\n",
        says: &["rig.toml", "park_sensor_deg", "3.000° apart", "5.000°"],
    },
    Case {
        name: "unknown key in the rig file",
        job: JOB,
        rig: "[bus]\nport = \"PORT\"\n[motion]\nsettle = 20\n",
        says: &["rig.toml", "settle"],
    },
    Case {
        name: "wrong type in the rig file",
        job: JOB,
        rig: "[bus]\nport = \"PORT\"\nbaud = \"fast\"\n",
        says: &["rig.toml", "line 3", "baud"],
    },
    Case {
        name: "value out of range in the rig file",
        job: JOB,
        rig: "[bus]\nport = \"PORT\"\n[light]\nmin_deg = -95.0\n",
        says: &["rig.toml", "light.min_deg", "-95", "-90"],
    },
    Case {
        name: "unknown material",
        job: JOB,
        rig: "[bus]\nport = \"sim\"\n[sim]\nspecimen = \"gold-pain\"\n",
        says: &["rig.toml", "sim.specimen", "gold-pain", "gold-paint"],
    },
    Case {
        name: "unknown key of the simulator",
        job: JOB,
        rig: "[bus]\nport = \"sim\"\n[sim]\nspeciment = \"gold-paint\"\n",
        says: &["rig.toml", "sim", "speciment"],
    },
    Case {
        name: "truncated MERL file",
        job: JOB,
        rig: "[bus]\nport = \"sim\"\n[sim]\nspecimen = \"./short.binary\"\n",
        says: &["rig.toml", "sim.specimen", "short.binary", "34992012"],
    },
    Case {
        name: "missing MERL file",
        job: JOB,
        rig: "[bus]\nport = \"sim\"\n[sim]\nspecimen = \"./none.binary\"\n",
        says: &["rig.toml", "sim.specimen", "none.binary"],
    },
];

/// Runs the job of a case; asserts that nothing moved, no run was begun, and no directory was left behind.
fn refused(case: &Case) -> Finished {
    let temporary = tempfile::tempdir().unwrap();
    let directory = temporary.path();
    let simulator = Simulator::new("");
    let port = simulator.server.path().display().to_string();
    fs::write(directory.join("job.toml"), case.job).unwrap();
    fs::write(directory.join("rig.toml"), case.rig.replace("PORT", &port)).unwrap();
    fs::write(directory.join("short.binary"), vec![0; 1000]).unwrap();
    let finished = run(GONIOCTL, directory, &["run", "job.toml", "--rig", "rig.toml"]);
    assert_eq!(
        simulator.server.counters().goals,
        0,
        "{}: an arm was told to move",
        case.name
    );
    let runs = fs::read_dir(directory.join("runs")).map_or(0, Iterator::count);
    assert_eq!(runs, 0, "{}: a run was begun", case.name);
    finished
}

#[test]
fn every_mistake_is_named_and_nothing_moves() {
    for case in &CASES {
        let finished = refused(case);
        assert_eq!(finished.code, 2, "{}: {}", case.name, finished.stderr);
        for said in case.says {
            assert!(
                finished.stderr.contains(said),
                "{}: \"{said}\" is missing in: {}",
                case.name,
                finished.stderr
            );
        }
        assert_eq!(finished.stdout, "", "{}: talk belongs on stderr", case.name);
    }
}

#[test]
fn a_port_in_use_is_refused() {
    let temporary = tempfile::tempdir().unwrap();
    let simulator = Simulator::new("");
    simulator.rig_file(temporary.path());
    fs::write(temporary.path().join("job.toml"), JOB).unwrap();
    let port = simulator.server.path().display().to_string();
    let _held = serialport::new(&port, 1_000_000).open_native().unwrap();
    let arguments = ["run", "job.toml", "--rig", "rig.toml"];
    let finished = run(GONIOCTL, temporary.path(), &arguments).expect(3);
    assert!(finished.stderr.contains(&port), "{}", finished.stderr);
    assert!(finished.stderr.contains("in use"), "{}", finished.stderr);
    assert_eq!(simulator.server.counters().goals, 0);
}

#[test]
fn a_port_that_cannot_be_used_ends_every_command_that_needs_it_with_3() {
    let temporary = tempfile::tempdir().unwrap();
    fs::write(temporary.path().join("job.toml"), JOB).unwrap();
    // Missing, and there but no serial port.
    for port in ["/dev/tty-no-such-port", "/dev/null"] {
        fs::write(
            temporary.path().join("rig.toml"),
            format!("bus.port = \"{port}\"\n"),
        )
        .unwrap();
        for command in [
            &["run", "job.toml"][..],
            &["doctor"],
            &["conform"],
            &["calibrate", "mirror"],
        ] {
            let arguments = [command, &["--rig", "rig.toml"]].concat();
            let finished = run(GONIOCTL, temporary.path(), &arguments).expect(3);
            let said = [finished.stdout, finished.stderr].concat();
            assert!(said.contains(port), "{command:?}: {said}");
        }
    }
    let runs = fs::read_dir(temporary.path().join("runs")).map_or(0, Iterator::count);
    assert_eq!(runs, 0, "a run was begun");
}

#[test]
fn with_json_every_error_is_an_object_on_stdout() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    fs::write(here.join("job.toml"), JOB).unwrap();
    fs::write(here.join("bad.toml"), "speciment = 1").unwrap();
    fs::write(here.join("rig.toml"), "bus.port = \"/dev/tty-no-such-port\"\n").unwrap();
    let nobody = "unix:nobody.sock";
    for (arguments, code) in [
        (&["run", "bad.toml"][..], 2),
        (&["run", "none.toml"], 2),
        (&["run", "--resume", "none"], 2),
        (&["run", "job.toml", "--rig", "rig.toml"], 3),
        (&["plan", "bad.toml"], 2),
        (&["eval", "no-such-brdf", "lambert:0.5"], 2),
        (&["reconstruct", "none"], 2),
        (&["doctor", "--rig", "bad.toml"], 2),
        (&["jobs", "--daemon", nobody], 5),
        (&["watch", "--daemon", nobody], 5),
        (&["run", "job.toml", "--no-such-option"], 2),
        (&["jobs", "--daemon"], 2),
    ] {
        let plain = run(GONIOCTL, here, arguments).expect(code);
        assert_eq!(plain.stdout, "", "{arguments:?}");
        let finished = run(GONIOCTL, here, &[arguments, &["--json"]].concat()).expect(code);
        let object: serde_json::Value = serde_json::from_str(&finished.stdout)
            .unwrap_or_else(|error| panic!("{arguments:?}: {error}: {:?}", finished.stdout));
        let error = &object["error"];
        assert_eq!(error["exit_status"], code, "{arguments:?}: {object}");
        assert!(
            error["message"].as_str().is_some_and(|text| !text.is_empty()),
            "{object}"
        );
        assert!(!finished.stderr.is_empty(), "{arguments:?}");
    }
}

#[test]
fn a_file_in_another_encoding_is_told_so() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    let text = format!("specimen = \"Gold, geprüft\"{JOB}");
    let utf16: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let latin1: Vec<u8> = text.chars().map(|c| c as u8).collect();
    fs::write(here.join("job.toml"), JOB).unwrap();
    for (encoding, bytes) in [("UTF-16", utf16), ("Latin-1", latin1)] {
        fs::write(here.join("other.toml"), bytes).unwrap();
        for arguments in [
            &["plan", "other.toml"][..],
            &["plan", "job.toml", "--rig", "other.toml"],
            &["calibrate", "white", "--standard", "other.toml"],
            &["study", "other.toml"],
            &["campaign", "--replay", "other.toml"],
        ] {
            let finished = run(GONIOCTL, here, arguments).expect(2);
            let said = finished.stderr;
            assert!(
                said.contains(encoding) && said.contains("UTF-8"),
                "{arguments:?}: {said}"
            );
            assert!(said.contains("other.toml"), "{arguments:?}: {said}");
        }
    }
}

#[test]
fn every_unknown_key_is_told_at_once() {
    let temporary = tempfile::tempdir().unwrap();
    let here = temporary.path();
    fs::write(
        here.join("job.toml"),
        format!("speciment = \"x\"\nonstage = true\n{JOB}"),
    )
    .unwrap();
    fs::write(here.join("good.toml"), JOB).unwrap();
    fs::write(
        here.join("rig.toml"),
        "[bus]\nbuad = 57600\n[motion]\nsettle = 20\n[sim]\nspeciment = \"x\"\nsede = 3\n",
    )
    .unwrap();
    let said = run(GONIOCTL, here, &["plan", "job.toml"]).expect(2).stderr;
    for key in [
        "line 1: speciment",
        "did you mean `specimen`?",
        "line 2: onstage",
        "did you mean `on_stage`?",
    ] {
        assert!(said.contains(key), "\"{key}\" is missing in: {said}");
    }
    let said = run(GONIOCTL, here, &["plan", "good.toml", "--rig", "rig.toml"])
        .expect(2)
        .stderr;
    for key in [
        "line 2: bus.buad",
        "did you mean `baud`?",
        "line 4: motion.settle",
        "did you mean `settle_ms`?",
    ] {
        assert!(said.contains(key), "\"{key}\" is missing in: {said}");
    }
    fs::write(
        here.join("rig.toml"),
        "[sim]\nspeciment = \"x\"\nsede = 3\nwire.noyse = 0.1\n",
    )
    .unwrap();
    let said = run(GONIOCTL, here, &["run", "good.toml", "--rig", "rig.toml"])
        .expect(2)
        .stderr;
    for key in ["did you mean `specimen`?", "did you mean `seed`?"] {
        assert!(said.contains(key), "\"{key}\" is missing in: {said}");
    }
}

#[test]
fn a_campaign_says_nothing_of_what_it_breaks_on_purpose() {
    let temporary = tempfile::tempdir().unwrap();
    let arguments = ["campaign", "--captures", "60", "--seed", "1"];
    let finished = run(GONIOCTL, temporary.path(), &arguments).expect(0);
    let lines = finished.stderr.lines().count();
    // Its beginning, a line each tenth, its end.
    assert!(lines <= 12, "{lines} lines: {}", finished.stderr);
    assert!(!finished.stderr.contains("WARN"), "{}", finished.stderr);
}

#[test]
fn an_out_directory_that_cannot_be_written_is_refused() {
    let temporary = tempfile::tempdir().unwrap();
    let simulator = Simulator::new("");
    simulator.rig_file(temporary.path());
    fs::write(temporary.path().join("job.toml"), JOB).unwrap();
    // Also root cannot make a directory below a file, or below what the kernel makes up.
    fs::write(temporary.path().join("file"), "").unwrap();
    for out in ["file", "file/below", "/proc/no-runs-here"] {
        let arguments = ["run", "job.toml", "--rig", "rig.toml", "--out", out];
        let finished = run(GONIOCTL, temporary.path(), &arguments).expect(2);
        assert!(finished.stderr.contains(out), "{}", finished.stderr);
        assert_eq!(simulator.server.counters().goals, 0, "{out}");
    }
}

#[test]
fn missing_files_are_named() {
    let temporary = tempfile::tempdir().unwrap();
    let finished = run(GONIOCTL, temporary.path(), &["run", "none.toml"]).expect(2);
    assert!(finished.stderr.contains("none.toml"), "{}", finished.stderr);
    let resume = ["run", "--resume", "no-run"];
    let finished = run(GONIOCTL, temporary.path(), &resume).expect(2);
    assert!(finished.stderr.contains("no-run"), "{}", finished.stderr);
    assert!(!Path::new(&temporary.path().join("runs")).exists());
}
