use std::time::SystemTime;

use arms::Pose;
use rig::{Drive, Exposure, Identity, Rig, RigFile};
use sweep::{Plan, Step};
use tokio::sync::watch;

use crate::clock::DeviceClock;
use crate::exposure::Ranging;
use crate::progress::Progress;
use crate::run::Ask;
use crate::{CaptureError, Command, Event, Journal, Reading, Record, State, closed};

mod dark;
mod fly;
mod refresh;
mod repeat;
mod shutdown;
mod step;
mod suspend;
mod wait;

pub(crate) use shutdown::{Interrupt, chain};
pub(crate) use step::MAX_EXPOSURES;

/// Ticks of the photometer's clock per second.
const TICKS_PER_S: f64 = 1e5;

/// One execution of a plan, from who-are-you to lamp off.
pub(crate) struct Execution<'a, R: Rig> {
    plan: Plan,
    file: &'a RigFile,
    drive: &'a mut Drive<R>,
    journal: &'a mut dyn Journal,
    control: watch::Receiver<Command>,
    on_event: &'a mut (dyn FnMut(Event) + Send),
    /// Who says what is measured once every step is done.
    ask: Option<&'a mut Ask<'a>>,
    /// Whether each step has an accepted reading.
    done: Vec<bool>,
    /// Readings of each step so far, accepted or not.
    attempts: Vec<u32>,
    ranging: Ranging<'a>,
    progress: Progress,
    clock: DeviceClock,
    /// Device time at the end of the last step.
    mark: u64,
    lamp: bool,
    /// How bright it was last, relative to its nominal output, and the exposure that showed it.
    lamp_rel: Option<f64>,
    lamp_exposure: Option<Exposure>,
    /// Device time at which the surroundings were judged last.
    judged: Option<u64>,
    /// Whether a device was told anything: until each has said who it is, none is.
    touched: bool,
    /// Where the plan left the arms, so that a step's own path leads on.
    standing: Option<Pose>,
    /// Readings of a flight that has not landed, or of a set of dark readings that was not judged.
    aloft: Vec<Reading>,
    /// Whether the run was held since its last dark and reference readings, so that they say nothing of what follows.
    stale: bool,
}

impl<'a, R: Rig> Execution<'a, R> {
    pub(crate) fn new(
        plan: Plan,
        file: &'a RigFile,
        drive: &'a mut Drive<R>,
        journal: &'a mut dyn Journal,
        control: watch::Receiver<Command>,
        on_event: &'a mut (dyn FnMut(Event) + Send),
        ask: Option<&'a mut Ask<'a>>,
    ) -> Self {
        let mut done = vec![false; plan.steps.len()];
        let mut attempts = vec![0; plan.steps.len()];
        let mut ranging = Ranging::new(file);
        for reading in readings(journal.records()) {
            // What refers to no step of the plan cannot count for one.
            let Some(attempts) = attempts.get_mut(reading.step) else {
                continue;
            };
            *attempts += 1;
            if reading.accepted {
                done[reading.step] = true;
                ranging.learn(reading);
            }
        }
        let progress = Progress::new(&plan, |step| done[step]);
        Self {
            plan,
            file,
            drive,
            journal,
            control,
            on_event,
            ask,
            done,
            attempts,
            ranging,
            progress,
            clock: DeviceClock::default(),
            mark: 0,
            lamp: false,
            lamp_rel: None,
            lamp_exposure: None,
            judged: None,
            touched: false,
            standing: None,
            aloft: Vec::new(),
            stale: false,
        }
    }

    /// Everything up to the last reading.
    pub(crate) async fn all(&mut self) -> Result<(), Interrupt<R::Error>> {
        self.state(State::Identifying);
        self.drive.begin_anew();
        self.begin().await?;
        self.drive.rest().await?;
        self.suspend().await?;
        self.state(State::Engaging);
        self.touched = true;
        self.drive.engage_all().await?;
        self.state(State::Running);
        self.report_progress();
        if let Some(next) = self.done.iter().position(|&done| !done) {
            // A hold until now is made good by these readings too.
            self.stale = false;
            let to = self.plan.steps[next].pose();
            self.refresh_dark(to).await?;
            self.repeat().await?;
            self.refresh_reference().await?;
        }
        let mut next = 0;
        loop {
            let first = next;
            while let Some(step) = self.plan.steps.get(next).cloned() {
                next += 1;
                if let Some(pass) = step.pass {
                    let ends = self.plan.steps[step.index..]
                        .iter()
                        .position(|later| later.pass != step.pass);
                    next = ends.map_or(self.plan.steps.len(), |steps| step.index + steps);
                    if self.torn(step.index..next) {
                        self.pass(pass).await?;
                    }
                    continue;
                }
                if step.sweep == sweep::Sweep::Dark {
                    let (set, after) = self.dark_set_from(step.index);
                    next = after;
                    match set.is_empty() {
                        true => self.standing = None,
                        false => self.dark_set(&set).await?,
                    }
                    continue;
                }
                if self.done[step.index] {
                    self.standing = None;
                    continue;
                }
                self.make_ready(step.pose()).await?;
                self.step(&step).await?;
            }
            self.make_up(first..next).await?;
            if !self.extend().await? {
                return self.closing_dark().await;
            }
        }
    }

    /// Takes at rest what flights left undone.
    async fn make_up(&mut self, steps: std::ops::Range<usize>) -> Result<(), Interrupt<R::Error>> {
        let mut next = steps.start;
        while next < steps.end {
            let index = next;
            next += 1;
            if self.done[index] {
                continue;
            }
            let step = self.plan.steps[index].clone();
            if step.sweep == sweep::Sweep::Dark {
                let (set, after) = self.dark_set_from(index);
                next = after;
                self.dark_set(&set).await?;
                continue;
            }
            self.make_ready(step.pose()).await?;
            // Its own path leads from its neighbour in the pass.
            self.standing = self.standing.filter(|&pose| pose == step.pose());
            self.step(&step).await?;
        }
        Ok(())
    }

    /// Whether a flight over these steps has not been recorded whole: every step that it read was tried at least once.
    fn torn(&self, steps: std::ops::Range<usize>) -> bool {
        steps.into_iter().any(|i| !self.done[i] && self.attempts[i] == 0)
    }

    /// Asks what else is to be measured, looking after the rig meanwhile, and records the answer. Returns whether
    /// steps were added.
    async fn extend(&mut self) -> Result<bool, Interrupt<R::Error>> {
        let Some(ask) = self.ask.as_mut().filter(|_| !closed(self.journal.records())) else {
            return Ok(false);
        };
        let mut thinking = ask(self.journal.records());
        let extension = loop {
            if let Ok(extension) = tokio::time::timeout(self.look_every(), &mut thinking).await {
                break extension;
            }
            self.obey().await?;
            self.mark = self.look().await?;
        };
        self.append(&Record::Extension(extension.clone())).await?;
        let added = !extension.steps.is_empty();
        self.add(extension.steps);
        Ok(added)
    }

    /// Adds steps to the end of the plan.
    fn add(&mut self, steps: Vec<Step>) {
        let of = self.plan.steps.len() + steps.len();
        self.done.resize(of, false);
        self.attempts.resize(of, 0);
        self.progress.extend(&steps);
        self.plan.steps.extend(steps);
        self.report_progress();
    }

    /// Asks every device who it is and when, and records it.
    async fn begin(&mut self) -> Result<(), Interrupt<R::Error>> {
        let found: Vec<Identity> = self.drive.identify_all().await?.into();
        let recorded = self.journal.records().iter().find_map(|record| match record {
            Record::Begin { identities, .. } => Some(identities.clone()),
            _ => None,
        });
        if let Some(recorded) = recorded.filter(|recorded| *recorded != found) {
            return Err(Interrupt::Refused(CaptureError::OtherDevices { recorded, found }));
        }
        let ticks = self.drive.ticks().await?;
        self.clock = DeviceClock::new(last_ticks(self.journal.records()), ticks);
        self.mark = self.clock.last();
        self.append(&Record::Begin {
            identities: found,
            device_ticks: self.mark,
            at: now(),
        })
        .await
    }

    /// Makes a reading durable, then known.
    async fn record(&mut self, reading: Reading, step: &Step) -> Result<(), Interrupt<R::Error>> {
        self.append(&Record::Reading(reading.clone())).await?;
        self.attempts[step.index] += 1;
        let accepted = reading.accepted;
        if accepted {
            self.ranging.learn(&reading);
            self.done[step.index] = true;
            let passed = reading.device_ticks.saturating_sub(self.mark);
            self.mark = reading.device_ticks;
            self.progress
                .step(step.sweep, step.seconds, passed as f64 / TICKS_PER_S);
        }
        self.emit(Event::Reading {
            reading: Box::new(reading),
        });
        if accepted {
            self.report_progress();
        }
        Ok(())
    }

    /// Makes a record durable. A medium that is slow does not let the watchdogs starve.
    async fn append(&mut self, record: &Record) -> Result<(), Interrupt<R::Error>> {
        let every = self.look_every();
        let mut append = self.journal.append(record);
        loop {
            match tokio::time::timeout(every, &mut append).await {
                Ok(result) => return Ok(result?),
                Err(_) if self.touched => drop(self.drive.snapshot().await?),
                Err(_) => {}
            }
        }
    }

    fn emit(&mut self, event: Event) {
        (self.on_event)(event);
    }

    pub(crate) fn state(&mut self, state: State) {
        self.emit(Event::State { state });
    }

    fn report_progress(&mut self) {
        self.emit(Event::Progress {
            done: self.done.iter().filter(|&&done| done).count(),
            of: self.done.len(),
            seconds_left: self.progress.seconds_left(),
            retries: self.drive.retries(),
        });
    }
}

fn readings(records: &[Record]) -> impl Iterator<Item = &Reading> {
    records.iter().filter_map(|record| match record {
        Record::Reading(reading) => Some(reading),
        _ => None,
    })
}

/// The last device time in a journal.
fn last_ticks(records: &[Record]) -> Option<u64> {
    records.iter().rev().find_map(|record| match record {
        Record::Reading(reading) | Record::Repeat { reading, .. } => Some(reading.device_ticks),
        Record::Begin { device_ticks, .. } => Some(*device_ticks),
        Record::Suspended { device_ticks, .. } | Record::Released { device_ticks, .. } => Some(*device_ticks),
        Record::End { device_ticks, .. } => *device_ticks,
        Record::Header(_) | Record::Extension(_) => None,
    })
}

/// Wall clock, RFC 3339, UTC.
fn now() -> String {
    humantime::format_rfc3339_millis(SystemTime::now()).to_string()
}
