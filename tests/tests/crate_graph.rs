//! Dependencies run one way, and the crates at the bottom stay pure.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What each crate stands on; it may also name what those stand on.
const EDGES: [(&str, &[&str]); 17] = [
    ("arms", &[]),
    ("brdf", &[]),
    ("formats", &["brdf"]),
    ("terminal", &[]),
    ("config", &[]),
    ("pdv", &["brdf"]),
    ("sweep", &["pdv", "arms", "config"]),
    ("rig", &["arms", "config"]),
    ("capture", &["sweep", "rig", "pdv"]),
    ("report", &["capture", "pdv", "formats"]),
    ("firmware-sim", &["pdv", "arms", "rig", "terminal"]),
    ("study", &["report", "firmware-sim"]),
    ("session", &["report", "firmware-sim"]),
    ("api", &[]),
    ("goniod", &["session", "api"]),
    ("gonioctl", &["session", "api", "study"]),
    ("tests", &["gonioctl", "goniod"]),
];

/// Crates whose own tests may use the in-process rig.
const TESTED_ON_THE_SIMULATOR: [&str; 2] = ["capture", "report"];

/// What only the daemon needs: the command line is built, and starts, without it.
const NOT_IN_THE_COMMAND_LINE: [&str; 10] = [
    "goniod",
    "axum",
    "governor",
    "hyper",
    "libsqlite3-sys",
    "prometheus-client",
    "sqlx",
    "tower-http",
    "utoipa",
    "utoipa-axum",
];

/// No I/O but files behind explicit functions: nothing of these may appear in their manifests or sources.
const PURE: [&str; 6] = ["arms", "brdf", "config", "formats", "pdv", "sweep"];
const NOT_IN_A_PURE_MANIFEST: [&str; 4] = ["tokio", "rustix", "serialport", "tracing-subscriber"];
const NOT_IN_A_PURE_SOURCE: [&str; 5] = [
    "std::env",
    "std::net",
    "std::process",
    "SystemTime",
    "Instant::now",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the tests crate lies in the workspace")
        .to_owned()
}

fn directory(name: &str) -> PathBuf {
    match name {
        "firmware-sim" | "tests" => root().join(name),
        _ => root().join("crates").join(name),
    }
}

fn manifest(name: &str) -> toml::Table {
    let path = directory(name).join("Cargo.toml");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    text.parse().unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn dependencies(name: &str, section: &str) -> BTreeSet<String> {
    let manifest = manifest(name);
    let table = manifest.get(section).and_then(toml::Value::as_table);
    table.into_iter().flat_map(|t| t.keys().cloned()).collect()
}

/// Everything below a crate.
fn below(name: &str) -> BTreeSet<&'static str> {
    let edges: BTreeMap<_, _> = EDGES.into_iter().collect();
    let mut found = BTreeSet::new();
    let mut open = edges[name].to_vec();
    while let Some(next) = open.pop() {
        if found.insert(next) {
            open.extend(edges[next]);
        }
    }
    found
}

#[test]
fn every_crate_stands_only_on_what_lies_below_it() {
    let ours: BTreeSet<&str> = EDGES.iter().map(|(name, _)| *name).collect();
    for (name, _) in EDGES {
        let allowed = below(name);
        for section in ["dependencies", "dev-dependencies", "build-dependencies"] {
            let on_simulator = section == "dev-dependencies" && TESTED_ON_THE_SIMULATOR.contains(&name);
            for dependency in dependencies(name, section) {
                let ok = !ours.contains(dependency.as_str())
                    || allowed.contains(dependency.as_str())
                    || (on_simulator && dependency == "firmware-sim");
                assert!(
                    ok,
                    "{name} names {dependency} in [{section}]; it may stand on {allowed:?}"
                );
            }
        }
    }
}

/// Every package that a package of ours needs to be built, with the features that it asks for.
fn needs(package: &str) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--package", package])
        .args(["--edges", "normal,build", "--prefix", "none", "--format", "{p}"])
        .current_dir(root())
        .output()
        .expect("cargo can be run where tests are");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo tree: {said}");
    let listed = String::from_utf8(output.stdout).expect("names of crates are text");
    let name = |line: &str| line.split(' ').next().unwrap_or_default().to_owned();
    listed.lines().map(name).collect()
}

#[test]
fn the_command_line_needs_no_http_server_no_database_and_no_openapi() {
    let command_line = needs("gonioctl");
    assert!(command_line.contains("session"), "{command_line:?}");
    let daemon = needs("goniod");
    for name in NOT_IN_THE_COMMAND_LINE {
        assert!(!command_line.contains(name), "gonioctl needs {name}");
        assert!(
            daemon.contains(name),
            "{name} is no dependency of the daemon any more"
        );
    }
}

#[test]
fn the_table_above_names_every_crate_of_the_workspace() {
    let mut found: BTreeSet<String> = std::fs::read_dir(root().join("crates"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    found.extend(["firmware-sim".to_owned(), "tests".to_owned()]);
    // The Python package is a workspace of its own, so that no command here needs Python.
    assert!(found.remove("goniod-py"));
    let named: BTreeSet<String> = EDGES.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(found, named);
}

#[test]
fn the_crates_at_the_bottom_know_no_clock_no_environment_and_no_runtime() {
    for name in PURE {
        let named = dependencies(name, "dependencies");
        for forbidden in NOT_IN_A_PURE_MANIFEST {
            assert!(!named.contains(forbidden), "{name} depends on {forbidden}");
        }
        let mut open = vec![directory(name).join("src")];
        while let Some(path) = open.pop() {
            if path.is_dir() {
                open.extend(std::fs::read_dir(&path).unwrap().map(|e| e.unwrap().path()));
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                for forbidden in NOT_IN_A_PURE_SOURCE {
                    assert!(!text.contains(forbidden), "{} uses {forbidden}", path.display());
                }
            }
        }
    }
}
