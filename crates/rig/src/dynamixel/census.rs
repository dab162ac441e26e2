use std::path::Path;

use super::line::{Cause, Line};
use super::model::Model;
use super::register::PHOTOMETER_MODEL;
use crate::{BusSettings, RigError};

/// A device that answered a ping to all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// Its id.
    pub id: u8,
    /// Its model number.
    pub model: u16,
    /// Its firmware version.
    pub firmware: u8,
}

impl Heard {
    /// Name of its model, where it is one that a rig may have.
    pub fn name(&self) -> Option<&'static str> {
        if self.model == PHOTOMETER_MODEL {
            return Some("photometer");
        }
        Model::numbered(self.model).map(|model| model.name)
    }
}

/// Who answers on a bus at one baud rate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Census {
    /// Who answered, by id.
    pub heard: Vec<Heard>,
    /// Answers that came damaged, as those of two devices with one id.
    pub damaged: usize,
}

impl Census {
    /// Opens and locks a port, pings all devices at a baud rate and releases the port again. Blocks for about a
    /// second, since any of 253 devices may answer in its turn.
    ///
    /// # Errors
    /// The port cannot be opened, or is gone.
    pub fn take(port: &Path, settings: &BusSettings, baud: u32) -> Result<Self, RigError> {
        let settings = BusSettings {
            baud,
            ..settings.clone()
        };
        let answers = Line::open(port, &settings)?.ping_all();
        let (answers, damaged) = answers.map_err(|cause| RigError::PortGone {
            source: match cause {
                Cause::Gone(source) => source,
                other => std::io::Error::other(format!("{other:?}")),
            },
        })?;
        let mut heard: Vec<_> = answers
            .into_iter()
            .map(|(id, reply)| Heard {
                id,
                model: u16::from_le_bytes([reply[0], reply[1]]),
                firmware: reply[2],
            })
            .collect();
        heard.sort_by_key(|device| device.id);
        Ok(Self { heard, damaged })
    }
}
