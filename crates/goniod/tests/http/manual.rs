//! The daemon's manual page, which `gonioctl man` writes beside its own.

use std::path::Path;

/// Set to write the committed page anew.
const WRITE: &str = "GONIOD_WRITE_MANUAL";

#[test]
fn the_committed_manual_page_is_that_of_the_command_line() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("goniod.1");
    let mut page = Vec::new();
    clap_mangen::Man::new(goniod::command())
        .render(&mut page)
        .unwrap();
    let page = String::from_utf8(page).unwrap();
    if std::env::var_os(WRITE).is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        page == committed,
        "crates/goniod/goniod.1 is not what the command line says; run\n\n    \
         {WRITE}=1 cargo test -p goniod --test http manual\n\nand commit the file."
    );
}
