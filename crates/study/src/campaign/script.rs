use std::ops::Range;
use std::path::Path;
use std::time::Duration;

use firmware_sim::{Disturbance, Fault};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rig::Device;
use serde::{Deserialize, Serialize};

use super::{Carried, Wrong, carry};
use crate::Error;
use crate::check::Check;

/// Seconds of rig time within which faults set in; a capture without any takes fewer.
const WITHIN_S: f64 = 6.0;
/// Most faults of one capture.
const MOST: usize = 5;

/// What happens to one capture: enough to do it again. Printed and read as TOML.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Script {
    /// Seed of the rig.
    pub seed: u64,
    /// Faults of the devices, earliest first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fault: Vec<Fault>,
}

impl std::fmt::Display for Script {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&toml::to_string(self).map_err(|_| std::fmt::Error)?)
    }
}

impl Script {
    /// One to five faults of the devices.
    pub fn random(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let devices = [Device::Light, Device::Sensor, Device::Photometer];
        let mut fault: Vec<Fault> = (0..random.random_range(1..=MOST))
            .map(|_| Fault {
                device: devices[random.random_range(0..devices.len())],
                at: ms(&mut random, 0..(WITHIN_S * 1e3) as u64),
                what: disturbance(&mut random),
            })
            .collect();
        fault.sort_by_key(|fault| fault.at);
        Self { seed, fault }
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
        self.fault.len()
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
        shorter.fault.remove(i);
        shorter
    }
}

fn ms(random: &mut ChaCha8Rng, range: Range<u64>) -> Duration {
    Duration::from_millis(random.random_range(range))
}

fn disturbance(random: &mut ChaCha8Rng) -> Disturbance {
    match random.random_range(0..9) {
        0 => Disturbance::Silence(ms(random, 1..400)),
        1 => Disturbance::Silence(ms(random, 400..8000)),
        2 => Disturbance::OVERLOAD,
        3 => Disturbance::OVERHEATING,
        4 => Disturbance::ALERT,
        5 => Disturbance::Stall(ms(random, 10..6000)),
        6 => Disturbance::RefusedTrigger,
        7 => Disturbance::LostAcknowledgement,
        _ => Disturbance::Reboot,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_printed_script_reads_back_as_it_was() {
        for seed in 0..200 {
            let script = Script::random(seed);
            let text = script.to_string();
            let read: Script = Check { file: "script" }.parse(&text).unwrap();
            assert_eq!(read, script, "{text}");
        }
    }
}
