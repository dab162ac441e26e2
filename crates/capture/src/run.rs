use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::task::Poll;

use rig::{Drive, Rig};
use tokio::sync::watch;

use crate::execution::{Execution, Interrupt};
use crate::{CaptureError, Command, Event, Journal, Outcome, Record, State};

/// Runs the plan in a journal's header on a rig, or goes on with it: steps that have an accepted reading are not
/// measured again.
///
/// First every device is asked who it is; nothing moves before that is as the rig file says, and on resuming as the
/// journal says. Then the steps in their order, each reading durable in the journal before the next motion starts.
/// Commands come over `control`; what happens is told to `on_event`. A [`Command::Stop`] ends it after the reading
/// in hand, a [`Command::Estop`] at once.
///
/// On every way out, also when `on_event` panics, the lamp goes off, the arms stop and the watchdogs are disarmed,
/// and the journal says how it ended. Only a future that is dropped half-way cannot do that: then the bus falls
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
    let Some(Record::Header(header)) = journal.records().first() else {
        return Err(CaptureError::NoHeader);
    };
    let plan = header.plan.clone();
    let file = drive.file().clone();
    let mut execution = Execution::new(&plan, &file, drive, journal, control.clone(), on_event);
    let result = guarded(async {
        let result = tokio::select! {
            biased;
            () = estop(control) => Err(Interrupt::Estop),
            result = execution.all() => result,
        };
        execution.state(State::ShuttingDown);
        result
    })
    .await;
    match result {
        Ok(result) => execution.finish(result).await,
        Err(panic) => {
            execution.abandon().await;
            resume_unwind(panic)
        }
    }
}

/// Returns once an emergency stop is asked for.
async fn estop(mut control: watch::Receiver<Command>) {
    if control
        .wait_for(|&command| command == Command::Estop)
        .await
        .is_err()
    {
        // Nobody is left who could ask for it.
        std::future::pending::<()>().await;
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
