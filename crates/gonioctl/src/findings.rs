use std::process::ExitCode;

use rig::doctor::{Bin, Finding, Verdict};
use serde_json::json;
use session::Status;

use crate::document;
use crate::exit;
use crate::junit::{Case, Junit, Outcome};

/// Widest bar of the histogram, characters.
const BAR: usize = 40;

/// What checks of a rig found, shown as it comes, or for machines at the end.
pub(crate) struct Findings {
    all: Vec<Finding>,
    as_json: bool,
}

impl Findings {
    pub(crate) fn new(as_json: bool) -> Self {
        Self {
            all: Vec::new(),
            as_json,
        }
    }

    /// Takes a finding and shows it.
    pub(crate) fn tell(&mut self, finding: Finding) {
        if !self.as_json {
            // Nobody reads where stdout is gone; the exit code still says how it ended.
            let _ = show(&finding);
        }
        self.all.push(finding);
    }

    /// The exit code of all: 3 where something fails.
    ///
    /// # Errors
    /// Stdout refuses, or the file for CI servers cannot be written.
    pub(crate) fn end(self, rig: &std::path::Path, junit: Option<&Junit>) -> anyhow::Result<ExitCode> {
        if let Some(junit) = junit {
            junit.write(&self.all.iter().map(case).collect::<Vec<_>>())?;
        }
        let worst = self.all.iter().map(|finding| finding.verdict).max();
        if self.as_json {
            document::FINDINGS.print(&json!({ "rig": rig, "verdict": worst, "findings": self.all }))?;
        }
        Ok(match worst {
            Some(Verdict::Fail) => exit::code(Status::Rig),
            _ => ExitCode::SUCCESS,
        })
    }
}

/// A finding as a test: a warning passes, with what it says.
fn case(finding: &Finding) -> Case {
    let remedy = finding.remedy.as_ref().map(|remedy| format!(" -> {remedy}"));
    let said = format!(
        "{}: {}{}",
        finding.verdict,
        finding.text,
        remedy.unwrap_or_default()
    );
    match finding.verdict {
        Verdict::Fail => Case::new(finding.check, Outcome::Failed(said)),
        _ => Case::new(finding.check, Outcome::Passed).saying(said),
    }
}

fn show(finding: &Finding) -> std::io::Result<()> {
    terminal::line(format_args!(
        "{:<4}  {:<15}{}",
        finding.verdict, finding.check, finding.text
    ))?;
    if let Some(remedy) = &finding.remedy {
        terminal::line(format_args!("{:<21}-> {remedy}", ""))?;
    }
    for line in bars(&finding.histogram) {
        terminal::line(format_args!("{:<21}{line}", ""))?;
    }
    Ok(())
}

/// The bins that hold something, and those between them, as bars.
fn bars(histogram: &[Bin]) -> Vec<String> {
    let filled = |bin: &Bin| bin.count > 0;
    let (Some(first), Some(last)) = (
        histogram.iter().position(filled),
        histogram.iter().rposition(filled),
    ) else {
        return Vec::new();
    };
    let most = histogram.iter().map(|bin| bin.count).max().unwrap_or(1);
    let line = |bin: &Bin| {
        let end = bin
            .below_ms
            .map_or_else(|| "more".to_owned(), |ms| format!("< {ms}"));
        let bar = "#".repeat((bin.count * BAR).div_ceil(most));
        format!("{end:>7} ms {:>4} {bar}", bin.count)
            .trim_end()
            .to_owned()
    };
    histogram[first..=last].iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_leave_out_what_is_empty_at_the_ends() {
        let bin = |below_ms, count| Bin { below_ms, count };
        let lines = bars(&[
            bin(Some(0.5), 0),
            bin(Some(1.0), 40),
            bin(Some(2.0), 0),
            bin(None, 1),
        ]);
        assert_eq!(
            lines,
            [
                format!("    < 1 ms   40 {}", "#".repeat(40)),
                "    < 2 ms    0".to_owned(),
                "   more ms    1 #".to_owned()
            ]
        );
        assert!(bars(&[bin(None, 0)]).is_empty());
    }
}
