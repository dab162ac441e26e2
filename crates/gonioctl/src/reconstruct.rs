use std::path::PathBuf;

use report::RunDirectory;

use crate::print;

/// Makes everything in a run directory again from its journal.
///
/// # Errors
/// No journal there, or a damaged one; a file that cannot be written.
pub(crate) fn reconstruct(run: PathBuf, as_json: bool) -> anyhow::Result<()> {
    let report = report::reconstruct(&RunDirectory::at(run))?;
    if as_json {
        print::json(&report)?;
        return Ok(());
    }
    for check in &report.checks {
        print::line(format_args!("{}: {}", check.name, check.text))?;
    }
    Ok(())
}
