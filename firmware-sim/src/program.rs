use std::error::Error;
use std::io::BufRead;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use rig::RigFile;
use terminal::{LevelFilter, LogFormat};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc;

use crate::{Bench, Clock, Order, Server, WireSettings};

mod trace;

/// A simulated Dynamixel bus on a pseudo-terminal: two servo arms (ids 1 and 2), a photometer (id 3), a lamp and a
/// specimen. Prints the path to open; runs until it is interrupted.
#[derive(Parser)]
#[command(name = "firmware-sim", version)]
struct Arguments {
    /// Give the terminal a stable name too: a symbolic link, removed at exit.
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Rig file; its table "sim" describes what is simulated.
    #[arg(long, value_name = "RIG.toml")]
    config: Option<PathBuf>,
    /// What lies on the stage, instead of what the rig file says: a fitted MERL material by name, "lambert:ALBEDO",
    /// "mirror:REFLECTANCE", or the path of a MERL .binary file.
    #[arg(long)]
    specimen: Option<String>,
    /// Let time go by the bytes on the wire instead of the clock on the wall.
    #[arg(long)]
    wire_time: bool,
    /// Serve a picoammeter that looks at the same light too, at a TCP address such as 127.0.0.1:5025: it speaks the commands of a
    /// Keithley 6485.
    #[arg(long, value_name = "ADDRESS")]
    scpi: Option<String>,
    /// Take orders from stdin while it runs, a line of TOML each, such as "wire.drop_reply = 0.1", "mishaps.reboot = 60",
    /// "fault = { device = 'sensor', what = 'overload' }", "plugged = false". docs/simulator.md has them all.
    #[arg(long)]
    orders: bool,
    /// Append to a file, a line of JSON each, all that the host writes to the devices: when it came, by the
    /// system's clock and in the rig's time, to which id, from which address on, which bytes.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
}

/// Runs `firmware-sim` with the arguments of this process: serves until SIGINT or SIGTERM, then returns 0; 2 for bad
/// arguments or a bad rig file.
pub fn main() -> ExitCode {
    let arguments = match terminal::arguments(|_| {}) {
        Ok(arguments) => arguments,
        Err(code) => return code,
    };
    // A test may have set a subscriber already; then that one stays.
    terminal::log(LogFormat::Human, LevelFilter::INFO);
    match run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let mut text = error.to_string();
            let mut cause = error.source();
            while let Some(error) = cause {
                text = format!("{text}: {error}");
                cause = error.source();
            }
            terminal::say(format_args!("firmware-sim: {text}"));
            ExitCode::from(2)
        }
    }
}

fn run(arguments: Arguments) -> Result<(), Box<dyn Error>> {
    let mut rig = match &arguments.config {
        Some(path) => RigFile::load(path)?,
        None => RigFile::default(),
    };
    if let Some(specimen) = arguments.specimen {
        rig.sim.insert("specimen".to_owned(), specimen.into());
    }
    let settings = WireSettings::new(&rig)?;
    let mut bench = Bench::new(&rig)?;
    bench.set_clock(if arguments.wire_time {
        Clock::Wire
    } else {
        Clock::Real
    });
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .build()?;
    runtime.block_on(async {
        // Before anybody can know that we run.
        let mut interrupted = signal(SignalKind::interrupt())?;
        let mut terminated = signal(SignalKind::terminate())?;
        let mut server = Server::with_bench(bench, &settings)?;
        if let Some(link) = &arguments.link {
            server.link(link)?;
        }
        if let Some(path) = &arguments.trace {
            trace::keep(path, &server)?;
        }
        let instrument = arguments
            .scpi
            .as_deref()
            .map(|address| server.instrument(&rig, address));
        // Served until the end.
        let _instrument = instrument.transpose()?;
        terminal::line(server.path().display())?;
        tracing::info!(wire_time = arguments.wire_time, "serving");
        let mut orders = if arguments.orders {
            listen()
        } else {
            mpsc::channel(1).1
        };
        loop {
            tokio::select! {
                _ = interrupted.recv() => break,
                _ = terminated.recv() => break,
                Some(line) = orders.recv() => obey(&line, &mut rig, &mut server),
            }
        }
        let counters = server.counters();
        tracing::info!(packets = counters.packets, damaged = counters.damaged, "stopped");
        Ok(())
    })
}

/// Lines from stdin, until it ends.
fn listen() -> mpsc::Receiver<String> {
    let (sender, lines) = mpsc::channel(16);
    // No task: a read from stdin cannot be cancelled, and would hold the runtime back at the end.
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if sender.blocking_send(line).is_err() {
                break;
            }
        }
    });
    lines
}

/// Carries an order out; the answer is a line on stdout: `ok`, with the path where the port has a new one, or what is
/// wrong with the order.
fn obey(line: &str, rig: &mut RigFile, server: &mut Server) {
    let before = server.path().to_owned();
    let result = line.parse().and_then(|order: Order| order.carry_out(rig, server));
    let answer = match result {
        Ok(()) if server.path() != before => format!("ok {}", server.path().display()),
        Ok(()) => "ok".to_owned(),
        Err(error) => format!("refused: {error}"),
    };
    // Nobody may be listening.
    let _ = terminal::line(answer);
}
