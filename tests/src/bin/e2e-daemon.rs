//! The daemon's library behind stdin and stdout: `e2e-daemon RIG.toml DATA_DIR`.
//!
//! One command a line comes in: `submit JOB.toml`, `ready ID`, `resume ID`, `cancel ID`, `jobs`, `pause`, `proceed`,
//! `stop`, `estop`, `acknowledge`, `park`, `shutdown`. One line of JSON goes out for each answer and each event.

use std::io::BufRead;
use std::path::PathBuf;
use std::time::SystemTime;

use anyhow::Context;
use goniod::{Action, Caller, Daemon, Refusal, Settings, Submission};
use serde_json::{Value, json};
use tokio::sync::mpsc;

#[tokio::main(worker_threads = 1)]
async fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let (rig, data) = arguments
        .next()
        .zip(arguments.next())
        .context("usage: e2e-daemon RIG.toml DATA_DIR")?;
    let settings = Settings {
        rig: std::fs::read_to_string(&rig)?,
        rig_name: rig.display().to_string(),
        data,
        clock: SystemTime::now,
    };
    let daemon = Daemon::open(settings).await?;
    let mut events = daemon.events(None);
    println!("{}", json!({ "open": true }));
    let (lines, mut commands) = mpsc::channel(1);
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if lines.blocking_send(line).is_err() {
                return;
            }
        }
    });
    loop {
        tokio::select! {
            biased;
            Some(event) = events.next() => println!("{}", serde_json::to_string(&event)?),
            command = commands.recv() => {
                let Some(command) = command.filter(|command| command != "shutdown") else {
                    daemon.shutdown().await;
                    return Ok(());
                };
                let answer = match obey(&daemon, &command).await {
                    Ok(answer) => json!({ "answer": answer }),
                    Err(refusal) => json!({ "refusal": refusal.to_string() }),
                };
                println!("{answer}");
            }
        }
    }
}

async fn obey(daemon: &Daemon, command: &str) -> Result<Value, Refusal> {
    let by = Caller {
        name: "test".to_owned(),
    };
    let (verb, about) = command.split_once(' ').unwrap_or((command, ""));
    let act = async |action| {
        let id = about.parse().expect("the test names a job");
        daemon.act(&by, id, action).await.map(|job| json!(job))
    };
    match verb {
        "submit" => {
            let submission = Submission {
                job: std::fs::read_to_string(about).expect("the test's own job file"),
                name: about.to_owned(),
                whole: true,
            };
            Ok(json!(daemon.submit(&by, submission).await?))
        }
        "ready" => act(Action::Ready).await,
        "resume" => act(Action::Resume).await,
        "cancel" => act(Action::Cancel).await,
        "jobs" => Ok(json!(daemon.jobs().await?)),
        "run" => Ok(json!(daemon.run(about).await?)),
        "pause" => Ok(json!(daemon.pause(&by).await?)),
        "proceed" => Ok(json!(daemon.proceed(&by).await?)),
        "stop" => Ok(json!(daemon.stop(&by).await?)),
        "estop" => Ok(json!(daemon.estop(&by).await?)),
        "acknowledge" => {
            let fault = daemon.rig().borrow().fault.as_ref().map(|fault| fault.id.clone());
            // The daemon refuses what is no fault's name.
            let named = fault.unwrap_or_else(|| "none".to_owned().into());
            Ok(json!(daemon.acknowledge(&by, &named).await?))
        }
        "park" => Ok(json!(daemon.park(&by).await?)),
        other => panic!("no such command: {other}"),
    }
}
