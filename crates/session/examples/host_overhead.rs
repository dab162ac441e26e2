//! What the host adds to a reading: the same job on the simulated bus in wire time, where the host costs nothing, and
//! in real time, where the bus waits for it.
//!
//! `cargo run --release -p session --example host_overhead [JOB.toml]`
//!
//! In wire time the photometer's clock advances by motion, settling, integration and the bytes on the wire alone;
//! what it shows more in real time is the host's. Run it on an idle machine: where other programs hold every core, the
//! answers of the simulator come late too, and the host waits for them as it would for a busy adapter. Requests that
//! had to be repeated for that are told beside the time.

use std::error::Error;
use std::path::Path;

use capture::Command;
use session::RunRequest;
use tokio::sync::watch;

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let job = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "config/jobs/quickstart.toml".to_owned());
    let mut per_reading_ms = [0.0; 2];
    for (ms, clock) in per_reading_ms.iter_mut().zip(["wire", "real"]) {
        let retries;
        (*ms, retries) = measure(Path::new(&job), clock).await?;
        println!("{clock} time: {ms:.2} ms a reading, {retries} retries");
    }
    let [wire, real] = per_reading_ms;
    println!(
        "the host adds {:.2} ms a reading, {:.2} %",
        real - wire,
        (real / wire - 1.0) * 100.0
    );
    Ok(())
}

/// Milliseconds of the photometer's time for each reading of a whole run, and requests that were repeated.
async fn measure(job: &Path, clock: &str) -> Result<(f64, u64), Box<dyn Error>> {
    let mut order = RunRequest::read(job, None)?;
    order.rig.sim.insert("clock".to_owned(), clock.into());
    let out = tempfile::tempdir()?;
    // The sender lives until the run has ended: nobody stops it.
    let (_operator, control) = watch::channel(Command::Run);
    let ended = session::run(&order, out.path(), control, &mut |_| {}).await?;
    let run = &ended.report.run;
    if ended.outcome != capture::Outcome::Done {
        return Err(format!("the run ended as {:?}", ended.outcome).into());
    }
    let ms = run.seconds.total * 1e3 / run.readings.taken as f64;
    Ok((ms, run.retries))
}
