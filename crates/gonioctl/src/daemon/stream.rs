use std::io::{self, BufRead};

/// One server-sent event.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Told {
    /// Its id, for those that can be gone on from.
    pub(crate) id: Option<u64>,
    /// Its name; empty where it has none.
    pub(crate) name: String,
    /// Its data.
    pub(crate) data: String,
}

/// Server-sent events as they come (WHATWG HTML, "Server-sent events").
pub(crate) struct Stream {
    lines: Box<dyn BufRead>,
}

impl Stream {
    pub(crate) fn new(lines: impl BufRead + 'static) -> Self {
        Self {
            lines: Box::new(lines),
        }
    }

    /// The next event; `None` where the stream has ended.
    ///
    /// # Errors
    /// The connection broke, or was quiet for too long.
    pub(crate) fn next(&mut self) -> io::Result<Option<Told>> {
        let mut told = Told::default();
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

    #[test]
    fn events_are_told_apart_and_comments_passed_over() {
        let text = ":\n\nid: 7\nevent: job\ndata: {\"a\":\ndata: 1}\n\n: still here\n\nevent: rig\r\ndata:{}\r\n\r\ndata: torn";
        let mut stream = Stream::new(io::Cursor::new(text));
        let told = |id, name: &str, data: &str| Told {
            id,
            name: name.to_owned(),
            data: data.to_owned(),
        };
        assert_eq!(stream.next().unwrap(), Some(told(Some(7), "job", "{\"a\":\n1}")));
        assert_eq!(stream.next().unwrap(), Some(told(None, "rig", "{}")));
        assert_eq!(stream.next().unwrap(), None, "what was cut off is not told");
    }
}
