use rig::{Drive, DriveError, Fault, Rig};
use tokio::sync::watch;

use crate::execution::chain;
use crate::{Command, Event, State, mechanics};

/// Why arms that were to be parked are not.
enum Hindered<E: Fault> {
    /// No way leads there.
    Way(sweep::SweepError),
    /// Something went wrong on the way.
    Fault(DriveError<E>),
}

impl<E: Fault> From<DriveError<E>> for Hindered<E> {
    fn from(error: DriveError<E>) -> Self {
        Self::Fault(error)
    }
}

/// Takes both arms to where the rig file parks them, at the end of a run that is done and recorded; lamp as it is. They
/// stop as soon as anything else is asked for, or where it was asked for before they set off. Whatever comes of it, the run
/// is done: a fault is told as one.
pub(crate) async fn park<R: Rig>(
    drive: &mut Drive<R>,
    mut control: watch::Receiver<Command>,
    on_event: &mut (dyn FnMut(Event) + Send),
) {
    on_event(Event::State {
        state: State::Parking,
    });
    let file = drive.file().clone();
    let driven = async {
        let from = file.admitted(drive.snapshot().await?.pose());
        let way = sweep::way(&mechanics(&file, Some(from)), from, file.motion.park);
        let path = way.map_err(Hindered::Way)?;
        drive.engage_all().await?;
        drive.travel(&path).await?;
        Ok::<(), Hindered<R::Error>>(())
    };
    let left = tokio::select! {
        biased;
        asked = anything_else(&mut control) => drive.make_safe(asked == Command::Estop).await,
        result = driven => match result {
            Ok(()) => drive.disengage_all().await,
            Err(hindered) => {
                tell(&hindered, on_event);
                drive.make_safe(false).await
            }
        },
    };
    for error in left {
        tracing::warn!("while parking the arms: {}", chain(&error));
    }
    on_event(Event::Safe);
}

/// Returns once something else is asked for than to go on.
async fn anything_else(control: &mut watch::Receiver<Command>) -> Command {
    let asked = control.wait_for(|command| *command != Command::Run).await;
    match asked.map(|command| *command) {
        Ok(command) => command,
        // Nobody is left who could ask.
        Err(_) => std::future::pending().await,
    }
}

fn tell<E: Fault>(hindered: &Hindered<E>, on_event: &mut (dyn FnMut(Event) + Send)) {
    match hindered {
        Hindered::Way(error) => tracing::warn!("the arms are not parked: {}", chain(error)),
        Hindered::Fault(error) => on_event(Event::Fault {
            kind: error.kind(),
            device: error.device(),
            fault: format!("while parking the arms after the run: {}", chain(error)),
        }),
    }
}
