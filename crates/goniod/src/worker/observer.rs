use std::sync::Arc;

use capture::{Event, Reading, Record, State};
use sweep::Sweep;

use crate::operator::Permit;
use crate::shared::Shared;
use crate::{Activity, FaultCode, Progress, What, view};

/// A pose measured again may differ by so much before it is worth a warning: twice the lamp's drift.
const DIFFERENCE: f64 = 0.01;

/// Turns what a capture says into what the daemon shows and tells.
pub(super) struct Observer<'a> {
    shared: Arc<Shared>,
    permit: &'a Permit,
    run: String,
    /// What the reflectance of a reading rests on: header, first beginning, readings in the dark and of a reference, and
    /// the one that ends each series in the dark, or two series would count as one.
    basis: Vec<Record>,
    /// The exposures of the present step that are not among them: one that counts is told together with them.
    beside: Vec<Record>,
    /// The fault that ended the capture.
    pub(super) fault: Option<FaultCode>,
}

impl<'a> Observer<'a> {
    pub(super) fn new(shared: Arc<Shared>, permit: &'a Permit, run: &str, records: &[Record]) -> Self {
        let mut observer = Self {
            shared,
            permit,
            run: run.to_owned(),
            basis: Vec::new(),
            beside: Vec::new(),
            fault: None,
        };
        for record in records {
            observer.learn(record);
        }
        observer
    }

    /// Shows and tells one event.
    pub(super) fn see(&mut self, event: Event) {
        match event {
            Event::State { state } => self.state(state),
            Event::Step {
                step,
                of,
                sweep,
                goal,
            } => {
                self.shared.publish(What::Step {
                    step,
                    of,
                    sweep: sweep.to_string(),
                    light_deg: goal.light.deg(),
                    sensor_deg: goal.sensor.deg(),
                });
            }
            Event::Reading { reading } => self.reading(&reading),
            Event::Repeat {
                reading,
                difference_rel,
            } => {
                self.shared.publish(What::Repeat {
                    step: reading.step,
                    difference_rel,
                });
                if difference_rel.abs() > DIFFERENCE {
                    self.shared.warn(format!(
                        "measured again, step {} differs by {:.2} %: has the specimen, the lamp or the stage changed?",
                        reading.step,
                        difference_rel * 100.0
                    ));
                }
            }
            Event::Progress {
                done,
                of,
                seconds_left,
                retries,
            } => {
                let progress = Progress {
                    done,
                    of,
                    seconds_left,
                    retries,
                };
                self.shared
                    .view
                    .send_modify(|view| view.progress = Some(progress));
                self.shared.publish(What::Progress { progress });
            }
            Event::Suspended { why } => self.shared.warn(format!("the run holds: {why}")),
            Event::Safe => self.permit.release(),
            Event::Fault { kind, .. } => self.fault = Some(view::fault_code(kind)),
        }
    }

    fn state(&mut self, state: State) {
        let activity = view::activity(state);
        self.shared.activity(activity);
        self.shared.holding.send_if_modified(|holding| {
            let now = activity == Activity::Paused;
            std::mem::replace(holding, now) != now
        });
        if activity == Activity::WarmingUp {
            self.shared.view.send_modify(|view| view.lamp = true);
        }
    }

    fn reading(&mut self, reading: &Reading) {
        let record = Record::Reading(reading.clone());
        if !self
            .basis
            .iter()
            .any(|record| matches!(record, Record::Begin { .. }))
        {
            self.basis.push(Record::Begin {
                identities: Vec::new(),
                device_ticks: reading.device_ticks,
                at: String::new(),
            });
        }
        let step = |beside: &Record| matches!(beside, Record::Reading(other) if other.step == reading.step);
        self.beside.retain(step);
        let known = self.basis.len();
        self.basis.extend_from_slice(&self.beside);
        self.basis.push(record.clone());
        let measured = report::measurements(&self.basis, &self.shared.rig).pop();
        self.basis.truncate(known);
        if !self.learn(&record) {
            self.beside.push(record);
        }
        let nominal = self.shared.rig.calibration.monitor * f64::from(reading.counts.exposure.integration_us);
        self.shared.view.send_modify(|view| {
            view.temperature_c = Some(reading.counts.temperature_c);
            view.lamp = reading.lamp;
            if reading.lamp {
                view.lamp_monitor = Some(f64::from(reading.counts.monitor) / nominal);
            }
        });
        if let Some(measured) = measured {
            self.shared.publish(What::Reading {
                run: self.run.clone(),
                reading: Box::new(view::reading(&measured)),
            });
        }
    }

    /// Keeps a record on which the reflectance of others rests; returns whether it is one.
    fn learn(&mut self, record: &Record) -> bool {
        let rests_on = match record {
            Record::Header(_) => true,
            Record::Begin { .. } => self.basis.len() < 2,
            Record::Reading(reading) => {
                let after_dark = matches!(self.basis.last(), Some(Record::Reading(last)) if !last.lamp);
                !reading.lamp || after_dark || reading.sweep == Sweep::Reference
            }
            _ => false,
        };
        if rests_on {
            self.basis.push(record.clone());
        }
        rests_on
    }
}
