use std::fs::OpenOptions;
use std::io::Write;
use std::path::Path;

use arms::Pose;
use capture::{FileJournal, Flag, Header, Journal, JournalError, Outcome, Reading, Record};
use rig::{Counts, Exposure, Gain, Identity};
use sweep::{Plan, Sweep};
use tempfile::TempDir;

fn header() -> Header {
    Header {
        run: "01JD".to_owned(),
        version: "0.1.0".to_owned(),
        job: "[[plane]]\n\"ü\"".to_owned(),
        rig: String::new(),
        plan: Plan {
            steps: Vec::new(),
            left_out: Vec::new(),
            overhead_s: 0.2,
            closing_s: 0.1,
            open: false,
        },
        started: "2026-11-22T04:00:00Z".to_owned(),
        certificate: None,
    }
}

fn reading(step: usize) -> Record {
    Record::Reading(Reading {
        step,
        attempt: 0,
        accepted: true,
        sweep: Sweep::Plane(1),
        lamp: true,
        goal: Pose::from_deg(-12.3, 70.0),
        measured: Pose::from_deg(-12.35, 70.02),
        counts: Counts {
            rgb: [1, 2, 1_048_575],
            monitor: 500,
            exposure: Exposure {
                integration_us: 100,
                gain: Gain::X16,
            },
            saturated: true,
            sequence: 7,
            ticks: 12,
            temperature_c: 25,
        },
        device_ticks: 12,
        retries: 0,
        flags: vec![Flag::Saturated],
        swept_rad: None,
        spread_rad: None,
    })
}

fn records() -> Vec<Record> {
    let identity = Identity {
        id: 1,
        model: "XM430-W350".to_owned(),
        firmware: 45,
    };
    let at = "2026-11-22T04:00:01Z".to_owned();
    vec![
        Record::Begin {
            identities: vec![identity],
            device_ticks: 5,
            at: at.clone(),
        },
        reading(0),
        reading(1),
        Record::End {
            outcome: Outcome::Failed {
                fault: "light servo: no reply".to_owned(),
            },
            device_ticks: None,
            at,
        },
    ]
}

fn append(journal: &mut FileJournal, record: &Record) {
    let runtime = tokio::runtime::Builder::new_current_thread().build();
    let runtime = runtime.expect("the system has threads");
    runtime
        .block_on(journal.append(record))
        .expect("room on the disk");
}

fn write(path: &Path) -> Vec<Record> {
    let mut journal = FileJournal::create(path, header()).expect("a new file");
    for record in records() {
        append(&mut journal, &record);
    }
    journal.records().to_vec()
}

#[test]
fn what_was_appended_is_read_back() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("journal");
    let written = write(&path);
    assert_eq!(written.len(), 5);
    assert_eq!(FileJournal::read(&path).unwrap(), written);
    assert_eq!(FileJournal::open(&path).unwrap().records(), written);
}

#[test]
fn an_existing_file_is_never_touched() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("journal");
    std::fs::write(&path, "something else").unwrap();
    let error = FileJournal::create(&path, header()).unwrap_err();
    assert!(
        matches!(error, JournalError::Io { what: "create", .. }),
        "{error}"
    );
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "something else");
}

#[test]
fn a_second_writer_is_kept_out_and_a_reader_is_not() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("journal");
    let journal = FileJournal::create(&path, header()).unwrap();
    assert!(matches!(
        FileJournal::open(&path),
        Err(JournalError::Locked { .. })
    ));
    assert_eq!(FileJournal::read(&path).unwrap().len(), 1);
    drop(journal);
    assert!(FileJournal::open(&path).is_ok());
}

fn start_of_last_line(text: &[u8]) -> usize {
    let before = &text[..text.len() - 1];
    let end_of_the_one_before = before.iter().rposition(|&byte| byte == b'\n');
    end_of_the_one_before.expect("a journal has more than one line") + 1
}

#[test]
fn a_tail_torn_at_any_byte_costs_the_last_record_alone() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("journal");
    let written = write(&path);
    let whole = std::fs::read(&path).unwrap();
    let last = start_of_last_line(&whole);
    for end in last..whole.len() {
        std::fs::write(&path, &whole[..end]).unwrap();
        assert_eq!(
            FileJournal::read(&path).unwrap(),
            written[..4],
            "read, cut at byte {end}"
        );
        let mut journal = FileJournal::open(&path).unwrap();
        assert_eq!(journal.records(), &written[..4], "opened, cut at byte {end}");
        append(&mut journal, &written[4]);
        drop(journal);
        assert_eq!(std::fs::read(&path).unwrap(), whole, "mended, cut at byte {end}");
    }
}

#[test]
fn any_damaged_byte_of_the_last_line_is_noticed() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("journal");
    let written = write(&path);
    let whole = std::fs::read(&path).unwrap();
    let last = start_of_last_line(&whole);
    for at in last..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x15;
        std::fs::write(&path, &damaged).unwrap();
        assert_eq!(FileJournal::read(&path).unwrap(), written[..4], "byte {at}");
    }
}

#[test]
fn damage_before_the_end_is_an_error_that_names_the_line() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("journal");
    write(&path);
    let whole = std::fs::read(&path).unwrap();
    let mut damaged = whole.clone();
    let second_line = whole.iter().position(|&byte| byte == b'\n').unwrap() + 1;
    damaged[second_line + 20] ^= 1;
    std::fs::write(&path, &damaged).unwrap();
    let error = FileJournal::open(&path).unwrap_err();
    assert!(matches!(error, JournalError::Damaged { line: 2, .. }), "{error}");
    assert_eq!(
        std::fs::read(&path).unwrap(),
        damaged,
        "a damaged journal is left as it is"
    );
}

#[test]
fn what_is_no_journal_is_refused() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("journal");
    for text in ["", "hello\n", "00000000 {}\n", "deadbeef"] {
        std::fs::write(&path, text).unwrap();
        let error = FileJournal::open(&path).unwrap_err();
        assert!(
            matches!(error, JournalError::Damaged { line: 1, .. }),
            "{text:?}: {error}"
        );
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }
}

#[test]
fn a_missing_directory_is_an_error_with_its_path() {
    let error = FileJournal::create("/nonexistent/journal", header()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "cannot create the journal /nonexistent/journal"
    );
}

#[test]
fn garbage_after_the_last_line_is_cut() {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("journal");
    let written = write(&path);
    let mut file = OpenOptions::new().append(true).open(&path).unwrap();
    file.write_all(&[0; 100]).unwrap();
    assert_eq!(FileJournal::open(&path).unwrap().records(), written);
}
