//! Every example of a file that config, docs and rustdoc show is one that the program takes.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use firmware_sim::{Order, Settings, WireSettings};
use rig::RigFile;
use sweep::Job;

/// A job to which a fragment of one is added.
const JOB: &str = "plane = [{ theta_r_deg = 60.0, readings = 6 }]\nreconstruction.model = \"planes\"\n";
/// A histogram that a job file may name.
const DIRECTIONS: &str = "theta_i_deg,theta_o_deg,weight\n10,20,1\n";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// Files below a folder whose names end so, but for what was built.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|found| found == extension) {
            found.push(path);
        }
    }
    found
}

/// The text of comments in a source file or TOML file; all of any other.
fn prose(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let marks: &[&str] = match path.extension().and_then(|extension| extension.to_str()) {
        Some("rs") => &["///", "//!"],
        Some("toml") => &["#"],
        _ => return text,
    };
    let comment = |line: &str| {
        let line = line.trim_start();
        marks
            .iter()
            .find_map(|mark| line.strip_prefix(mark).map(str::to_owned))
    };
    text.lines().filter_map(comment).collect::<Vec<_>>().join("\n")
}

fn documents() -> Vec<PathBuf> {
    let root = root();
    let mut all = files(&root, "md");
    all.extend(files(&root.join("config"), "toml"));
    for folder in ["crates", "firmware-sim", "tests"] {
        all.extend(files(&root.join(folder), "rs"));
    }
    all
}

/// Whether a rig file is taken, by the simulator too.
fn rig(text: &str) -> Result<(), String> {
    let file = RigFile::parse(text, Path::new("example")).map_err(|error| error.to_string())?;
    Settings::new(&file).map_err(|error| error.to_string())?;
    WireSettings::new(&file).map_err(|error| error.to_string())?;
    Ok(())
}

/// Whether a job file, or a part of one, is taken; it may name a histogram beside it.
fn job(text: &str) -> Result<(), String> {
    let mut whole: toml::Table = JOB.parse().unwrap();
    whole.extend(text.parse::<toml::Table>().map_err(|error| error.to_string())?);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("job.toml");
    fs::write(&path, whole.to_string()).unwrap();
    fs::write(folder.path().join("directions.csv"), DIRECTIONS).unwrap();
    let text = session::job_text(&path).map_err(|error| error.to_string())?;
    Job::parse(&text, "example")
        .map(drop)
        .map_err(|error| error.to_string())
}

/// Whether a daemon takes a file that says who is told of what.
fn notify(text: &str) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("notify.toml");
    fs::write(&path, text).unwrap();
    let read = goniod::Webhook::read(&path);
    read.map(drop).map_err(|error| error.to_string())
}

fn standard(text: &str) -> Result<(), String> {
    let parsed = report::WhiteReference::parse(text, "example");
    parsed.map(drop).map_err(|error| error.to_string())
}

fn order(text: &str) -> Result<(), String> {
    text.parse::<Order>().map(drop).map_err(|error| error.to_string())
}

/// Asserts that an example is taken as one of the things that it may be.
fn assert_taken(path: &Path, example: &str, readings: &[Result<(), String>]) {
    let why: Vec<_> = readings.iter().filter_map(|taken| taken.as_ref().err()).collect();
    assert!(
        why.len() < readings.len(),
        "{}: nothing takes the example\n{example}\n{why:#?}",
        path.display()
    );
}

/// The inline tables of a text: `{ key = value, … }`.
fn inline_tables(text: &str) -> Vec<&str> {
    let mut found = Vec::new();
    let mut from = 0;
    while let Some(open) = text[from..].find("{ ").map(|at| from + at) {
        from = open + 1;
        let mut depth = 0;
        let closed = text[open..].char_indices().find_map(|(at, c)| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            (depth == 0).then_some(open + at + 1)
        });
        let Some(close) = closed else { continue };
        let table = &text[open..close];
        let key = table[2..].split(' ').next().unwrap_or_default();
        let is_key = !key.is_empty() && key.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_');
        if is_key && table[2 + key.len()..].starts_with(" = ") && !table.contains('…') {
            found.push(table);
            from = close;
        }
    }
    found
}

#[test]
fn every_toml_block_of_the_documents_is_taken() {
    let mut blocks = 0;
    for path in documents() {
        let text = prose(&path);
        for block in text.split("```toml\n").skip(1) {
            let block = block.split("```").next().unwrap();
            assert_taken(
                &path,
                block,
                &[
                    job(block),
                    rig(block),
                    standard(block),
                    order(block),
                    notify(block),
                ],
            );
            blocks += 1;
        }
    }
    assert!(
        blocks >= 5,
        "{blocks} blocks: they were looked for in the wrong place"
    );
}

#[test]
fn every_inline_table_of_the_documents_is_taken() {
    let mut tables = 0;
    for path in documents() {
        let text = prose(&path);
        for table in inline_tables(&text) {
            let fault = order(&format!("fault = {table}"));
            let what = order(&format!("fault = {{ device = \"sensor\", what = {table} }}"));
            let silent = rig(&format!("sim.wire.silent = [{table}]"));
            let plane = job(&format!("plane = [{table}]"));
            let keys = ["light", "creep", "hunting", "ring", "encoder_error", "place"];
            let mechanics = keys.map(|key| rig(&format!("sim.{key} = {table}")));
            let readings = [vec![fault, what, silent, plane], mechanics.into()].concat();
            assert_taken(&path, table, &readings);
            tables += 1;
        }
    }
    assert!(
        tables >= 10,
        "{tables} tables: they were looked for in the wrong place"
    );
}

/// Each word in quotes that docs/simulator.md gives as something that goes wrong.
#[test]
fn every_fault_that_the_documents_name_is_taken() {
    let text = fs::read_to_string(root().join("docs/simulator.md")).unwrap();
    let line = text.lines().find(|line| line.contains("{ silence_s = ")).unwrap();
    let words: Vec<_> = line
        .split("`\"")
        .skip(1)
        .filter_map(|rest| rest.split("\"`").next())
        .collect();
    assert!(words.len() >= 4, "{words:?}");
    for word in words {
        order(&format!("fault = {{ device = \"sensor\", what = \"{word}\" }}")).unwrap();
    }
}

/// A key behind a # shows what may stand there.
#[test]
fn every_key_behind_a_comment_sign_is_taken() {
    for path in files(&root().join("config"), "toml") {
        let text = fs::read_to_string(&path).unwrap();
        for (number, line) in text.lines().enumerate() {
            let Some((key, _)) = line.strip_prefix("# ").and_then(|line| line.split_once(" = ")) else {
                continue;
            };
            if !key.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_') {
                continue;
            }
            let shown: String = text
                .lines()
                .enumerate()
                .map(|(n, other)| match n == number {
                    true => format!("{}\n", &other[2..]),
                    false => format!("{other}\n"),
                })
                .collect();
            // What belongs together is shown together.
            let together = shown
                .replace("# directions = ", "directions = ")
                .replace("\ntheta_i_deg", "\n# theta_i_deg")
                .replace("\ntheta_o_deg", "\n# theta_o_deg");
            assert_taken(
                &path,
                line,
                &[rig(&shown), job(&shown), job(&together), notify(&shown)],
            );
        }
    }
}
