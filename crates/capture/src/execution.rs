use std::time::{Duration, SystemTime};

use arms::Pose;
use rig::{Counts, Drive, Exposure, Gain, Identity, Lamp, Rig, RigFile};
use sweep::{Plan, Step, Sweep};
use tokio::sync::watch;

use crate::clock::DeviceClock;
use crate::exposure::Ranging;
use crate::progress::Progress;
use crate::run::Ask;
use crate::{CaptureError, Command, Event, Flag, Journal, Reading, Record, State, closed, mechanics};

mod dark;
mod fly;
mod shutdown;
mod suspend;

pub(crate) use shutdown::Interrupt;

/// Most exposures of one reading in one execution until it counts: from one end of the range to the other takes six, by
/// a factor of about 16 each. One more may follow for its faintest channel.
pub(crate) const MAX_EXPOSURES: u32 = 8;
/// Longest time between two looks at a rig that waits, and at what the operator wants.
const LOOK: Duration = Duration::from_millis(200);
/// Share of its nominal output below which a lamp is out.
const OUT: f64 = 0.01;
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
    /// Readings of a flight that has not landed.
    aloft: Vec<Reading>,
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
        }
    }

    /// Everything up to the last reading.
    pub(crate) async fn all(&mut self) -> Result<(), Interrupt<R::Error>> {
        self.state(State::Identifying);
        self.begin().await?;
        self.drive.rest().await?;
        self.suspend().await?;
        self.state(State::Engaging);
        self.touched = true;
        self.drive.engage_all().await?;
        self.state(State::Running);
        self.report_progress();
        if self.done.contains(&false) {
            self.repeat().await?;
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
                if self.done[step.index] {
                    self.standing = None;
                    continue;
                }
                self.obey().await?;
                self.suspend().await?;
                self.step(&step).await?;
            }
            self.make_up(first..next).await?;
            if !self.extend().await? {
                return Ok(());
            }
        }
    }

    /// Takes at rest what flights left undone.
    async fn make_up(&mut self, steps: std::ops::Range<usize>) -> Result<(), Interrupt<R::Error>> {
        for index in steps {
            if self.done[index] {
                continue;
            }
            let step = self.plan.steps[index].clone();
            // Its own path leads from its neighbour in the pass.
            self.standing = self.standing.filter(|&pose| pose == step.pose());
            self.obey().await?;
            self.suspend().await?;
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
        let steps = self.plan.steps.len() + extension.steps.len();
        self.done.resize(steps, false);
        self.attempts.resize(steps, 0);
        self.progress.extend(&extension.steps);
        self.plan.steps.extend(extension.steps);
        self.report_progress();
        Ok(added)
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

    /// Measures a pose of the finished part again and records by how much it differs.
    async fn repeat(&mut self) -> Result<(), Interrupt<R::Error>> {
        let Some(before) = reference(self.journal.records()).cloned() else {
            return Ok(());
        };
        self.switch_lamp(true).await?;
        let retries = self.drive.retries();
        // In flight a reading is not taken at its step's pose itself.
        let taken = self.file.nearest(before.measured);
        let there = before.swept_rad.is_some() && self.file.envelope.check_pose(taken).is_ok();
        let measured = self.travel_anew(if there { taken } else { before.goal }).await?;
        let counts = self.drive.expose(before.counts.exposure).await?;
        if self.lamp_is_out(&counts) {
            return Err(Interrupt::Lamp);
        }
        let mut reading = Reading {
            accepted: false,
            sweep: Sweep::Repeat,
            swept_rad: None,
            measured,
            counts,
            device_ticks: self.clock.unwrap(counts.ticks),
            retries: self.drive.retries() - retries,
            ..before.clone()
        };
        reading.flags = self.flags(&reading);
        let difference_rel = difference_rel(&before.counts, &counts);
        let repeat = Record::Repeat {
            reading: reading.clone(),
            difference_rel,
        };
        self.append(&repeat).await?;
        self.mark = self.clock.last();
        self.emit(Event::Repeat {
            reading: Box::new(reading),
            difference_rel,
        });
        Ok(())
    }

    /// One step: lamp, motion, exposures until one is accepted, and one more where a channel is too faint in that.
    async fn step(&mut self, step: &Step) -> Result<(), Interrupt<R::Error>> {
        self.emit(Event::Step {
            step: step.index,
            of: self.plan.steps.len(),
            sweep: step.sweep,
            goal: step.pose(),
        });
        if step.lamp != self.lamp {
            self.switch_lamp(step.lamp).await?;
        }
        let mut retries = self.drive.retries();
        let measured = self.travel(step).await?;
        let fixed = fixed(step);
        let mut exposure = fixed.unwrap_or_else(|| self.ranging.first(step.sweep, step.pose()));
        let mut beside = None;
        for left in (0..MAX_EXPOSURES).rev() {
            let counts = self.expose(step, exposure).await?;
            let better = match fixed {
                None if left > 0 => self.ranging.better(&counts),
                _ => None,
            };
            let accepted = better.is_none();
            retries = self.rested(step, measured, counts, accepted, retries).await?;
            match better {
                Some(better) => exposure = better,
                None => {
                    beside = self.ranging.beside(&counts).filter(|_| fixed.is_none());
                    break;
                }
            }
        }
        if let Some(beside) = beside {
            let counts = self.expose(step, beside).await?;
            self.rested(step, measured, counts, false, retries).await?;
        }
        Ok(())
    }

    /// Exposes, and looks at the lamp.
    async fn expose(&mut self, step: &Step, exposure: Exposure) -> Result<Counts, Interrupt<R::Error>> {
        let counts = self.drive.expose(exposure).await?;
        if step.lamp {
            self.heed_lamp(&counts)?;
        }
        Ok(counts)
    }

    /// A reading of a step as it is first known: it does not count yet, and nothing is said against it.
    fn taken(&mut self, step: &Step, counts: Counts, measured: Pose) -> Reading {
        Reading {
            step: step.index,
            attempt: self.attempts[step.index],
            accepted: false,
            sweep: step.sweep,
            lamp: step.lamp,
            goal: step.pose(),
            measured,
            counts,
            device_ticks: self.clock.unwrap(counts.ticks),
            retries: 0,
            flags: Vec::new(),
            swept_rad: None,
        }
    }

    /// Records a reading of arms at rest, `retries` being the requests repeated before it; returns those after it.
    async fn rested(
        &mut self,
        step: &Step,
        measured: Pose,
        counts: Counts,
        accepted: bool,
        retries: u32,
    ) -> Result<u32, Interrupt<R::Error>> {
        let now = self.drive.retries();
        let mut reading = self.taken(step, counts, measured);
        reading.accepted = accepted;
        reading.retries = now - retries;
        reading.flags = self.flags(&reading);
        self.record(reading, step).await?;
        Ok(now)
    }

    /// Drives to a step's pose; from wherever the arms are where its own path does not lead on.
    async fn travel(&mut self, step: &Step) -> Result<Pose, Interrupt<R::Error>> {
        let measured = match self.standing {
            Some(_) => self.drive.travel(&step.path).await?.pose(),
            None => self.travel_anew(step.pose()).await?,
        };
        self.standing = Some(step.pose());
        Ok(measured)
    }

    /// Drives to a pose from wherever the arms are.
    async fn travel_anew(&mut self, to: Pose) -> Result<Pose, Interrupt<R::Error>> {
        let from = self.drive.snapshot().await?.pose();
        let mechanics = mechanics(self.file, Some(from));
        let path = sweep::way(&mechanics, from, to).map_err(Interrupt::Way)?;
        Ok(self.drive.travel(&path).await?.pose())
    }

    /// Whether the monitor saw no light: a photometer that restarted on its own has its lamp off, and says so nowhere.
    fn lamp_is_out(&self, counts: &Counts) -> bool {
        let nominal = self.file.calibration.monitor * f64::from(counts.exposure.integration_us);
        self.file.visits.lamp == Lamp::Monitor && f64::from(counts.monitor) < OUT * nominal
    }

    fn flags(&self, reading: &Reading) -> Vec<Flag> {
        let dim = reading.lamp && self.ranging.dim(&reading.counts);
        [
            (reading.counts.saturated, Flag::Saturated),
            (dim && !reading.counts.saturated, Flag::Dim),
            (reading.retries > 0, Flag::Retried),
        ]
        .into_iter()
        .filter_map(|(is, flag)| is.then_some(flag))
        .collect()
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

    /// Switches the lamp, and waits for steady light.
    async fn switch_lamp(&mut self, on: bool) -> Result<(), Interrupt<R::Error>> {
        self.drive.lamp(on).await?;
        self.lamp = on;
        match on {
            true => self.warm_up(self.file.photometer.lamp_warm_up).await,
            false => Ok(()),
        }
    }

    /// Waits until the lamp, which is on, gives steady light.
    async fn warm_up(&mut self, mut left: Duration) -> Result<(), Interrupt<R::Error>> {
        self.state(State::WarmingUp);
        while !left.is_zero() {
            self.obey().await?;
            let slice = left.min(self.look_every());
            self.drive.wait(slice).await?;
            left -= slice;
            self.look().await?;
        }
        self.mark = self.look().await?;
        self.progress.warm();
        self.state(State::Running);
        Ok(())
    }

    /// Does what the operator asked for since the last look; returns when the capture is to go on.
    async fn obey(&mut self) -> Result<(), Interrupt<R::Error>> {
        let mut paused = false;
        loop {
            let command = *self.control.borrow_and_update();
            match command {
                Command::Run => break,
                Command::Finish => return Err(Interrupt::Finish),
                Command::Stop => return Err(Interrupt::Stop),
                Command::Estop => return Err(Interrupt::Estop),
                Command::Pause => {}
            }
            if !paused {
                paused = true;
                self.state(State::Paused);
            }
            // The host's clock, since a simulator's runs ahead only when told to wait.
            let _ = tokio::time::timeout(self.look_every(), self.control.changed()).await;
            self.mark = self.look().await?;
        }
        if paused {
            self.state(State::Running);
        }
        Ok(())
    }

    /// Time between two looks at a rig that waits: three per watchdog time, since one may be late.
    fn look_every(&self) -> Duration {
        match self.file.motion.watchdog {
            Duration::ZERO => LOOK,
            watchdog => LOOK.min(watchdog / 3),
        }
    }

    /// Looks at every device, so that no watchdog trips, and at the photometer's clock, so that no wrap is missed.
    async fn look(&mut self) -> Result<u64, Interrupt<R::Error>> {
        self.drive.snapshot().await?;
        let ticks = self.drive.ticks().await?;
        Ok(self.clock.unwrap(ticks))
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

/// The exposure that a step must have, where it is not ranged.
fn fixed(step: &Step) -> Option<Exposure> {
    step.exposure.map(|(gain, integration_us)| Exposure {
        integration_us,
        gain: Gain::ALL[usize::from(gain).min(Gain::ALL.len() - 1)],
    })
}

fn readings(records: &[Record]) -> impl Iterator<Item = &Reading> {
    records.iter().filter_map(|record| match record {
        Record::Reading(reading) => Some(reading),
        _ => None,
    })
}

/// The reading that is measured again when a run goes on: the last one that is bright enough and not too bright.
fn reference(records: &[Record]) -> Option<&Reading> {
    let sound = |reading: &&Reading| {
        let poor = [Flag::Saturated, Flag::Dim];
        reading.accepted && reading.lamp && !reading.flags.iter().any(|flag| poor.contains(flag))
    };
    readings(records).filter(sound).last()
}

/// Relative difference of the channel that was brightest, each relative to the lamp monitor.
fn difference_rel(before: &Counts, after: &Counts) -> f64 {
    let brightest = (0..3).max_by_key(|&c| before.rgb[c]).unwrap_or(0);
    let level = |counts: &Counts| f64::from(counts.rgb[brightest]) / f64::from(counts.monitor.max(1));
    level(after) / level(before).max(f64::MIN_POSITIVE) - 1.0
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
