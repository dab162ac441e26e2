//! Tells somebody elsewhere what wants them: a webhook.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use api::client::{PostError, post_json};
use serde::{Deserialize, Serialize};

use crate::refusal::chain;
use crate::{Daemon, Event, FaultView, Job, JobId, JobState, VerdictView, What};

/// Waits before each further try, s: more than an hour together, as long as a server may be restarted in.
const WAITS_S: [u64; 7] = [1, 5, 30, 120, 300, 900, 2700];
/// How long one try may take.
const TIMEOUT: Duration = Duration::from_secs(15);

/// Why a notify file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NotifyError {
    /// It cannot be read.
    #[error("cannot read the notify file {}", .path.display())]
    Read {
        /// Where.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It does not say what it should.
    #[error("notify file {}: {why}", .path.display())]
    Text {
        /// Where.
        path: PathBuf,
        /// What is wrong in it, and what is allowed.
        why: String,
    },
}

/// What somebody is told of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Occasion {
    /// A specimen is wanted on the stage.
    SpecimenWanted,
    /// A job is done.
    Done,
    /// A job is done, and came to the error that it was to come to.
    TargetReached,
    /// A fault was latched.
    Fault,
}

/// The file with the `[notify]` table.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFile {
    notify: Webhook,
}

/// The `[notify]` table: where messages are posted to, and which.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Webhook {
    /// Where they are posted to.
    url: String,
    /// Of what; of everything unless said.
    #[serde(default = "Webhook::everything")]
    events: Vec<Occasion>,
    /// Headers that each has.
    #[serde(default)]
    headers: BTreeMap<String, String>,
    /// Keys that each has beside its own.
    #[serde(default)]
    extra: serde_json::Map<String, serde_json::Value>,
}

/// A message.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Message {
    /// What happened.
    pub event: Occasion,
    /// It in a few words.
    pub title: String,
    /// It in a sentence, with what is wanted next.
    pub message: String,
    /// When, RFC 3339, UTC.
    pub at: String,
    /// What the rig is called; empty where its file does not say.
    pub rig: String,
    /// The job, where it is about one.
    pub job: Option<JobId>,
    /// The run, where there is one.
    pub run: Option<String>,
    /// What lies, or is to lie, on the stage.
    pub specimen: Option<String>,
    /// What the checks said of a run's result.
    pub verdict: Option<VerdictView>,
}

impl Webhook {
    fn everything() -> Vec<Occasion> {
        vec![
            Occasion::SpecimenWanted,
            Occasion::Done,
            Occasion::TargetReached,
            Occasion::Fault,
        ]
    }

    /// Reads a notify file. A file that is missing says that nobody is told.
    ///
    /// # Errors
    /// It cannot be read, or does not say what it should.
    pub fn read(path: &Path) -> Result<Option<Self>, NotifyError> {
        let text = match config::read_text(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(source) => {
                return Err(NotifyError::Read {
                    path: path.to_owned(),
                    source,
                });
            }
        };
        Self::parse(&text).map(Some).map_err(|why| NotifyError::Text {
            path: path.to_owned(),
            why,
        })
    }

    /// Reads the text of a notify file.
    ///
    /// # Errors
    /// In words, what is wrong and what is allowed.
    fn parse(text: &str) -> Result<Self, String> {
        let RawFile { notify } = config::parse(text).map_err(|flaws| flaws.to_string())?;
        let is_url = ["http://", "https://"].iter().any(|scheme| {
            notify
                .url
                .strip_prefix(scheme)
                .is_some_and(|rest| !rest.is_empty())
        });
        if !is_url || notify.url.chars().any(|c| c.is_whitespace() || c.is_control()) {
            return Err(format!(
                "notify.url is {:?}, allowed is an address that begins with http:// or https://",
                notify.url
            ));
        }
        for (name, value) in &notify.headers {
            let token = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            if name.is_empty() || !name.chars().all(token) || value.chars().any(char::is_control) {
                return Err(format!("notify.headers.{name} is no header of one line"));
            }
        }
        Ok(notify)
    }

    /// Posts what happens until the daemon ends, each message until it is taken or was tried often enough.
    pub(crate) async fn run(self, daemon: Daemon) {
        let mut events = daemon.events(None);
        while let Some(event) = events.next().await {
            let Some(message) = Message::of(&daemon, &event).await else {
                continue;
            };
            if self.events.contains(&message.event) {
                // A message that must be tried again does not hold up the next.
                tokio::spawn(self.clone().deliver(daemon.clone(), message));
            }
        }
    }

    async fn deliver(self, daemon: Daemon, message: Message) {
        let body = self.body(&message);
        let post = || {
            let (hook, body) = (self.clone(), body.clone());
            let posted = move || post_json(&hook.url, &hook.headers, &body, TIMEOUT);
            tokio::task::spawn_blocking(posted)
        };
        if let Err(why) = try_again(post).await {
            daemon
                .shared()
                .warn(format!("nobody was told “{}”: {why}", message.title));
        }
    }

    /// A message as it is posted.
    fn body(&self, message: &Message) -> serde_json::Value {
        let mut body = serde_json::to_value(message).expect("our own type has string keys only");
        if let Some(keys) = body.as_object_mut() {
            keys.extend(self.extra.clone());
        }
        body
    }
}

/// Tries something until it is taken, is refused for good, or was tried often enough.
async fn try_again<E, F>(mut post: impl FnMut() -> F) -> Result<(), String>
where
    E: std::fmt::Display,
    F: Future<Output = Result<Result<(), PostError>, E>>,
{
    let mut waits = WAITS_S.iter();
    loop {
        match post().await {
            Ok(Ok(())) => return Ok(()),
            Ok(Err(error)) if error.may_pass() => match waits.next() {
                Some(&wait_s) => tokio::time::sleep(Duration::from_secs(wait_s)).await,
                None => return Err(chain(&error)),
            },
            Ok(Err(error)) => return Err(chain(&error)),
            Err(error) => return Err(error.to_string()),
        }
    }
}

impl Message {
    /// What somebody is told of an event; `None` where it wants nobody.
    async fn of(daemon: &Daemon, event: &Event) -> Option<Self> {
        let rig = &daemon.shared().rig.about.name;
        match &event.what {
            What::Fault { fault } => Some(Self::fault(fault, &event.at, rig)),
            What::Job { job } if job.state == JobState::AwaitingSpecimen => {
                let text = format!("Put “{}” on the stage, then say that it lies there.", named(job));
                Some(Self::job(job, Occasion::SpecimenWanted, text, &event.at, rig))
            }
            What::Job { job } if job.state == JobState::Done => {
                let reached = match &job.run {
                    Some(run) => reached(daemon, job, run).await,
                    None => None,
                };
                let verdict = match job.verdict {
                    Some(VerdictView::Bad) => " It was measured but is not usable: its report says why.",
                    Some(VerdictView::Look) => " Its checks found something to look at.",
                    _ => "",
                };
                let (occasion, text) = match reached {
                    Some(male) => (
                        Occasion::TargetReached,
                        format!(
                            "“{}” is done: an error (MALE) of {male:.5} is expected.{verdict}",
                            named(job)
                        ),
                    ),
                    None => (Occasion::Done, format!("“{}” is done.{verdict}", named(job))),
                };
                Some(Self::job(job, occasion, text, &event.at, rig))
            }
            _ => None,
        }
    }

    fn job(job: &Job, event: Occasion, message: String, at: &str, rig: &str) -> Self {
        let title = match event {
            Occasion::SpecimenWanted => "Specimen wanted",
            Occasion::TargetReached => "Target reached",
            _ => "Done",
        };
        Self {
            event,
            title: format!("{title}: {}", named(job)),
            message,
            at: at.to_owned(),
            rig: rig.to_owned(),
            job: Some(job.id),
            run: job.run.clone(),
            specimen: Some(job.specimen.clone()),
            verdict: job.verdict,
        }
    }

    fn fault(fault: &FaultView, at: &str, rig: &str) -> Self {
        let remedy = fault.remedy.as_deref().unwrap_or_default();
        Self {
            event: Occasion::Fault,
            title: format!("Fault: {}", fault.code.to_string().replace('_', " ")),
            message: format!("{}. {remedy}", fault.text).trim_end().to_owned(),
            at: at.to_owned(),
            rig: rig.to_owned(),
            job: None,
            run: fault.run.clone(),
            specimen: None,
            verdict: None,
        }
    }
}

/// What a job is called: its specimen, else its file.
fn named(job: &Job) -> &str {
    match job.specimen.as_str() {
        "" => &job.name,
        specimen => specimen,
    }
}

/// The error that a run is expected to have, where its job names a target and it came to it.
async fn reached(daemon: &Daemon, job: &Job, run: &str) -> Option<f64> {
    let target = sweep::Job::parse(&job.text, &job.name).ok()?.until?.target_male?;
    let records = daemon.shared().store.records(run).await.ok()?;
    let expected = report::Adapted::new(&records)?.expected_male?;
    (expected <= target).then_some(expected)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::io::{BufRead, BufReader, Read, Write};
    use std::net::TcpListener;

    use super::*;

    const FILE: &str = "[notify]\nurl = \"https://ntfy.sh/\"\nevents = [\"fault\"]\n\
                        headers = { Authorization = \"Bearer x\" }\nextra = { topic = \"rig\" }\n";

    fn fault() -> Message {
        let fault = FaultView {
            id: "F".to_owned().into(),
            code: crate::FaultCode::NoReply,
            text: "the light servo gives no reply".to_owned(),
            remedy: Some("Check its power.".to_owned()),
            at: "then".to_owned(),
            run: None,
        };
        Message::fault(&fault, "then", "North")
    }

    #[test]
    fn a_message_has_what_the_file_adds_and_says_what_to_do() {
        let hook = Webhook::parse(FILE).unwrap();
        let body = hook.body(&fault());
        assert_eq!((&body["topic"], &body["event"]), (&"rig".into(), &"fault".into()));
        assert_eq!(body["title"], "Fault: no reply");
        assert_eq!(
            body["message"],
            "the light servo gives no reply. Check its power."
        );
        assert_eq!(body["rig"], "North");
    }

    #[test]
    fn what_is_wrong_in_a_notify_file_is_told() {
        for (text, part) in [
            ("[notify]\nurl = \"ntfy.sh\"", "http:// or https://"),
            ("[notify]\nurl = \"https://\"", "http:// or https://"),
            ("[notify]\nurl = \"https://a b\"", "http:// or https://"),
            ("[notify]\nevents = []", "url"),
            (
                "[notify]\nurl = \"https://a\"\nevents = [\"lunch\"]",
                "specimen_wanted",
            ),
            (
                "[notify]\nurl = \"https://a\"\nheaders = { \"a b\" = \"c\" }",
                "headers",
            ),
            ("[notify]\nurls = \"https://a\"", "urls"),
            ("", "notify"),
        ] {
            let why = Webhook::parse(text).unwrap_err();
            assert!(why.contains(part), "{text}: {why}");
        }
        assert!(
            Webhook::read(Path::new("/nowhere/notify.toml"))
                .unwrap()
                .is_none()
        );
    }

    #[tokio::test(start_paused = true)]
    async fn a_message_is_tried_again_where_it_may_pass_and_only_there() {
        let refused = |status| PostError::Refused {
            address: "a".to_owned(),
            status,
            said: "no".to_owned(),
        };
        for (status, tries) in [(503, 1 + WAITS_S.len()), (429, 1 + WAITS_S.len()), (404, 1)] {
            let count = Cell::new(0);
            let begun = tokio::time::Instant::now();
            let result = try_again(|| {
                count.set(count.get() + 1);
                std::future::ready(Ok::<_, String>(Err(refused(status))))
            })
            .await;
            assert!(result.unwrap_err().contains(&status.to_string()));
            assert_eq!(count.get(), tries, "{status}");
            let waited = if tries > 1 { WAITS_S.iter().sum() } else { 0 };
            assert_eq!(begun.elapsed().as_secs(), waited);
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_server_that_is_busy_gets_the_message_later() {
        let server = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/hook", server.local_addr().unwrap());
        let served = std::thread::spawn(move || {
            let mut bodies = Vec::new();
            for status in ["503 Service Unavailable", "200 OK"] {
                let (stream, _) = server.accept().unwrap();
                let mut reader = BufReader::new(stream);
                let mut length = 0;
                let mut line = String::new();
                while reader.read_line(&mut line).unwrap() > 2 {
                    if let Some(value) = line.to_lowercase().strip_prefix("content-length:") {
                        length = value.trim().parse().unwrap();
                    }
                    line.clear();
                }
                let mut body = vec![0; length];
                reader.read_exact(&mut body).unwrap();
                bodies.push(serde_json::from_slice::<serde_json::Value>(&body).unwrap());
                let answer = format!("HTTP/1.1 {status}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
                reader.get_mut().write_all(answer.as_bytes()).unwrap();
            }
            bodies
        });
        let mut hook = Webhook::parse(FILE).unwrap();
        hook.url = address;
        let body = hook.body(&fault());
        try_again(|| {
            let (hook, body) = (hook.clone(), body.clone());
            let posted = move || post_json(&hook.url, &hook.headers, &body, TIMEOUT);
            tokio::task::spawn_blocking(posted)
        })
        .await
        .unwrap();
        assert_eq!(served.join().unwrap(), [body.clone(), body]);
    }
}
