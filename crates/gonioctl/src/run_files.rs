use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::Context;
use api::{Client, ClientError, RunView};
use capture::{FileJournal, Record};
use report::RunDirectory;

use crate::cli::DaemonArguments;
use crate::run::RUNS;

/// What the address of a daemon begins with.
const SCHEMES: [&str; 3] = ["http://", "https://", "unix:"];
/// What stands before the id of a run in an address of the API, and of the page.
const BEFORE_ID: [&str; 2] = ["/runs/", "/#run/"];
/// What the address of the API adds to that of the daemon.
const API: &str = "/api/v1";

/// The files of a run, in a directory here or at a daemon.
pub(crate) enum RunFiles {
    /// In a directory.
    Here(RunDirectory),
    /// At a daemon, under the id of the run.
    There { daemon: Client, id: String },
}

impl RunFiles {
    /// The run of a directory, of an id, or of an address: that of a daemon, whose newest run with a result it is then, or
    /// that of a run at a daemon. A run of an id is looked for in ./runs first, unless a daemon is named, then at the daemon.
    ///
    /// # Errors
    /// There is no such directory or run; the daemon does not answer, or refuses.
    pub(crate) fn find(run: &str, daemon: &DaemonArguments) -> anyhow::Result<Self> {
        if SCHEMES.iter().any(|scheme| run.starts_with(scheme)) {
            return Self::at_address(run, daemon);
        }
        if Path::new(run).exists() {
            return Ok(Self::Here(RunDirectory::at(run)));
        }
        anyhow::ensure!(
            is_id(run),
            "there is no run directory {run}, and it is neither the id of a run nor the address of a daemon"
        );
        if daemon.daemon.is_none()
            && let Some(directory) = directory_of(run)
        {
            return Ok(Self::Here(directory));
        }
        let client = daemon.client()?;
        let id = client
            .run(run)
            .with_context(|| {
                format!("no run directory in {RUNS} has the id {run}, and the daemon does not know it")
            })?
            .id;
        Ok(Self::There { daemon: client, id })
    }

    fn at_address(address: &str, daemon: &DaemonArguments) -> anyhow::Result<Self> {
        let split = BEFORE_ID.iter().find_map(|before| address.rsplit_once(before));
        let (base, id) = match split {
            Some((base, rest)) => (base, rest.split('/').next()),
            None => (address, None),
        };
        let base = base.trim_end_matches('/');
        let client = daemon.at(base.strip_suffix(API).unwrap_or(base)).client()?;
        let id = match id {
            Some(id) => client.run(id)?.id,
            None => {
                let runs = client.runs()?;
                let newest = runs.into_iter().find(has_result);
                let run = newest.context("the daemon has no run with a result")?;
                terminal::say(format_args!(
                    "the daemon's newest run with a result is {} of {}",
                    run.id, run.started
                ));
                run.id
            }
        };
        Ok(Self::There { daemon: client, id })
    }

    /// Opens a file of the run; `None` where there is none of that name.
    ///
    /// # Errors
    /// The file cannot be opened; the daemon does not answer, or refuses.
    pub(crate) fn open(&self, name: &str) -> anyhow::Result<Option<Box<dyn Read>>> {
        match self {
            Self::Here(directory) => {
                let path = directory.file(name);
                match File::open(&path) {
                    Ok(file) => Ok(Some(Box::new(file))),
                    Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
                    Err(error) => Err(error).with_context(|| format!("cannot open {}", path.display())),
                }
            }
            Self::There { daemon, id } => match daemon.download(&format!("/runs/{id}/files/{name}")) {
                Ok(file) => Ok(Some(Box::new(file))),
                Err(ClientError::Refused(refused)) if refused.not_found() => Ok(None),
                Err(error) => Err(error.into()),
            },
        }
    }

    /// Reads the journal of the run.
    ///
    /// # Errors
    /// There is none, or it is damaged; as [`Self::open`].
    pub(crate) fn records(&self) -> anyhow::Result<Vec<Record>> {
        match self {
            Self::Here(directory) => Ok(FileJournal::read(directory.journal())?),
            Self::There { id, .. } => {
                let mut journal = self.open("journal")?.with_context(|| {
                    format!(
                        "the directory of run {id} has no journal yet; it is written when the run has ended"
                    )
                })?;
                let mut bytes = Vec::new();
                journal
                    .read_to_end(&mut bytes)
                    .context("cannot read the journal from the daemon")?;
                Ok(FileJournal::parse(&bytes, format!("journal of run {id}"))?)
            }
        }
    }
}

/// Whether every step was measured and the files were written.
fn has_result(run: &RunView) -> bool {
    run.reported.is_some() && run.accepted >= run.planned
}

/// Whether a word could be the id of a run: 26 digits and capital letters.
fn is_id(word: &str) -> bool {
    word.len() == 26 && word.bytes().all(|b| b.is_ascii_digit() || b.is_ascii_uppercase())
}

/// The directory in ./runs that is named for an id.
fn directory_of(id: &str) -> Option<RunDirectory> {
    let mut entries = std::fs::read_dir(RUNS).ok()?.flatten();
    let entry = entries.find(|entry| entry.file_name().to_string_lossy().ends_with(&format!("-{id}")))?;
    Some(RunDirectory::at(entry.path()))
}
