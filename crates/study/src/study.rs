use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::check::Check;
use crate::{Error, Evaluation, Grid, Material, Shard, grid, paper, write};

/// Told how much of the work is done, and of how much; from any thread.
pub type Progress<'a> = dyn Fn(u64, u64) + Sync + 'a;

/// The study that is run unless a file says otherwise.
const BUILT_IN: &str = include_str!("../../../config/studies/error-against-time.toml");

/// How the copy of a quick study's file begins.
const QUICK: &str = "# quick\n";
/// Materials that a quick study measures at most.
const QUICK_MATERIALS: usize = 8;

/// What a study file asks for: its key `study`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A [`Grid`].
    ErrorAgainstTime,
    /// An [`Evaluation`].
    Paper,
}

/// A checked study with the text that it was made of.
#[derive(Clone)]
pub struct Study {
    what: What,
    text: String,
}

#[derive(Clone)]
enum What {
    Grid(Grid),
    Evaluation(Evaluation),
}

#[derive(Deserialize)]
struct Head {
    study: Kind,
}

impl Study {
    /// Reads a study file, or takes the built-in one: error against run time. A `quick` one is a small part of it.
    ///
    /// # Errors
    /// The file cannot be read, or as for [`Study::parse`].
    pub fn read(path: Option<&Path>, quick: bool) -> Result<Self, Error> {
        match path {
            Some(path) => Self::parse(&read(path)?, &path.display().to_string(), quick),
            None => Self::parse(BUILT_IN, "the built-in study", quick),
        }
    }

    /// Checks the text of a study file; `file` names it in errors.
    ///
    /// # Errors
    /// An unknown or missing key, a wrong type, a value out of range, or a material that is not known.
    pub fn parse(text: &str, file: &str, quick: bool) -> Result<Self, Error> {
        let head: Head = Check { file }.parse(text)?;
        let what = match head.study {
            Kind::ErrorAgainstTime => What::Grid(Grid::parse(text, file, quick)?),
            Kind::Paper => What::Evaluation(Evaluation::parse(text, file, quick)?),
        };
        let quick = if quick { QUICK } else { "" };
        Ok(Self {
            what,
            text: format!("{quick}{text}"),
        })
    }

    /// The same study over the materials of files and folders instead of those that its file names, every n-th of them, and
    /// of a quick one no more than eight.
    ///
    /// # Errors
    /// A file or folder that cannot be read ([`Material::read_all`]), no material at all, `every` of 0, or a study of
    /// another kind than error against run time.
    pub fn on(mut self, paths: &[PathBuf], every: usize) -> Result<Self, Error> {
        let file = "the command line";
        let range = |key, value: String, allowed| Error::Range {
            file: file.to_owned(),
            key,
            value,
            allowed,
        };
        let What::Grid(grid) = &mut self.what else {
            return Err(range(
                "--on",
                "given".to_owned(),
                "a study of error against run time",
            ));
        };
        let mut known = Vec::new();
        for path in paths {
            known.extend(Material::read_all(path)?);
        }
        if known.is_empty() {
            return Err(range(
                "--on",
                "empty".to_owned(),
                "at least one file of a material",
            ));
        }
        if every == 0 {
            return Err(range("--every", "0".to_owned(), "1 …"));
        }
        let every = match self.text.starts_with(QUICK) {
            true => every.max(known.len().div_ceil(QUICK_MATERIALS)),
            false => every,
        };
        grid.materials = known.iter().step_by(every).cloned().collect();
        grid.known = known;
        let paths: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
        self.text = format!("{}# on every {every} of {}\n", self.text, paths.join(", "));
        Ok(self)
    }

    /// Runs it into a directory, which is made where it is missing, and says what it found. A study that was
    /// interrupted goes on, and what shards have done is not done again.
    ///
    /// # Errors
    /// The directory holds another study or cannot be written; somebody else runs the study there; a material cannot be
    /// measured or reconstructed.
    pub fn run(&self, directory: &Path, progress: &Progress<'_>) -> Result<String, Error> {
        self.claim(directory)?;
        match &self.what {
            What::Grid(study) => grid::run(study, directory, progress),
            What::Evaluation(study) => paper::run(study, directory, progress),
        }
    }

    /// Does one of several parts of it into a directory that all of them share, and says what it did. A part that was
    /// interrupted goes on; one that is done again has nothing left to do.
    ///
    /// # Errors
    /// As for [`Study::run`], and a study of another kind than error against run time.
    pub fn run_shard(
        &self,
        directory: &Path,
        shard: Shard,
        progress: &Progress<'_>,
    ) -> Result<String, Error> {
        let grid = self.grid("--shard")?;
        self.claim(directory)?;
        grid::run_shard(grid, directory, shard, progress)
    }

    /// Makes the study of what its parts did, byte for byte what [`Study::run`] makes, and says what it found.
    ///
    /// # Errors
    /// Something of it is not done; the directory holds another study or cannot be written; a study of another kind than
    /// error against run time.
    pub fn merge(&self, directory: &Path) -> Result<String, Error> {
        let grid = self.grid("merge")?;
        self.claim(directory)?;
        grid::merge(grid, directory)
    }

    fn grid(&self, key: &'static str) -> Result<&Grid, Error> {
        match &self.what {
            What::Grid(grid) => Ok(grid),
            What::Evaluation(_) => Err(Error::Range {
                file: "the command line".to_owned(),
                key,
                value: "given".to_owned(),
                allowed: "a study of error against run time",
            }),
        }
    }

    /// Makes a directory one of this study, or sees that it is.
    fn claim(&self, directory: &Path) -> Result<(), Error> {
        let io = |what, path: &Path| {
            let path = path.to_owned();
            move |source| Error::Io { what, path, source }
        };
        fs::create_dir_all(directory).map_err(io("make the directory", directory))?;
        let copy = directory.join("study.toml");
        // Of shards that begin together, one writes it.
        write::new_file(directory, "study.toml", self.text.as_bytes())?;
        match fs::read_to_string(&copy).map_err(io("read", &copy))? {
            text if text == self.text => Ok(()),
            _ => Err(Error::OtherStudy {
                directory: directory.to_owned(),
            }),
        }
    }
}

/// The text of a study file.
pub(crate) fn read(path: &Path) -> Result<String, Error> {
    config::read_text(path).map_err(|source| Error::Io {
        what: "read",
        path: path.to_owned(),
        source,
    })
}
