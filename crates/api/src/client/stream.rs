use std::io::{self, BufRead};

use crate::{Event, RigView};

/// One server-sent event, as it came.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ServerSentEvent {
    /// Its id, for those that can be gone on from.
    pub id: Option<u64>,
    /// Its name; empty where it has none.
    pub name: String,
    /// Its data.
    pub data: String,
}

/// What a server-sent event says.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// Something happened.
    Event(Box<Event>),
    /// The picture of the rig changed.
    Rig(Box<RigView>),
    /// Something that only a newer version understands.
    Unknown,
}

impl ServerSentEvent {
    /// Reads what it says.
    pub fn message(&self) -> Message {
        let message = match self.name.as_str() {
            "rig" => serde_json::from_str(&self.data).map(|view| Message::Rig(Box::new(view))),
            _ => serde_json::from_str(&self.data).map(|event| Message::Event(Box::new(event))),
        };
        message.unwrap_or(Message::Unknown)
    }
}

/// Server-sent events as they come (WHATWG HTML, "Server-sent events").
pub struct Stream {
    lines: Box<dyn BufRead>,
}

impl Stream {
    pub(super) fn new(lines: impl BufRead + 'static) -> Self {
        Self {
            lines: Box::new(lines),
        }
    }

    /// The next event; `None` where the stream has ended.
    ///
    /// # Errors
    /// The connection broke, or was quiet for too long.
    #[expect(clippy::should_implement_trait, reason = "it can fail, and ends once")]
    pub fn next(&mut self) -> io::Result<Option<ServerSentEvent>> {
        let mut told = ServerSentEvent::default();
        let mut line = String::new();
        loop {
            line.clear();
            if self.lines.read_line(&mut line)? == 0 {
                return Ok(None);
            }
            let text = line.trim_end_matches(['\r', '\n']);
            if text.is_empty() {
                if told.data.is_empty() {
                    continue;
                }
                return Ok(Some(told));
            }
            // A line that begins with a colon is a comment, and keeps the connection alive.
            let (field, value) = text.split_once(':').unwrap_or((text, ""));
            let value = value.strip_prefix(' ').unwrap_or(value);
            match field {
                "id" => told.id = value.parse().ok(),
                "event" => value.clone_into(&mut told.name),
                "data" => {
                    if !told.data.is_empty() {
                        told.data.push('\n');
                    }
                    told.data.push_str(value);
                }
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::What;

    #[test]
    fn events_are_told_apart_and_comments_passed_over() {
        let text = ":\n\nid: 7\nevent: job\ndata: {\"a\":\ndata: 1}\n\n: still here\n\nevent: rig\r\ndata:{}\r\n\r\ndata: torn";
        let mut stream = Stream::new(io::Cursor::new(text));
        let told = |id, name: &str, data: &str| ServerSentEvent {
            id,
            name: name.to_owned(),
            data: data.to_owned(),
        };
        assert_eq!(stream.next().unwrap(), Some(told(Some(7), "job", "{\"a\":\n1}")));
        assert_eq!(stream.next().unwrap(), Some(told(None, "rig", "{}")));
        assert_eq!(stream.next().unwrap(), None, "what was cut off is not told");
    }

    #[test]
    fn an_event_of_a_newer_daemon_is_passed_on_and_not_understood() {
        let event = |name: &str, data: &str| ServerSentEvent {
            name: name.to_owned(),
            data: data.to_owned(),
            ..ServerSentEvent::default()
        };
        let gap = event("", r#"{"id":7,"at":"2026-01-01T00:00:00Z","event":"gap"}"#);
        let Message::Event(gap) = gap.message() else {
            panic!("{gap:?} is an event");
        };
        assert_eq!((gap.id, gap.what), (7, What::Gap));
        for data in [
            r#"{"id":8,"at":"2026-01-01T00:00:00Z","event":"of tomorrow"}"#,
            "{",
        ] {
            assert_eq!(event("", data).message(), Message::Unknown);
            assert_eq!(event("rig", data).message(), Message::Unknown);
        }
    }
}
