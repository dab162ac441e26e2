use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::pin::Pin;
use std::task::Poll;

use rig::{Drive, Fault, Rig};
use tokio::sync::watch;

use crate::execution::{Execution, Interrupt};
use crate::park::park;
use crate::{CaptureError, Command, Event, Extension, Journal, Outcome, Record, State, extended_plan};

/// Says what else is to be measured, from the records so far, once every step of the plan is done. It may take its
/// time: the rig is looked after meanwhile.
pub type Ask<'a> = dyn FnMut(&[Record]) -> Thinking + Send + 'a;

/// The answer in the making.
pub type Thinking = Pin<Box<dyn Future<Output = Extension> + Send>>;

/// Runs the plan in a journal's header on a rig, or goes on with it: steps that have an accepted reading are not
/// measured again.
///
/// First every device is asked who it is; nothing moves before that is as the rig file says, and on resuming as the
/// journal says. Then the steps in their order, each reading durable in the journal before the next motion starts.
/// Commands come over `control`; what happens is told to `on_event`. A [`Command::Finish`] ends it after the reading
/// in hand, a [`Command::Stop`] and a [`Command::Estop`] at once, each in its way.
///
/// On every way out, also when `on_event` panics, the lamp goes off, the arms stop and the watchdogs are disarmed,
/// and the journal says how it ended. After a run that is done, and no other, the arms then go to where they are parked, if the
/// rig file says so; anything that is asked for meanwhile stops them. Only a future that is dropped half-way cannot do that: then the bus falls
/// silent and the watchdogs of the devices stop the arms and put the lamp out, after the rig file's `watchdog_ms`.
///
/// A fault of the rig is an [`Outcome::Failed`], no error: the journal is sound and the run can be resumed.
///
/// # Errors
/// The journal has no header, or was made with other devices (nothing moved); it cannot be written any more.
///
/// # Panics
/// Where `on_event` does, after the rig is safe.
pub async fn run<R: Rig>(
    drive: &mut Drive<R>,
    journal: &mut dyn Journal,
    control: watch::Receiver<Command>,
    on_event: &mut (dyn FnMut(Event) + Send),
) -> Result<Outcome, CaptureError> {
    begin(drive, journal, control, on_event, None).await
}

/// As [`run`], but once every step is done `ask` says what else is to be measured, until it adds no more steps. Its
/// answers are in the journal, so that a resumed run goes on with them; a journal that holds its last word is not
/// asked about again.
///
/// # Errors
/// As [`run`].
///
/// # Panics
/// As [`run`].
pub async fn run_and_ask<R: Rig>(
    drive: &mut Drive<R>,
    journal: &mut dyn Journal,
    control: watch::Receiver<Command>,
    on_event: &mut (dyn FnMut(Event) + Send),
    ask: &mut Ask<'_>,
) -> Result<Outcome, CaptureError> {
    begin(drive, journal, control, on_event, Some(ask)).await
}

async fn begin<R: Rig>(
    drive: &mut Drive<R>,
    journal: &mut dyn Journal,
    control: watch::Receiver<Command>,
    on_event: &mut (dyn FnMut(Event) + Send),
    ask: Option<&mut Ask<'_>>,
) -> Result<Outcome, CaptureError> {
    let Some(plan) = extended_plan(journal.records()) else {
        return Err(CaptureError::NoHeader);
    };
    let file = drive.file().clone();
    let ask = ask.map(|ask| ask as &mut Ask<'_>);
    let parking = control.clone();
    let mut execution = Execution::new(plan, &file, drive, journal, control.clone(), on_event, ask);
    let result = guarded(async {
        let result = tokio::select! {
            biased;
            interrupt = at_once(control) => Err(interrupt),
            result = execution.all() => result,
        };
        execution.state(State::ShuttingDown);
        result
    })
    .await;
    match result {
        Ok(result) => {
            let outcome = execution.finish(result).await?;
            if outcome == Outcome::Done && file.motion.park_between {
                park(drive, parking, on_event).await;
            }
            Ok(outcome)
        }
        Err(panic) => {
            execution.abandon().await;
            resume_unwind(panic)
        }
    }
}

/// Returns once a stop or an emergency stop is asked for.
async fn at_once<E: Fault>(mut control: watch::Receiver<Command>) -> Interrupt<E> {
    let asked = control
        .wait_for(|command| matches!(command, Command::Stop | Command::Estop))
        .await
        .map(|command| *command);
    match asked {
        Ok(Command::Estop) => Interrupt::Estop,
        Ok(_) => Interrupt::Stop,
        // Nobody is left who could ask for it.
        Err(_) => std::future::pending().await,
    }
}

/// Polls a future to its end or its panic.
async fn guarded<T>(future: impl Future<Output = T>) -> std::thread::Result<T> {
    let mut future = std::pin::pin!(future);
    std::future::poll_fn(|context| {
        // After a panic the future is not polled again, and what it borrowed is used only to make the rig safe.
        match catch_unwind(AssertUnwindSafe(|| future.as_mut().poll(context))) {
            Ok(Poll::Pending) => Poll::Pending,
            Ok(Poll::Ready(value)) => Poll::Ready(Ok(value)),
            Err(panic) => Poll::Ready(Err(panic)),
        }
    })
    .await
}
