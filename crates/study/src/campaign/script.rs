use std::path::Path;
use std::time::Duration;

use firmware_sim::{Fault, Mishap};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{Carried, Wrong, carry};
use crate::Error;
use crate::check::Check;

/// Seconds of rig time within which faults set in; a capture without any takes fewer.
const WITHIN_S: f64 = 6.0;
/// Most faults of one capture.
const MOST: usize = 5;
/// What goes wrong on the wire, and its highest rate. Bytes are hurt one or two in a packet: of packets with more wrong
/// bytes, one in 65,536 passes the CRC, and no host can tell.
const WIRE: [(&str, f64); 16] = [
    ("corrupt_byte", 0.05),
    ("drop_reply", 1.0),
    ("duplicate_reply", 1.0),
    ("truncate_reply", 1.0),
    ("behead_reply", 1.0),
    ("split_reply", 1.0),
    ("noise", 1.0),
    ("wrong_length", 1.0),
    ("wrong_id", 1.0),
    ("late_reply", 1.0),
    ("corrupt_request", 0.05),
    ("drop_request", 1.0),
    ("busy", 1.0),
    ("echo", 1.0),
    ("silent", 1.0),
    ("unplug", 1.0),
];

/// What happens to one capture: enough to do it again. Printed and read as TOML.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// Seed of the rig.
    pub seed: u64,
    /// Faults of the devices, earliest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fault: Vec<Fault>,
    /// Whether it goes over a pseudo-terminal, in wire time, or stays in this process.
    #[serde(default)]
    pub over_wire: bool,
    /// Faults of the wire.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub wire: Vec<WireFault>,
}

/// What goes wrong on the wire for a while.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WireFault {
    /// From when on, seconds of rig time since power-on.
    pub at_s: f64,
    /// For how long, seconds of rig time.
    pub for_s: f64,
    /// The adapter is unplugged; it comes back under another name when the run is resumed.
    #[serde(default)]
    pub unplugs: bool,
    /// Keys of the table `[sim.wire]`.
    #[serde(default)]
    pub faults: toml::Table,
}

impl WireFault {
    pub(super) fn at(&self) -> Duration {
        Duration::try_from_secs_f64(self.at_s).unwrap_or_default()
    }

    pub(super) fn end(&self) -> Duration {
        self.at() + Duration::try_from_secs_f64(self.for_s).unwrap_or_default()
    }
}

impl std::fmt::Display for Script {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&toml::to_string(self).map_err(|_| std::fmt::Error)?)
    }
}

impl Script {
    /// One to five faults of the devices, in this process.
    pub fn random(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut fault: Vec<Fault> = (0..random.random_range(1..=MOST))
            .map(|_| device_fault(&mut random))
            .collect();
        fault.sort_by_key(|fault| fault.at);
        Self {
            seed,
            fault,
            over_wire: false,
            wire: Vec::new(),
        }
    }

    /// One to five faults over a pseudo-terminal: of the wire, and one in five of a device.
    pub fn random_over_wire(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut script = Self {
            seed,
            fault: Vec::new(),
            over_wire: true,
            wire: Vec::new(),
        };
        for _ in 0..random.random_range(1..=MOST) {
            match random.random_bool(0.2) {
                true => script.fault.push(device_fault(&mut random)),
                false => script.wire.push(wire_fault(&mut random)),
            }
        }
        script.fault.sort_by_key(|fault| fault.at);
        script.wire.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        script
    }

    /// Reads a script file.
    ///
    /// # Errors
    /// The file cannot be read, is no TOML, or has an unknown key or fault.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let file = path.display().to_string();
        Check { file: &file }.parse(&crate::read(path)?)
    }

    /// How many faults it has.
    pub fn len(&self) -> usize {
        self.fault.len() + self.wire.len()
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Carries its capture out, with all resumptions that it takes.
    ///
    /// # Errors
    /// What went wrong, in words.
    pub fn carry(&self) -> Result<Carried, String> {
        carry::carry(self)
    }

    /// The shortest script that still goes wrong: faults are left out one after the other, again and again.
    pub(super) fn shrink(&self, why: String) -> Wrong {
        let mut wrong = Wrong {
            script: self.clone(),
            why,
        };
        let mut i = 0;
        while i < wrong.script.len() {
            let script = wrong.script.without(i);
            match script.carry() {
                Err(why) => (wrong, i) = (Wrong { script, why }, 0),
                Ok(_) => i += 1,
            }
        }
        wrong
    }

    fn without(&self, i: usize) -> Self {
        let mut shorter = self.clone();
        match i.checked_sub(self.fault.len()) {
            None => drop(shorter.fault.remove(i)),
            Some(i) => drop(shorter.wire.remove(i)),
        }
        shorter
    }
}

fn device_fault(random: &mut ChaCha8Rng) -> Fault {
    let at = Duration::from_millis(random.random_range(0..(WITHIN_S * 1e3) as u64));
    Mishap::ALL[random.random_range(0..Mishap::ALL.len())].draw(at, random)
}

/// Rates are even on a logarithmic scale, and one in five is the highest: then nothing gets through unhurt.
fn wire_fault(random: &mut ChaCha8Rng) -> WireFault {
    let thousandths = |random: &mut ChaCha8Rng, most: u64| random.random_range(1..most) as f64 / 1e3;
    let mut fault = WireFault {
        at_s: thousandths(random, (WITHIN_S * 1e3) as u64),
        for_s: thousandths(random, 3000),
        ..WireFault::default()
    };
    let (key, most) = WIRE[random.random_range(0..WIRE.len())];
    let rate = match random.random_bool(0.2) {
        true => most,
        false => (most * f64::powf(0.01, random.random()) * 1e6).round() / 1e6,
    };
    let id = random.random_range(1..=3);
    match key {
        "unplug" => fault.unplugs = true,
        "echo" => drop(fault.faults.insert(key.to_owned(), true.into())),
        "silent" => {
            let silence: toml::Table = [
                ("id".to_owned(), toml::Value::from(id)),
                ("from_s".to_owned(), 0.0.into()),
            ]
            .into_iter()
            .collect();
            fault
                .faults
                .insert(key.to_owned(), vec![toml::Value::from(silence)].into());
        }
        _ => {
            let late_ms = random.random_range(1..80);
            fault.faults.insert(key.to_owned(), rate.into());
            fault.faults.insert("late_ms".to_owned(), late_ms.into());
        }
    }
    fault
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_printed_script_reads_back_as_it_was() {
        for seed in 0..200 {
            for script in [Script::random(seed), Script::random_over_wire(seed)] {
                let text = script.to_string();
                let read: Script = Check { file: "script" }.parse(&text).unwrap();
                assert_eq!(read, script, "{text}");
            }
        }
    }
}
