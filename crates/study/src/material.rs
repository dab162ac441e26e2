use std::sync::Arc;

use brdf::{Brdf, Fitted};
use serde::Deserialize;

use crate::Error;

/// A BRDF with its name.
#[derive(Clone)]
pub struct Material {
    /// As the study file names it.
    pub name: String,
    /// The BRDF itself.
    pub brdf: Arc<dyn Brdf>,
}

/// Which materials a study file names.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum Names {
    One(String),
    Many(Vec<String>),
}

impl Names {
    /// The materials: all fitted ones for "all", else those named.
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
            Ok(brdf) => Ok(Material { name, brdf }),
            Err(source) => Err(Error::Material {
                file: file.to_owned(),
                source,
            }),
        };
        names.into_iter().map(known).collect()
    }
}
