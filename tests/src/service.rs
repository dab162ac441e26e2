use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

use serde_json::Value;

/// The daemon in a process of its own, behind `e2e-daemon`; killed when dropped.
pub struct Service {
    child: Child,
    commands: ChildStdin,
    said: Receiver<Value>,
}

impl Service {
    /// Starts it.
    ///
    /// # Panics
    /// If the program cannot be started.
    pub fn start(program: &str, rig: &Path, data: &Path) -> Self {
        Self::start_by(Command::new(program), rig, data)
    }

    /// Starts it by a command that hands on to it the arguments that follow.
    ///
    /// # Panics
    /// If the command cannot be started.
    pub fn start_by(mut command: Command, rig: &Path, data: &Path) -> Self {
        let mut child = command
            .args([rig, data])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap_or_else(|error| panic!("cannot start {command:?}: {error}"));
        let out = child.stdout.take().expect("it is piped");
        let (tell, said) = channel();
        std::thread::spawn(move || {
            // A line that a kill cut short says nothing.
            let lines = BufReader::new(out).lines().map_while(Result::ok);
            for value in lines.filter_map(|line| serde_json::from_str(&line).ok()) {
                if tell.send(value).is_err() {
                    return;
                }
            }
        });
        Self {
            commands: child.stdin.take().expect("it is piped"),
            child,
            said,
        }
    }

    /// Hands a command over; the answer is among what it says. A process that is gone hears nothing.
    pub fn tell(&mut self, command: &str) {
        let _ = writeln!(self.commands, "{command}");
    }

    /// What it says next; `None` once it has ended, or at the given moment.
    pub fn next(&mut self, until: Option<Instant>) -> Option<Value> {
        let Some(until) = until else {
            return self.said.recv().ok();
        };
        let left = until.saturating_duration_since(Instant::now());
        self.said.recv_timeout(left).ok()
    }

    /// Reads on until it says what is looked for.
    ///
    /// # Panics
    /// If it ends before.
    pub fn until<T>(&mut self, mut found: impl FnMut(&Value) -> Option<T>) -> T {
        loop {
            let said = self.next(None).expect("it goes on");
            if let Some(found) = found(&said) {
                return found;
            }
        }
    }

    /// The answer to a command.
    ///
    /// # Panics
    /// If it refuses, or ends.
    pub fn ask(&mut self, command: &str) -> Value {
        self.tell(command);
        self.until(|said| {
            assert!(said.get("refusal").is_none(), "{command}: {said}");
            said.get("answer").cloned()
        })
    }

    /// Kills it as `kill -9` does, and returns what it had still said.
    ///
    /// # Panics
    /// If it cannot be killed.
    pub fn kill(&mut self) -> Vec<Value> {
        self.child.kill().expect("it is our own process");
        self.child.wait().expect("it is our own process");
        self.said.iter().collect()
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
