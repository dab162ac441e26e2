//! Instruments that speak SCPI: picoammeters, multimeters, power meters.

mod link;
mod profile;
mod transport;

use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::Instant;

pub(crate) use profile::PROFILES;
pub use profile::Profile;

use crate::dynamixel::Photometer;
use crate::file::{DetectorSettings, LampControl};
use crate::{Counts, Detector, DetectorStatus, Exposure, Identity, Phase, RigError, RigFile};
use link::{Answer, Link, Task};

/// Counts that stand for a reading of zero: noise below zero must not be cut off, and dark readings take them off again.
const ZERO_COUNTS: f64 = 64.0;
/// What an instrument says where its range is exceeded: 9.9E37, with either sign (SCPI-99, "Infinity").
const OVERFLOW: std::ops::Range<f64> = 9.89e37..9.905e37;
/// What it says where there is no number: 9.91E37 (SCPI-99, "Not a number").
const NOT_A_NUMBER: f64 = 9.905e37;
/// Longest wait for an answer that is due, before the arms are looked at again.
const PATIENCE: Duration = Duration::from_millis(100);
/// Ticks have 24 bits, as those of the node.
const TICKS_MODULUS: u128 = 1 << 24;
const TICK_US: u128 = 10;

/// An instrument that speaks SCPI, in the place of the photometer node.
///
/// Its reading has a unit and does not grow with time. Counts are made of it as a node would count: `full_reading` for the
/// shortest integration at gain ×1 is full scale, and longer integrations and higher gains reach it with less. For each
/// exposure it is told the range that this needs, so that the three gain steps are ranges, and no gain of its own is
/// unsure. The light of one photodiode is written to all three channels.
#[derive(Debug)]
pub struct Scpi {
    link: Link,
    settings: DetectorSettings,
    full_scale: u32,
    shortest_us: u32,
    /// The node that switches the lamp, where that is on the bus.
    pub(crate) node: Option<Photometer>,
    lit: bool,
    sequence: u32,
    taking: Option<Taking>,
    latest: Option<Counts>,
    opened: Instant,
    /// How much time a simulated rig let pass; `None` on a real one.
    simulated: Option<Duration>,
}

/// A reading on its way.
#[derive(Debug)]
struct Taking {
    exposure: Exposure,
    begun: u32,
    answer: oneshot::Receiver<Answer>,
    /// Why it failed: said until the next trigger.
    failed: Option<String>,
}

impl Scpi {
    /// Prepares the instrument of a rig file at an address; sends nothing, and connects to nothing yet.
    ///
    /// # Errors
    /// No thread can be started.
    pub(crate) fn new(file: &RigFile, node: Option<Photometer>, simulated: bool) -> Result<Self, RigError> {
        Ok(Self {
            link: Link::start(&file.detector)?,
            settings: file.detector.clone(),
            full_scale: file.photometer.full_scale,
            shortest_us: file.photometer.integration_min_us,
            node,
            lit: false,
            sequence: 0,
            taking: None,
            latest: None,
            opened: Instant::now(),
            simulated: simulated.then_some(Duration::ZERO),
        })
    }

    /// Tells of time that a simulated rig lets pass.
    pub(crate) fn pass(&mut self, duration: Duration) {
        if let Some(passed) = &mut self.simulated {
            *passed += duration;
        }
    }

    /// The detector's state, from what is known of it: nothing is asked.
    pub(crate) fn known(&self) -> DetectorStatus {
        let phase = match (&self.taking, self.latest) {
            (Some(_), _) => Phase::Integrating,
            (None, None) => Phase::Idle,
            (None, Some(counts)) if counts.saturated => Phase::Saturated,
            (None, Some(_)) => Phase::Ready,
        };
        DetectorStatus {
            phase,
            sequence: self.sequence,
        }
    }

    /// Time since it was opened, in ticks of 10 µs, 24 bits.
    pub(crate) fn now(&self) -> u32 {
        let passed = self.simulated.unwrap_or_else(|| self.opened.elapsed());
        (passed.as_micros() / TICK_US % TICKS_MODULUS) as u32
    }

    /// Full reading of an exposure, in the unit of the instrument: the range that it needs.
    fn range(&self, exposure: Exposure) -> f64 {
        let longer = f64::from(exposure.integration_us) / f64::from(self.shortest_us);
        self.settings.full_reading / (longer * exposure.gain.factor())
    }

    /// Counts of an answer.
    fn count(&self, answer: &str, exposure: Exposure) -> Result<(u32, bool), String> {
        let field = answer.split(',').next().unwrap_or_default().trim();
        // "+1.2345E-09A": some say the unit too.
        let number = field.trim_end_matches(|c: char| c.is_ascii_alphabetic());
        let reading: f64 = number
            .parse()
            .map_err(|_| format!("it answered {answer:?}, which is no number"))?;
        if OVERFLOW.contains(&reading.abs()) || reading.is_infinite() {
            return Ok((self.full_scale, true));
        }
        if reading.is_nan() || reading.abs() >= NOT_A_NUMBER {
            return Err(format!(
                "it answered {answer:?}, which stands for \"not a number\": check what it measures"
            ));
        }
        let full = f64::from(self.full_scale);
        let counts = (ZERO_COUNTS + reading / self.range(exposure) * full).round();
        Ok((counts.clamp(0.0, full) as u32, counts >= full))
    }

    fn keep(&mut self, counted: (u32, bool), exposure: Exposure, ticks: u32) {
        let (counts, saturated) = counted;
        self.latest = Some(Counts {
            rgb: [counts; 3],
            monitor: 0,
            exposure,
            saturated,
            sequence: self.sequence,
            ticks,
            temperature_c: 0,
        });
    }

    fn trouble(&self, what: String) -> RigError {
        RigError::Instrument {
            address: self.settings.address.clone(),
            answered: false,
            what,
        }
    }

    /// One task, to its end.
    async fn carry_out(&self, task: Task) -> Result<String, RigError> {
        let address = self.settings.address.clone();
        let answer = self.link.ask(task).await.unwrap_or_else(|_| Err(link::ended()));
        answer.map_err(|failure| failure.at(address))
    }

    /// Looks whether the reading on its way has come.
    async fn collect(&mut self) -> Result<(), RigError> {
        let now = self.now();
        let Some(taking) = &mut self.taking else {
            return Ok(());
        };
        if let Some(why) = &taking.failed {
            let why = why.clone();
            return Err(self.trouble(why));
        }
        let passed = u128::from(now.wrapping_sub(taking.begun)) % TICKS_MODULUS * TICK_US;
        let due = passed >= u128::from(taking.exposure.integration_us);
        let answer = match due {
            true => tokio::time::timeout(PATIENCE, &mut taking.answer).await.ok(),
            false => match taking.answer.try_recv() {
                Ok(answer) => Some(Ok(answer)),
                Err(oneshot::error::TryRecvError::Empty) => None,
                Err(oneshot::error::TryRecvError::Closed) => Some(Ok(Err(link::ended()))),
            },
        };
        let (exposure, begun) = (taking.exposure, taking.begun);
        let Some(answer) = answer else {
            return Ok(());
        };
        let address = self.settings.address.clone();
        let counted = match answer.unwrap_or_else(|_| Err(link::ended())) {
            Ok(text) => self.count(&text, exposure).map_err(|what| RigError::Instrument {
                address,
                answered: true,
                what,
            }),
            Err(failure) => Err(failure.at(address)),
        };
        match counted {
            Ok(counted) => {
                self.taking = None;
                let half = u128::from(exposure.integration_us) / TICK_US / 2;
                let middle = (u128::from(begun) + half) % TICKS_MODULUS;
                self.keep(counted, exposure, middle as u32);
                Ok(())
            }
            Err(error) => {
                if let (Some(taking), RigError::Instrument { what, .. }) = (&mut self.taking, &error) {
                    taking.failed = Some(what.clone());
                }
                Err(error)
            }
        }
    }
}

impl Detector for Scpi {
    type Error = RigError;

    async fn identify(&mut self) -> Result<Identity, RigError> {
        self.taking = None;
        let answer = self.carry_out(Task::Identify).await?;
        let wanted = self.settings.profile.identity;
        if !wanted.is_empty() && !wanted.iter().any(|model| answer.contains(model)) {
            return Err(RigError::Instrument {
                address: self.settings.address.clone(),
                answered: true,
                what: format!(
                    "it says that it is {answer:?}; the profile \"{}\" is for {}: correct detector.profile or \
                     detector.address",
                    self.settings.profile.name,
                    wanted.join(", "),
                ),
            });
        }
        if let Some(node) = &mut self.node {
            node.identify().await?;
        }
        Ok(Identity {
            id: 0,
            model: answer,
            firmware: 0,
        })
    }

    async fn lamp(&mut self, on: bool) -> Result<(), RigError> {
        match self.settings.lamp {
            LampControl::Node => {
                if let Some(node) = &mut self.node {
                    node.lamp(on).await?;
                }
            }
            LampControl::Scpi => {
                let commands = match on {
                    true => &self.settings.lamp_on,
                    false => &self.settings.lamp_off,
                };
                self.carry_out(Task::Tell(commands.clone())).await?;
            }
            LampControl::Always => {}
        }
        self.lit = on;
        Ok(())
    }

    async fn trigger(&mut self, exposure: Exposure) -> Result<(), RigError> {
        self.latest = None;
        self.sequence = (self.sequence + 1) % TICKS_MODULUS as u32;
        if self.settings.lamp == LampControl::Always && !self.lit {
            // Nothing puts the lamp out: the instrument's zero is taken for the dark.
            let now = self.now();
            self.taking = None;
            self.keep((ZERO_COUNTS as u32, false), exposure, now);
            return Ok(());
        }
        let begun = self.now();
        let task = Task::Measure {
            configure: self.settings.configure(self.range(exposure), exposure.duration()),
            integration: exposure.duration(),
        };
        self.taking = Some(Taking {
            exposure,
            begun,
            answer: self.link.begin(task),
            failed: None,
        });
        Ok(())
    }

    async fn status(&mut self) -> Result<DetectorStatus, RigError> {
        Ok(self.known())
    }

    async fn counts(&mut self) -> Result<Option<Counts>, RigError> {
        self.collect().await?;
        Ok(self.latest)
    }

    async fn ticks(&mut self) -> Result<u32, RigError> {
        Ok(self.now())
    }
}
