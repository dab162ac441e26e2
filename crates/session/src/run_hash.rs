use std::collections::BTreeMap;
use std::path::Path;
use std::time::SystemTime;

use rig::Port;
use sha2::{Digest, Sha256};
use sweep::{Job, Plan};

use crate::{RunRequest, SessionError};

impl RunRequest {
    /// A key under which the results of this job on this rig can be kept: a SHA-256 in hexadecimal digits.
    ///
    /// It is another one whenever what would be measured, or how, is another: it is made of what job and rig file say, with
    /// defaults filled in, of the plan, of the file that lies on the simulator's stage, of the stored calibration where the
    /// rig file asks for one, and of the version of this program. Comments, white space, the order of keys and the names of
    /// the files make no difference, nor does what the rig is called, who measures and what for, nor the simulator's table
    /// where the rig is a real one.
    ///
    /// # Errors
    /// The specimen's file cannot be read; the rig file asks for a stored calibration and there is no valid one.
    pub fn hash(&self, plan: &Plan, now: SystemTime) -> Result<String, SessionError> {
        let job = Job {
            name: String::new(),
            // It says when a job begins, not what it measures.
            on_stage: false,
            // Nor do these.
            operator: String::new(),
            project: String::new(),
            ..self.job.clone()
        };
        let mut rig = self.rig.clone();
        rig.about = rig::About::default();
        let sim = match rig.bus.port {
            Port::Sim => std::mem::take(&mut rig.sim),
            Port::Path(_) => toml::Table::new(),
        };
        rig.sim = toml::Table::new();
        let certificate = self.certificate(now)?;
        // What the checked types hold is all that a run knows of the files, and whatever they hold shows. Their text may
        // differ between versions of this program, whose results may differ as well.
        let parts = [
            env!("CARGO_PKG_VERSION").to_owned(),
            format!("{job:?}"),
            format!("{rig:?}"),
            sorted(&toml::Value::Table(sim.clone())),
            format!("{certificate:?}"),
            format!("{plan:?}"),
        ];
        let mut hash = Sha256::new();
        for part in &parts {
            add(&mut hash, part.as_bytes());
        }
        if let Some(path) = on_stage(&sim) {
            let read = crate::run_request::read("specimen's file", path, |path| std::fs::read(path))?;
            add(&mut hash, &read);
        }
        Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
    }
}

/// Adds bytes with their length, so that no two lists of parts make the same stream.
fn add(hash: &mut Sha256, bytes: &[u8]) {
    hash.update((bytes.len() as u64).to_le_bytes());
    hash.update(bytes);
}

/// The file that lies on the simulator's stage, where its table names one.
fn on_stage(sim: &toml::Table) -> Option<&Path> {
    let path = Path::new(sim.get("specimen")?.as_str()?);
    path.is_file().then_some(path)
}

/// The text of a value with the keys of every table in order.
fn sorted(value: &toml::Value) -> String {
    match value {
        toml::Value::Table(table) => {
            let table: BTreeMap<_, _> = table.iter().map(|(key, value)| (key, sorted(value))).collect();
            format!("{table:?}")
        }
        toml::Value::Array(array) => {
            let array: Vec<_> = array.iter().map(sorted).collect();
            format!("{array:?}")
        }
        other => format!("{other:?}"),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use toml::{Table, Value};

    use super::*;

    const JOB: &str =
        "specimen = \"x\"\n[[plane]]\ntheta_r_deg = 45.0\nreadings = 6\n[arc]\nreadings = 5\noffset = 0.1\n";

    fn hash_of(job: &str, rig: &str) -> Option<String> {
        let request =
            RunRequest::parse(job.to_owned(), "job.toml", rig.to_owned(), "rig.toml".as_ref()).ok()?;
        let plan = request.plan(None).ok()?;
        Some(request.hash(&plan, SystemTime::UNIX_EPOCH).unwrap())
    }

    /// A text that says the same: keys in another order, comments, white space.
    fn said_otherwise(table: &Table, seed: u64) -> String {
        let mut text = String::new();
        write(&mut text, table, "", &mut { seed });
        text
    }

    fn next(state: &mut u64) -> u64 {
        *state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        *state >> 33
    }

    fn write(text: &mut String, table: &Table, path: &str, state: &mut u64) {
        let mut keys: Vec<_> = table.iter().collect();
        for i in (1..keys.len()).rev() {
            keys.swap(i, next(state) as usize % (i + 1));
        }
        for (key, value) in keys {
            let blanks = " ".repeat(next(state) as usize % 4);
            match value {
                Value::Table(below) if path.is_empty() => write(text, below, &format!("{key}."), state),
                value => *text += &format!("{blanks}{path}{key}{blanks} = {value}  # {}\n\n", next(state)),
            }
        }
    }

    fn built_in() -> Table {
        rig::RigFile::BUILT_IN.parse().unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(8))]
        #[test]
        fn prop_comments_white_space_and_order_make_no_difference(seed in any::<u64>()) {
            let job: Table = JOB.parse().unwrap();
            let rig = built_in();
            let said = hash_of(&said_otherwise(&job, seed), &said_otherwise(&rig, seed.rotate_left(7)));
            prop_assert_eq!(said, hash_of(JOB, ""));
        }
    }

    /// Values near one, of which a key may take some.
    fn others(value: &Value) -> Vec<Value> {
        match value {
            Value::Float(x) => [x * 1.01 + 1e-3, x * 0.99, x + 1.0, x - 1.0]
                .map(Value::Float)
                .to_vec(),
            Value::Integer(n) => [n + 1, n - 1, n + 2, -n, n + 20, 2 * n, 57_600]
                .map(Value::Integer)
                .to_vec(),
            Value::Boolean(is) => vec![Value::Boolean(!is)],
            Value::String(_) => [
                "none",
                "up",
                "down",
                "hold",
                "limp",
                "over",
                "under",
                "monitor",
                "visits",
                "real",
                "wire",
                "default",
                "XH430-W350",
                "aluminium",
                "/dev/ttyUSB7",
            ]
            .map(|word| Value::String(word.to_owned()))
            .to_vec(),
            Value::Array(array) => {
                let by = |factor: f64| {
                    let scaled = |value: &Value| {
                        let number = value.as_float().or(value.as_integer().map(|whole| whole as f64));
                        number.map_or_else(|| value.clone(), |x| Value::Float(x * factor + 1e-3))
                    };
                    Value::Array(array.iter().map(scaled).collect())
                };
                vec![by(1.01), by(0.99)]
            }
            _ => Vec::new(),
        }
    }

    #[test]
    fn whatever_another_value_is_given_to_the_key_is_another_one() {
        let before = hash_of(JOB, "").unwrap();
        let parse = |text: &str| rig::RigFile::parse(text, "rig.toml".as_ref());
        let plain = parse("").unwrap();
        let mut tried = 0;
        // What a rig is called makes it no other one.
        for (name, table) in built_in().iter().filter(|(name, _)| *name != "rig") {
            for (key, value) in table.as_table().unwrap() {
                for other in others(value) {
                    let text = format!("{name}.{key} = {other}\n");
                    // Refused, or rounded to the same steps of a register.
                    if parse(&text).map_or(true, |rig| rig == plain) {
                        continue;
                    }
                    let Some(after) = hash_of(JOB, &text) else {
                        continue;
                    };
                    assert_ne!(after, before, "{text}");
                    tried += 1;
                    break;
                }
            }
        }
        assert!(tried > 70, "only {tried} keys could be given another value");
        for (from, to) in [
            ("\"x\"", "\"y\""),
            ("45.0", "46.0"),
            ("= 6", "= 7"),
            ("= 5", "= 6"),
            ("0.1", "0.2"),
        ] {
            assert_ne!(
                hash_of(&JOB.replacen(from, to, 1), "").unwrap(),
                before,
                "{from} to {to}"
            );
        }
    }

    #[test]
    fn the_simulator_counts_where_it_is_the_rig_and_its_specimen_by_what_is_in_the_file() {
        let real = "bus.port = \"/dev/ttyUSB0\"\n";
        assert_eq!(hash_of(JOB, real), hash_of(JOB, &format!("{real}sim.seed = 7\n")));
        assert_ne!(hash_of(JOB, ""), hash_of(JOB, "sim.seed = 7\n"));
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("specimen.binary");
        let rig = format!("sim.specimen = \"{}\"\n", path.display());
        std::fs::write(&path, "one").unwrap();
        let one = hash_of(JOB, &rig);
        std::fs::write(&path, "two").unwrap();
        assert_ne!(one, hash_of(JOB, &rig));
    }

    #[test]
    fn what_the_rig_is_called_and_who_measures_is_no_other_result() {
        let named = "[rig]\nname = \"North\"\nid = \"R1\"\nlocation = \"room 4\"\n";
        assert_eq!(hash_of(JOB, ""), hash_of(JOB, named));
        let said = format!("{JOB}[run]\noperator = \"Meier\"\nproject = \"P-17\"\n");
        assert_eq!(hash_of(JOB, ""), hash_of(&said, ""));
    }

    #[test]
    fn saying_that_the_specimen_is_on_the_stage_measures_the_same() {
        assert_eq!(hash_of(&format!("on_stage = true\n{JOB}"), ""), hash_of(JOB, ""));
    }
}
