use std::collections::BTreeMap;

use capture::{Flag, Header, Outcome, Reading, Record};
use rig::{Certificate, Conditions, Identity, RigFile};
use serde::Serialize;
use sha2::{Digest, Sha256};
use sweep::{Job, Specimen};

use crate::Verdict;

/// Seconds per tick of the photometer's clock.
pub(crate) const TICK_S: f64 = 1e-5;

/// How a run stands, in the words in which the daemon says how its job stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Every step was read.
    Done,
    /// It is not complete and can be resumed: the operator stopped it, a fault ended it, its process ended without a
    /// word, or it still goes on. [`Run::fault`] and [`Run::exit_status`] say which.
    Interrupted,
}

/// A text of the journal's header with its SHA-256.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Given {
    /// SHA-256 of the text, hexadecimal.
    pub sha256: String,
    /// The file as given.
    pub text: String,
}

/// The rig file of the journal's header, with what it says of the rig for the record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct GivenRig {
    /// The file.
    #[serde(flatten)]
    pub file: Given,
    /// What the rig is called; empty where the file does not say.
    pub name: String,
    /// Its number, likewise.
    pub id: String,
    /// Where it stands, likewise.
    pub location: String,
}

impl GivenRig {
    fn new(text: &str) -> Self {
        // A file that is not accepted any more says nothing here; whoever needs more of it tells what is wrong.
        let file = RigFile::parse(text, "rig file".as_ref()).ok();
        let about = file.map(|file| file.about).unwrap_or_default();
        Self {
            file: Given::new(text),
            name: about.name,
            id: about.id,
            location: about.location,
        }
    }
}

impl Given {
    fn new(text: &str) -> Self {
        let hash = Sha256::digest(text.as_bytes());
        Self {
            sha256: hash.iter().map(|byte| format!("{byte:02x}")).collect(),
            text: text.to_owned(),
        }
    }
}

/// A stored calibration as a run names it; the journal holds it whole.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Used {
    /// Its id.
    pub id: String,
    /// When it was made, RFC 3339.
    pub made: String,
    /// How each of its parts was made.
    pub parts: BTreeMap<&'static str, Conditions>,
    /// Its place in the order of certificates; 0: it was made before they had one.
    pub number: u64,
    /// What is worth a look in it.
    pub remarks: Vec<String>,
}

impl Used {
    fn new(certificate: &Certificate) -> Self {
        Self {
            id: certificate.id.clone(),
            made: certificate.made.clone(),
            number: certificate.number,
            remarks: certificate.remarks.clone(),
            parts: certificate
                .parts()
                .map(|(name, conditions)| (name, conditions.clone()))
                .collect(),
        }
    }
}

/// run.json: what was done, with what, and how it went; all of it from the journal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Run {
    /// Id, never reused.
    pub id: String,
    /// How it stands.
    pub state: State,
    /// What the checks say of its result as a whole.
    pub verdict: Verdict,
    /// Exit status of the command that ran it last: 0 complete, 6 complete and not usable, 3 ended by a fault, 4 stopped by the operator; `None`
    /// where it goes on, or ended without a word.
    pub exit_status: Option<u8>,
    /// The fault in words, where one ended it.
    pub fault: Option<String>,
    /// Version of the program that captured it.
    pub version: String,
    /// The job file.
    pub job: Given,
    /// The rig file.
    pub rig: GivenRig,
    /// What was measured.
    pub specimen: Specimen,
    /// Who measured, as the job file says; empty where it does not.
    pub operator: String,
    /// What it was measured for, likewise.
    pub project: String,
    /// The stored calibration that was used.
    pub calibration: Option<Used>,
    /// Light servo, sensor servo, photometer, as they answered last.
    pub identities: Vec<Identity>,
    /// Wall clock at the start, RFC 3339.
    pub started: String,
    /// Wall clock at the end of the last execution, RFC 3339.
    pub ended: Option<String>,
    /// Executions: 1, and one for each resumption.
    pub executions: usize,
    /// Seconds of rig time, by the photometer's clock.
    pub seconds: Seconds,
    /// Readings by kind.
    pub readings: Readings,
    /// Requests on the bus that had to be repeated.
    pub retries: u64,
    /// How many readings carry each flag.
    pub flags: BTreeMap<&'static str, usize>,
    /// Whether nothing can be added to the plan any more.
    #[serde(skip)]
    closed: bool,
}

/// Seconds of rig time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// All executions together.
    pub total: f64,
    /// Per sweep: from the reading before, or the start, to each of its readings; "end": from the last one on.
    pub phases: BTreeMap<String, f64>,
    /// Integration, of all readings.
    pub light: f64,
    /// Of that, exposures beside those that count: saturated, too dim, or for a channel that was too faint.
    pub again: f64,
}

impl Seconds {
    fn expose(&mut self, reading: &Reading) {
        let seconds = reading.counts.exposure.duration().as_secs_f64();
        self.light += seconds;
        if !reading.accepted {
            self.again += seconds;
        }
    }

    fn add(&mut self, phase: String, from_ticks: u64, to_ticks: u64) {
        // A photometer that was switched off in between starts its clock again.
        let seconds = to_ticks.saturating_sub(from_ticks) as f64 * TICK_S;
        self.total += seconds;
        *self.phases.entry(phase).or_default() += seconds;
    }
}

/// Counts of readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Readings {
    /// Steps of the plan.
    pub planned: usize,
    /// Everything that the photometer read.
    pub taken: usize,
    /// Those that count for their step.
    pub accepted: usize,
    /// Those that count although a channel is saturated or has too few counts.
    pub poor: usize,
}

impl Run {
    /// The summary of a journal: its header and all its records.
    pub fn new(header: &Header, records: &[Record]) -> Self {
        let mut run = Self::begun(header);
        let mut clock = 0;
        for record in records {
            match record {
                Record::Header(_) => {}
                Record::Begin {
                    identities,
                    device_ticks,
                    ..
                } => {
                    run.executions += 1;
                    run.state = State::Interrupted;
                    run.exit_status = None;
                    run.fault = None;
                    run.identities.clone_from(identities);
                    clock = *device_ticks;
                }
                Record::Reading(reading) => {
                    run.count(reading);
                    run.seconds
                        .add(reading.sweep.to_string(), clock, reading.device_ticks);
                    clock = reading.device_ticks;
                }
                Record::Extension(extension) => run.readings.planned += extension.steps.len(),
                Record::Repeat { reading, .. } => {
                    run.retries += u64::from(reading.retries);
                    run.seconds
                        .add(reading.sweep.to_string(), clock, reading.device_ticks);
                    clock = reading.device_ticks;
                }
                Record::Suspended { device_ticks, .. } => clock = *device_ticks,
                Record::Released { device_ticks, .. } => {
                    run.seconds.add("suspended".into(), clock, *device_ticks);
                    clock = *device_ticks;
                }
                Record::End {
                    outcome,
                    device_ticks,
                    at,
                } => {
                    run.end(outcome, at);
                    run.seconds
                        .add("end".into(), clock, device_ticks.unwrap_or(clock));
                }
            }
        }
        run.closed = capture::closed(records);
        run
    }

    /// What is said of specimen, people and rig beside the specimen's name: key, label, value; only what is said.
    pub fn record(&self) -> Vec<(&'static str, &'static str, String)> {
        let named = |name: &str, id: &str| match (name, id) {
            (name, "") => name.to_owned(),
            ("", id) => id.to_owned(),
            (name, id) => format!("{name} ({id})"),
        };
        let Self { specimen, rig, .. } = self;
        [
            ("specimen_id", "Specimen's number", specimen.id.clone()),
            ("material", "Material", specimen.material.clone()),
            ("tags", "Tags", specimen.tags.join(", ")),
            ("notes", "Notes", specimen.notes.clone()),
            ("operator", "Operator", self.operator.clone()),
            ("project", "Project", self.project.clone()),
            ("rig", "Rig", named(&rig.name, &rig.id)),
            ("location", "Where it stands", rig.location.clone()),
        ]
        .into_iter()
        .filter(|(_, _, value)| !value.is_empty())
        .collect()
    }

    /// Notes what the checks say of the result as a whole.
    pub(crate) fn judge(&mut self, verdict: Verdict) {
        self.verdict = verdict;
        if self.state == State::Done && verdict == Verdict::Bad {
            self.exit_status = Some(6);
        }
    }

    /// Whether every step of the plan has an accepted reading, and no more can be added.
    pub fn complete(&self) -> bool {
        self.closed && self.readings.accepted >= self.readings.planned
    }

    fn begun(header: &Header) -> Self {
        // As of the rig file.
        let job = Job::parse(&header.job, "job file").ok();
        let (operator, project) = job
            .as_ref()
            .map(|job| (job.operator.clone(), job.project.clone()))
            .unwrap_or_default();
        Self {
            specimen: job.map(|job| job.specimen).unwrap_or_default(),
            operator,
            project,
            id: header.run.clone(),
            state: State::Interrupted,
            verdict: Verdict::Unknown,
            exit_status: None,
            fault: None,
            version: header.version.clone(),
            job: Given::new(&header.job),
            rig: GivenRig::new(&header.rig),
            calibration: header.certificate.as_deref().map(Used::new),
            identities: Vec::new(),
            started: header.started.clone(),
            ended: None,
            executions: 0,
            seconds: Seconds::default(),
            readings: Readings {
                planned: header.plan.steps.len(),
                ..Readings::default()
            },
            retries: 0,
            flags: BTreeMap::new(),
            closed: false,
        }
    }

    fn count(&mut self, reading: &Reading) {
        self.seconds.expose(reading);
        self.readings.taken += 1;
        self.readings.accepted += usize::from(reading.accepted);
        let poor = |flag: &Flag| matches!(flag, Flag::Saturated | Flag::Dim);
        self.readings.poor += usize::from(reading.accepted && reading.flags.iter().any(poor));
        self.retries += u64::from(reading.retries);
        for &flag in &reading.flags {
            *self.flags.entry(flag_name(flag)).or_default() += 1;
        }
    }

    fn end(&mut self, outcome: &Outcome, at: &str) {
        let (state, exit_status, fault) = match outcome {
            Outcome::Done => (State::Done, 0, None),
            Outcome::Stopped => (State::Interrupted, 4, None),
            Outcome::Failed { fault } => (State::Interrupted, 3, Some(fault.clone())),
        };
        self.state = state;
        self.exit_status = Some(exit_status);
        self.fault = fault;
        self.ended = Some(at.to_owned());
    }
}

/// A flag as files name it.
pub fn flag_name(flag: Flag) -> &'static str {
    match flag {
        Flag::Saturated => "saturated",
        Flag::Dim => "dim",
        Flag::Blurred => "blurred",
        Flag::Retried => "retried",
        Flag::Shadowed => "shadowed",
    }
}

#[cfg(test)]
mod tests {
    use arms::Pose;
    use rig::{Counts, Exposure, Gain};
    use sweep::{Plan, Sweep};

    use super::*;

    fn header() -> Header {
        Header {
            run: "01".into(),
            version: "0".into(),
            job: "abc".into(),
            rig: String::new(),
            plan: Plan {
                steps: Vec::new(),
                left_out: Vec::new(),
                overhead_s: 0.0,
                closing_s: 0.0,
                open: false,
            },
            started: "2026-01-01T00:00:00Z".into(),
            certificate: None,
        }
    }

    fn begin(device_ticks: u64) -> Record {
        Record::Begin {
            identities: Vec::new(),
            device_ticks,
            at: String::new(),
        }
    }

    fn reading(sweep: Sweep, device_ticks: u64, flags: Vec<Flag>) -> Record {
        Record::Reading(Reading {
            step: 0,
            attempt: 0,
            accepted: flags.is_empty(),
            sweep,
            lamp: sweep != Sweep::Dark,
            goal: Pose::default(),
            measured: Pose::default(),
            counts: Counts {
                rgb: [0; 3],
                monitor: 0,
                exposure: Exposure {
                    integration_us: 100,
                    gain: Gain::X1,
                },
                saturated: false,
                sequence: 1,
                ticks: 0,
                temperature_c: 25,
            },
            device_ticks,
            retries: 2,
            flags,
            swept_rad: None,
            spread_rad: None,
        })
    }

    #[test]
    fn seconds_belong_to_what_they_were_spent_on_and_a_pause_to_nothing() {
        let stopped = Record::End {
            outcome: Outcome::Stopped,
            device_ticks: Some(600_000),
            at: "later".into(),
        };
        let records = [
            Record::Header(header()),
            begin(100_000),
            reading(Sweep::Dark, 200_000, vec![]),
            reading(Sweep::Plane(1), 500_000, vec![Flag::Saturated]),
            stopped,
            begin(9_000_000),
            reading(Sweep::Plane(1), 9_100_000, vec![]),
        ];
        let run = Run::new(&header(), &records[..5]);
        assert_eq!((run.state, run.exit_status), (State::Interrupted, Some(4)));
        let run = Run::new(&header(), &records);
        assert_eq!(
            (run.state, run.exit_status),
            (State::Interrupted, None),
            "it has not ended again"
        );
        assert_eq!(run.executions, 2);
        let seconds = |phase: &str| (run.seconds.phases[phase] * 1e5).round();
        assert_eq!(
            [seconds("dark"), seconds("plane 1"), seconds("end")],
            [1e5, 4e5, 1e5]
        );
        assert!((run.seconds.total - 6.0).abs() < 1e-9, "{}", run.seconds.total);
        assert_eq!(
            (run.readings.taken, run.readings.accepted, run.retries),
            (3, 2, 6)
        );
        assert_eq!(run.flags["saturated"], 1);
    }

    #[test]
    fn a_run_says_of_what_by_whom_and_on_which_rig() {
        let plane = "[[plane]]\ntheta_r_deg = 60\nreadings = 6\n";
        let header = |job: &str, rig: &str| Header {
            job: format!("{job}\n{plane}"),
            rig: rig.to_owned(),
            ..header()
        };
        let job =
            "[specimen]\nname = \"blue\"\nid = \"L-4\"\ntags = [\"a\", \"b\"]\n[run]\noperator = \"Meier\"";
        let run = Run::new(&header(job, "[rig]\nname = \"North\"\nid = \"R1\""), &[]);
        let record = run.record();
        let record: Vec<_> = record
            .iter()
            .map(|(key, _, value)| (*key, value.as_str()))
            .collect();
        assert_eq!(
            record,
            [
                ("specimen_id", "L-4"),
                ("tags", "a, b"),
                ("operator", "Meier"),
                ("rig", "North (R1)")
            ]
        );
        let json = serde_json::to_value(&run).unwrap();
        assert_eq!(json["specimen"]["name"], "blue");
        assert_eq!(
            (&json["rig"]["name"], &json["operator"]),
            (&"North".into(), &"Meier".into())
        );
        assert!(json["rig"]["sha256"].is_string(), "as before");
        assert!(Run::new(&header("specimen = \"x\"", ""), &[]).record().is_empty());
    }

    #[test]
    fn given_texts_are_hashed() {
        // The example of FIPS 180-2, appendix B.1.
        let hash = Run::new(&header(), &[]).job.sha256;
        assert_eq!(
            hash,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }
}
