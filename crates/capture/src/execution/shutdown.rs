use rig::{DarkFault, Device, DriveError, FaultKind, Rig};
use sweep::SweepError;
use tokio::sync::watch;

use super::{Execution, now};
use crate::{CaptureError, Command, Event, JournalError, Outcome, Record};

const LAMP_OUT: &str =
    "the lamp is out although it was switched on: the photometer has restarted, or the lamp has failed";

/// Why an execution ends before its last step.
#[derive(Debug)]
pub(crate) enum Interrupt<E: rig::Fault> {
    /// At the end of a reading, the arms at rest.
    Finish,
    /// Anywhere, arms decelerating on their profiles.
    Stop,
    Estop,
    Fault(DriveError<E>),
    Way(SweepError),
    /// The lamp is out although it was switched on.
    Lamp,
    /// The dark readings cannot be believed.
    Dark(DarkFault),
    /// This computer slept, or the program was stopped, and what the watchdogs did then was seen; in words.
    StoodStill(String),
    Refused(CaptureError),
}

impl<E: rig::Fault> From<DriveError<E>> for Interrupt<E> {
    fn from(error: DriveError<E>) -> Self {
        Self::Fault(error)
    }
}

impl<E: rig::Fault> From<JournalError> for Interrupt<E> {
    fn from(error: JournalError) -> Self {
        Self::Refused(CaptureError::Journal(error))
    }
}

impl<R: Rig> Execution<'_, R> {
    /// Makes the rig safe and records how it ended.
    pub(crate) async fn finish(
        mut self,
        result: Result<(), Interrupt<R::Error>>,
    ) -> Result<Outcome, CaptureError> {
        let result = match result {
            Err(interrupt) => Err(self.explain(interrupt)),
            done => done,
        };
        match &result {
            Err(Interrupt::Fault(error)) => self.tell_fault(error.kind(), error.device(), chain(error)),
            Err(Interrupt::StoodStill(why)) => self.tell_fault(FaultKind::StoodStill, None, why.clone()),
            Err(Interrupt::Lamp) => {
                self.tell_fault(FaultKind::Hardware, Some(Device::Photometer), LAMP_OUT.to_owned());
            }
            Err(Interrupt::Dark(fault)) => {
                self.tell_fault(FaultKind::Light, Some(Device::Photometer), fault.to_string());
            }
            Err(Interrupt::Way(error)) => self.tell_fault(FaultKind::Refused, None, chain(error)),
            _ => {}
        }
        let at_rest = matches!(result, Ok(()) | Err(Interrupt::Finish));
        let mut unsafe_left = match result {
            _ if !self.touched => Vec::new(),
            _ if at_rest => self.drive.disengage_all().await,
            Err(Interrupt::Estop) => self.make_safe(true).await,
            _ => self.make_safe(false).await,
        };
        self.emit(Event::Safe);
        // An emergency stop that comes while it shuts down is one all the same.
        let mut halted = matches!(result, Err(Interrupt::Estop));
        let late = !halted && *self.control.borrow() == Command::Estop;
        if late {
            unsafe_left.extend(self.make_safe(true).await);
            halted = true;
        }
        let result = match result {
            Ok(()) | Err(Interrupt::Finish | Interrupt::Stop) if late => Err(Interrupt::Estop),
            result => result,
        };
        for error in &unsafe_left {
            tracing::warn!("while shutting down: {}", chain(error));
        }
        let mut outcome = match result {
            Ok(()) => Outcome::Done,
            Err(Interrupt::Finish | Interrupt::Stop) => Outcome::Stopped,
            Err(Interrupt::Estop) => Outcome::Failed {
                fault: "emergency stop".to_owned(),
            },
            Err(Interrupt::Fault(fault)) => Outcome::Failed { fault: chain(&fault) },
            Err(Interrupt::Way(error)) => Outcome::Failed { fault: chain(&error) },
            Err(Interrupt::Dark(fault)) => Outcome::Failed {
                fault: fault.to_string(),
            },
            Err(Interrupt::StoodStill(fault)) => Outcome::Failed { fault },
            Err(Interrupt::Lamp) => Outcome::Failed {
                fault: LAMP_OUT.to_owned(),
            },
            Err(Interrupt::Refused(error)) => return Err(error),
        };
        // A fault or an emergency stop is worse news than what went wrong after it.
        let stopping = matches!(outcome, Outcome::Done | Outcome::Stopped);
        if let (true, Some(error)) = (stopping, unsafe_left.first()) {
            let fault = format!("could not shut down: {}", chain(error));
            self.tell_fault(error.kind(), error.device(), fault.clone());
            outcome = Outcome::Failed { fault };
        }
        let device_ticks = match self.touched && unsafe_left.is_empty() {
            true => self.drive.ticks().await.ok(),
            false => None,
        };
        let device_ticks = device_ticks.map(|ticks| self.clock.unwrap(ticks));
        // What a flight saw that did not land counts for nothing, and is kept.
        for reading in std::mem::take(&mut self.aloft) {
            self.append_at_rest(&Record::Reading(reading), &mut halted)
                .await?;
        }
        let end = Record::End {
            outcome: outcome.clone(),
            device_ticks,
            at: now(),
        };
        self.append_at_rest(&end, &mut halted).await?;
        Ok(outcome)
    }

    /// Makes a record durable once the rig is safe. However long that takes, an emergency stop is carried out meanwhile,
    /// unless the arms were `halted` by one before.
    async fn append_at_rest(&mut self, record: &Record, halted: &mut bool) -> Result<(), JournalError> {
        let mut control = self.control.clone();
        let mut append = self.journal.append(record);
        loop {
            tokio::select! {
                biased;
                result = &mut append => return result,
                () = emergency_stop(&mut control), if !*halted => {
                    *halted = true;
                    if self.touched {
                        for error in self.drive.make_safe(true).await {
                            tracing::warn!("while stopping: {}", chain(&error));
                        }
                    }
                }
            }
        }
    }

    /// What looks like a fault of a device, and is what the watchdogs do while nobody speaks to them, is told as that.
    fn explain(&self, interrupt: Interrupt<R::Error>) -> Interrupt<R::Error> {
        let Some(gap) = self.drive.stood_still() else {
            return interrupt;
        };
        let seen = match &interrupt {
            Interrupt::Lamp => LAMP_OUT.to_owned(),
            Interrupt::Fault(error) if matches!(error.kind(), FaultKind::Motion | FaultKind::Refused) => {
                chain(error)
            }
            _ => return interrupt,
        };
        Interrupt::StoodStill(format!(
            "this computer or program stood still for {:.1} s (sleep, Ctrl-Z, or its clock was set), longer than \
             motion.watchdog_ms: the arms were stopped and the lamp was put out by their watchdogs, as they should be \
             (seen as: {seen})",
            gap.as_secs_f64()
        ))
    }

    fn tell_fault(&mut self, kind: FaultKind, device: Option<Device>, fault: String) {
        self.emit(Event::Fault { kind, device, fault });
    }

    /// Makes the rig safe after a panic; the journal is left as it is.
    pub(crate) async fn abandon(mut self) {
        for error in self.make_safe(false).await {
            tracing::warn!("while shutting down: {}", chain(&error));
        }
    }

    /// Stops the arms, on their profiles or at once, lamp off, and lets go of them. An emergency stop that comes while
    /// they are told to brake is not kept waiting by a device that is silent.
    async fn make_safe(&mut self, at_once: bool) -> Vec<DriveError<R::Error>> {
        if !self.touched {
            return Vec::new();
        }
        let mut control = self.control.clone();
        if !at_once {
            tokio::select! {
                biased;
                failed = self.drive.make_safe(false) => return failed,
                () = emergency_stop(&mut control) => {}
            }
        }
        self.drive.make_safe(true).await
    }
}

/// Returns once the emergency stop is asked for.
async fn emergency_stop(control: &mut watch::Receiver<Command>) {
    let pressed = control
        .wait_for(|command| *command == Command::Estop)
        .await
        .is_ok();
    if !pressed {
        // Nobody is left who could ask.
        std::future::pending::<()>().await;
    }
}

/// An error with its causes.
pub(crate) fn chain(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |error| error.source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}
