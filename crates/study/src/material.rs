use std::path::Path;
use std::sync::Arc;

use brdf::{Brdf, Fitted};
use formats::ScatteredReading;
use serde::Deserialize;

use crate::Error;

/// A BRDF with its name.
#[derive(Clone)]
pub struct Material {
    /// As the study file or its own file names it.
    pub name: String,
    /// Materials of a kind, of which studies hold all out together: crates/study/families.csv lists them; of one that it does
    /// not list, the name of the folder, or its own name.
    pub family: String,
    /// What lies on the simulated stage: the BRDF itself, or what scattered readings say of it in the plane.
    pub brdf: Arc<dyn Brdf>,
    /// Where scattered readings are all that is known of it, those; everything is judged at them.
    pub known: Option<Arc<[ScatteredReading]>>,
}

impl Material {
    /// A material that is known everywhere.
    pub fn new(name: impl Into<String>, brdf: Arc<dyn Brdf>) -> Self {
        let name = name.into();
        Self {
            family: crate::family::family(&name).unwrap_or(&name).to_owned(),
            name,
            brdf,
            known: None,
        }
    }

    /// The materials of a file or of a folder's files, in the order of their names: BRDF files of any format that can be
    /// read, and CSV files of scattered readings ([`ScatteredReading::parse`]).
    ///
    /// # Errors
    /// A file or folder that cannot be read, a file of no format, or readings of which no specimen can be made.
    pub fn read_all(path: &Path) -> Result<Vec<Self>, Error> {
        crate::specimen_file::materials(path)
    }
}

/// Which materials a study file names.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum Names {
    One(String),
    Many(Vec<String>),
}

impl Names {
    /// The materials: all fitted ones for "all", else those named, each a specimen of the simulator, a file or a folder.
    ///
    /// # Errors
    /// None at all, or one that is not known.
    pub(crate) fn materials(self, file: &str) -> Result<Vec<Material>, Error> {
        let names = match self {
            Self::One(all) if all == "all" => Fitted::all().map(|(name, _)| name.to_owned()).collect(),
            Self::One(name) => vec![name],
            Self::Many(names) => names,
        };
        if names.is_empty() {
            return Err(Error::Range {
                file: file.to_owned(),
                key: "materials",
                value: "empty".to_owned(),
                allowed: "\"all\" or at least one name",
            });
        }
        let known = |name: String| match brdf::specimen(&name) {
            _ if Path::new(&name).is_dir() => Material::read_all(Path::new(&name)),
            Ok(brdf) => Ok(vec![Material::new(name, brdf)]),
            Err(_) if Path::new(&name).is_file() => Material::read_all(Path::new(&name)),
            Err(source) => Err(Error::Material {
                file: file.to_owned(),
                source,
            }),
        };
        let found: Vec<Vec<Material>> = names.into_iter().map(known).collect::<Result<_, _>>()?;
        Ok(found.into_iter().flatten().collect())
    }
}
