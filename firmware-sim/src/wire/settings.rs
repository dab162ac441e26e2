use std::collections::BTreeMap;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::time::Duration;

use rig::RigFile;
use serde::Deserialize;

use super::WireFaults;
use crate::{Settings, SimError};

/// `[sim.wire]`: the wire itself. The keys stand in config/rig.toml.
#[derive(Clone, Debug, PartialEq)]
pub struct WireSettings {
    /// In wire time, how long the host waits for an answer that does not come.
    pub deadline: Duration,
    /// What goes wrong.
    pub faults: WireFaults,
    /// Seed of what goes wrong.
    pub seed: u64,
}

impl WireSettings {
    /// Checks the table `wire` of a rig file's `[sim]`.
    ///
    /// # Errors
    /// An unknown key, a wrong type, a value out of its range.
    pub fn new(rig: &RigFile) -> Result<Self, SimError> {
        let form = |why: String| SimError::Form {
            why: format!("wire: {why}"),
        };
        let raw: RawWire = match rig.sim.get("wire") {
            None => RawWire::default(),
            Some(toml::Value::Table(table)) => crate::settings::read(table).map_err(form)?,
            Some(other) => {
                return Err(form(format!(
                    "{} stands there, a table is wanted",
                    other.type_str()
                )));
            }
        };
        Ok(Self {
            deadline: ms("wire.deadline_ms", raw.deadline_ms, 0.1)?,
            faults: raw.faults()?,
            seed: Settings::new(rig)?.seed,
        })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawWire {
    deadline_ms: f64,
    corrupt_byte: f64,
    drop_reply: f64,
    duplicate_reply: f64,
    truncate_reply: f64,
    behead_reply: f64,
    split_reply: f64,
    noise: f64,
    wrong_length: f64,
    wrong_id: f64,
    late_reply: f64,
    late_ms: f64,
    corrupt_request: f64,
    drop_request: f64,
    busy: f64,
    echo: bool,
    silent: Vec<RawSilence>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSilence {
    id: u8,
    from_s: f64,
}

impl Default for RawWire {
    fn default() -> Self {
        Self {
            deadline_ms: 12.0,
            corrupt_byte: 0.0,
            drop_reply: 0.0,
            duplicate_reply: 0.0,
            truncate_reply: 0.0,
            behead_reply: 0.0,
            split_reply: 0.0,
            noise: 0.0,
            wrong_length: 0.0,
            wrong_id: 0.0,
            late_reply: 0.0,
            late_ms: 50.0,
            corrupt_request: 0.0,
            drop_request: 0.0,
            busy: 0.0,
            echo: false,
            silent: Vec::new(),
        }
    }
}

impl RawWire {
    fn faults(&self) -> Result<WireFaults, SimError> {
        let rate = |key, value| within(key, value, 0.0..=1.0);
        let silent = self.silent.iter().map(|RawSilence { id, from_s }| {
            within("wire.silent.id", *id, 0..=252)?;
            within("wire.silent.from_s", *from_s, 0.0..=1e6)?;
            Ok((*id, Duration::from_secs_f64(*from_s)))
        });
        Ok(WireFaults {
            corrupt_byte: rate("wire.corrupt_byte", self.corrupt_byte)?,
            drop_reply: rate("wire.drop_reply", self.drop_reply)?,
            duplicate_reply: rate("wire.duplicate_reply", self.duplicate_reply)?,
            truncate_reply: rate("wire.truncate_reply", self.truncate_reply)?,
            behead_reply: rate("wire.behead_reply", self.behead_reply)?,
            split_reply: rate("wire.split_reply", self.split_reply)?,
            corrupt_request: rate("wire.corrupt_request", self.corrupt_request)?,
            drop_request: rate("wire.drop_request", self.drop_request)?,
            busy: rate("wire.busy", self.busy)?,
            noise: rate("wire.noise", self.noise)?,
            wrong_length: rate("wire.wrong_length", self.wrong_length)?,
            wrong_id: rate("wire.wrong_id", self.wrong_id)?,
            late_reply: rate("wire.late_reply", self.late_reply)?,
            late_by: ms("wire.late_ms", self.late_ms, 0.0)?,
            echo: self.echo,
            silent: silent.collect::<Result<BTreeMap<_, _>, _>>()?,
        })
    }
}

fn ms(key: &'static str, found: f64, min: f64) -> Result<Duration, SimError> {
    within(key, found, min..=10_000.0).map(|ms| Duration::from_secs_f64(ms / 1e3))
}

/// A value within a range; NaN is in none.
fn within<T: PartialOrd + Display>(
    key: &'static str,
    found: T,
    range: RangeInclusive<T>,
) -> Result<T, SimError> {
    if range.contains(&found) {
        return Ok(found);
    }
    Err(SimError::Value {
        key,
        found: found.to_string(),
        allowed: format!("{} … {}", range.start(), range.end()),
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn parse(wire: &str) -> Result<WireSettings, SimError> {
        let text = format!("[sim.wire]\n{wire}");
        WireSettings::new(&RigFile::parse(&text, Path::new("test.toml")).unwrap())
    }

    #[test]
    fn the_shipped_file_is_a_perfect_wire() {
        let settings = WireSettings::new(&RigFile::default()).unwrap();
        let raw = RawWire::default();
        assert_eq!(settings.faults, raw.faults().unwrap());
        assert_eq!(settings.deadline, Duration::from_secs_f64(raw.deadline_ms / 1e3));
        let perfect = WireFaults {
            late_by: settings.faults.late_by,
            ..WireFaults::default()
        };
        assert_eq!(settings.faults, perfect);
    }

    #[test]
    fn every_fault_has_a_key() {
        let faults = parse(
            "corrupt_byte = 0.002\ndrop_reply = 0.005\nduplicate_reply = 0.1\ntruncate_reply = 0.2\n\
             noise = 0.3\nwrong_length = 0.4\nwrong_id = 0.5\nlate_reply = 0.6\nlate_ms = 70\necho = true\n\
             behead_reply = 0.7\nsplit_reply = 0.8\ncorrupt_request = 0.01\ndrop_request = 0.02\nbusy = 0.03\n\
             silent = [{ id = 2, from_s = 1.5 }]",
        )
        .unwrap()
        .faults;
        let wanted = WireFaults {
            corrupt_byte: 0.002,
            drop_reply: 0.005,
            duplicate_reply: 0.1,
            truncate_reply: 0.2,
            behead_reply: 0.7,
            split_reply: 0.8,
            corrupt_request: 0.01,
            drop_request: 0.02,
            busy: 0.03,
            noise: 0.3,
            wrong_length: 0.4,
            wrong_id: 0.5,
            late_reply: 0.6,
            late_by: Duration::from_millis(70),
            echo: true,
            silent: [(2, Duration::from_millis(1500))].into(),
        };
        assert_eq!(faults, wanted);
    }

    #[test]
    fn bad_values_name_their_key_and_range() {
        let cases = [
            ("drop_reply = 1.5", "sim.wire.drop_reply is 1.5, allowed: 0 … 1"),
            (
                "corrupt_byte = nan",
                "sim.wire.corrupt_byte is NaN, allowed: 0 … 1",
            ),
            ("late_ms = -1", "sim.wire.late_ms is -1, allowed: 0 … 10000"),
            (
                "silent = [{ id = 253, from_s = 0 }]",
                "sim.wire.silent.id is 253, allowed: 0 … 252",
            ),
        ];
        for (wire, text) in cases {
            assert_eq!(parse(wire).unwrap_err().to_string(), text, "{wire}");
        }
        let unknown = parse("drop = 0.1").unwrap_err().to_string();
        assert!(unknown.contains("drop"), "{unknown}");
    }
}
