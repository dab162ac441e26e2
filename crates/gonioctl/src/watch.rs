use std::process::ExitCode;
use std::time::Duration;

use api::client::{Message, Stream};
use api::{Client, ClientError, FaultCode, Job, JobId, JobState, VerdictView, What};
use session::Status;

use crate::exit;
use crate::screen::Screen;

/// Between two attempts to reach a daemon that was lost.
const PAUSE: Duration = Duration::from_secs(1);

/// Shows live what happens; of one job until it ends, else until it is interrupted. A daemon that is lost is looked
/// for until it is back, and the events go on where they were.
///
/// # Errors
/// The daemon does not answer from the first, or refuses.
pub(crate) fn watch(daemon: &Client, job: Option<JobId>, as_json: bool) -> anyhow::Result<ExitCode> {
    let mut watcher = Watcher::new(daemon, job, as_json);
    let mut stream = daemon.events(None)?;
    watcher.screen.say("watching");
    let (_, status) = watcher.until_end(&mut stream)?;
    Ok(exit::code(status))
}

/// Shows one job until it has ended, and how a command that ran it ends.
///
/// # Errors
/// As [`watch`].
pub(crate) fn until_ended(daemon: &Client, job: JobId) -> Result<(Job, Status), ClientError> {
    let mut stream = daemon.events(None)?;
    Watcher::new(daemon, Some(job), false).until_end(&mut stream)
}

struct Watcher<'a> {
    daemon: &'a Client,
    job: Option<JobId>,
    /// Id of the event that was seen last.
    last: Option<u64>,
    screen: Screen,
}

impl<'a> Watcher<'a> {
    fn new(daemon: &'a Client, job: Option<JobId>, as_json: bool) -> Self {
        Self {
            daemon,
            job,
            last: None,
            screen: Screen::new(as_json),
        }
    }

    /// Shows events until the job has ended; for ever where there is none.
    fn until_end(&mut self, stream: &mut Stream) -> Result<(Job, Status), ClientError> {
        loop {
            match self.follow(stream) {
                Ok(Some(job)) => {
                    self.screen.finish();
                    let status = self.status(&job)?;
                    return Ok((job, status));
                }
                Ok(None) | Err(ClientError::Unreachable { .. }) => {}
                Err(error) => return Err(error),
            }
            self.screen.say("lost the daemon; looking for it");
            *stream = self.again()?;
            self.screen.say("the daemon is back");
        }
    }

    /// Shows events until the job has ended, which is returned, or the stream has.
    fn follow(&mut self, stream: &mut Stream) -> Result<Option<Job>, ClientError> {
        if let Some(id) = self.job {
            // It may have ended before the stream began.
            let job = self.daemon.job(id)?;
            self.screen.job(&job);
            if ended(job.state) {
                return Ok(Some(job));
            }
        }
        // A broken stream is a lost daemon, like one that ended.
        while let Ok(Some(told)) = stream.next() {
            self.last = told.id.or(self.last);
            let message = told.message();
            self.screen.show(&told, &message);
            let Message::Event(event) = message else {
                continue;
            };
            match event.what {
                What::Job { job } if Some(job.id) == self.job && ended(job.state) => {
                    return Ok(Some(*job));
                }
                _ => {}
            }
        }
        Ok(None)
    }

    /// The stream, once the daemon answers again.
    fn again(&self) -> Result<Stream, ClientError> {
        loop {
            match self.daemon.events(self.last) {
                Err(ClientError::Unreachable { .. }) => std::thread::sleep(PAUSE),
                other => return other,
            }
        }
    }

    /// How the command ends when its job has.
    fn status(&self, job: &Job) -> Result<Status, ClientError> {
        Ok(match job.state {
            JobState::Done if job.verdict == Some(VerdictView::Bad) => Status::Unusable,
            JobState::Done => Status::Done,
            JobState::Failed => Status::Invalid,
            JobState::Interrupted => match self.daemon.rig()?.fault.map(|fault| fault.code) {
                None | Some(FaultCode::DiskFull) => Status::Stopped,
                Some(_) => Status::Rig,
            },
            _ => Status::Stopped,
        })
    }
}

/// Whether nothing more happens to a job by itself.
fn ended(state: JobState) -> bool {
    state.over() || state == JobState::Interrupted
}
