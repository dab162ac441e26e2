use std::path::PathBuf;

use report::RunDirectory;

use crate::print;

/// Makes everything in a run directory again: from the daemon's store where that knows the run, else from the
/// directory's own journal.
///
/// # Errors
/// No journal there, or a damaged one; a file that cannot be written.
pub(crate) fn reconstruct(run: PathBuf, as_json: bool) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()?;
    let report = match runtime.block_on(goniod::rebuild(&run))? {
        Some(report) => report,
        None => report::reconstruct(&RunDirectory::at(run))?,
    };
    if as_json {
        print::json(&report)?;
        return Ok(());
    }
    for check in &report.checks {
        print::line(format_args!("{}: {}", check.name, check.text))?;
    }
    Ok(())
}
