//! What the program writes for shells and for `man`.

// The exemption for tests does not reach what they share.
#![allow(clippy::unwrap_used)]

use std::fs;

use tests::run;

const GONIOCTL: &str = env!("CARGO_BIN_EXE_e2e-gonioctl");

#[test]
fn shells_learn_every_command() {
    let here = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = run(GONIOCTL, here.path(), &["completions", shell])
            .expect(0)
            .stdout;
        for command in ["doctor", "plan", "run", "reconstruct"] {
            assert!(script.contains(command), "{shell} does not learn {command}");
        }
    }
    let _ = run(GONIOCTL, here.path(), &["completions", "cmd"]).expect(2);
}

#[test]
fn every_command_has_a_manual_page() {
    let here = tempfile::tempdir().unwrap();
    let _ = run(GONIOCTL, here.path(), &["man", "share/man/man1"]).expect(0);
    let pages = here.path().join("share/man/man1");
    for page in [
        "gonioctl.1",
        "gonioctl-doctor.1",
        "gonioctl-run.1",
        "gonioctl-plan.1",
        "goniod.1",
    ] {
        let text = fs::read_to_string(pages.join(page)).unwrap();
        assert!(text.contains(".SH SYNOPSIS"), "{page}: {text}");
    }
    fs::write(here.path().join("file"), "").unwrap();
    let refused = run(GONIOCTL, here.path(), &["man", "file"]).expect(2);
    assert!(refused.stderr.contains("manual pages"), "{}", refused.stderr);
}
