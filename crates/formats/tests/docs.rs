//! docs/formats.md says what the code does.

use std::path::PathBuf;

use formats::FORMATS;

const BEGIN: &str = "<!-- made of formats::FORMATS by crates/formats/tests/docs.rs -->\n";
const END: &str = "<!-- end -->\n";

/// One row a format.
fn table() -> String {
    let mut table = String::from(
        "| `--format` | file | what it keeps and loses | written only where |\n|---|---|---|---|\n",
    );
    for format in &FORMATS {
        let limits = [
            ("MALE", format.tolerance.male, 1.0, ""),
            ("median", format.tolerance.median, 100.0, " %"),
            ("p95", format.tolerance.p95, 100.0, " %"),
            ("albedo", format.tolerance.albedo, 100.0, " %"),
            ("peak", format.tolerance.peak, 100.0, " %"),
        ];
        let limits: Vec<String> = limits
            .iter()
            .filter(|(_, limit, ..)| limit.is_finite())
            .map(|(name, limit, scale, unit)| format!("{name} ≤ {}{unit}", limit * scale))
            .collect();
        let limits = if limits.is_empty() {
            "always, its figures told".to_owned()
        } else {
            limits.join(", ")
        };
        table += &format!(
            "| `{}` | .{} | {} | {limits} |\n",
            format.name, format.extension, format.about
        );
    }
    table
}

#[test]
fn the_table_of_formats_is_that_of_the_code() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../docs/formats.md");
    let text = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = text
        .split_once(BEGIN)
        .expect("the page has a place for the table");
    let (found, after) = rest.split_once(END).expect("the table ends");
    if std::env::var_os("GONIOD_WRITE_FORMATS").is_some() {
        std::fs::write(&path, format!("{before}{BEGIN}{}{END}{after}", table())).unwrap();
    } else {
        assert_eq!(
            found,
            table(),
            "GONIOD_WRITE_FORMATS=1 cargo test -p formats --test docs writes it"
        );
    }
}

#[test]
fn formats_have_names_of_their_own() {
    let mut names: Vec<&str> = FORMATS.iter().map(|format| format.name).collect();
    names.sort_unstable();
    assert!(names.is_sorted_by(|a, b| a < b), "{names:?}");
}
