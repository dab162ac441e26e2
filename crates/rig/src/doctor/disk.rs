use std::path::Path;

use rustix::fs::statvfs;

use super::Finding;
use super::suspend::held;
use crate::Band;

/// What a run takes, bytes: its MERL table alone has 35 MB.
const RUN: u64 = 60_000_000;

/// Room for so many runs is none that will last the week.
const RUNS: u64 = 100;

/// Bytes that are free below a directory, which may not exist yet.
///
/// # Errors
/// The system does not say.
pub fn room(directory: &Path) -> std::io::Result<u64> {
    let existing = directory.ancestors().find(|path| path.is_dir());
    let place = existing
        .filter(|path| !path.as_os_str().is_empty())
        .unwrap_or(Path::new("."));
    let system = statvfs(place)?;
    Ok(system.f_bavail * system.f_frsize)
}

/// How much room there is for run directories below a directory, which may not exist yet, and whether that would hold a
/// run by `suspend.disk_mb`, whose bounds in bytes are `hold`.
pub fn disk(directory: &Path, hold: Option<Band>) -> Finding {
    let free = match room(directory) {
        Ok(free) => free,
        Err(error) => {
            let text = format!("{}: {error}", directory.display());
            return Finding::fail("disk", text, "name a directory that can be read");
        }
    };
    let text = format!("{:.1} GB are free for {}", free as f64 / 1e9, directory.display());
    let remedy = |band: Band| {
        let needed_gb = band.release / 1e9;
        format!("make room until {needed_gb:.1} GB are free, or lower suspend.disk_mb")
    };
    let held = held(hold, free as f64, &text, remedy);
    held.unwrap_or_else(|| judged(directory, free))
}

fn judged(directory: &Path, free: u64) -> Finding {
    let text = format!(
        "{:.1} GB free for {}, room for {} runs",
        free as f64 / 1e9,
        directory.display(),
        free / RUN
    );
    match free / RUN {
        0 | 1 => Finding::fail("disk", text, "make room: a run could not be written to its end"),
        2..RUNS => Finding::warn("disk", text, "make room, or give another directory"),
        _ => Finding::ok("disk", text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn room_is_judged_by_what_a_run_takes() {
        let verdict = |bytes| judged(Path::new("runs"), bytes).verdict;
        assert_eq!(verdict(50_000_000), Verdict::Fail);
        assert_eq!(verdict(1_000_000_000), Verdict::Warn);
        assert_eq!(verdict(100_000_000_000), Verdict::Ok);
    }

    #[test]
    fn too_little_room_for_a_run_to_begin_fails() {
        let bounds = Band {
            hold: 1e18,
            release: 2e18,
        };
        let finding = disk(Path::new("."), Some(bounds));
        assert_eq!(finding.verdict, Verdict::Fail, "{finding:?}");
        assert!(finding.remedy.unwrap().contains("suspend.disk_mb"));
    }

    #[test]
    fn a_directory_that_is_still_to_be_made_lies_somewhere() {
        let place = tempfile::tempdir().unwrap();
        let finding = disk(&place.path().join("not/yet"), None);
        assert!(finding.text.contains("GB free for"), "{finding:?}");
        assert!(disk(Path::new("not/yet/here"), None).text.contains("GB free for"));
    }
}
