use std::fs;
use std::io::IsTerminal;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::SystemTime;

use anyhow::Context;
use clap::{Args, CommandFactory, Parser, Subcommand};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use sd_notify::NotifyState;
use session::{SessionError, Status};
use terminal::{LevelFilter, LogFormat};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;
use tokio::task::JoinSet;

use crate::daemon::STORE;
use crate::http::{self, Access, Address, Limits, Listener, Tokens};
use crate::lock::Lock;
use crate::strays::RunDirectories;
use crate::{Daemon, DaemonError, Settings, Sqlite, Store as _, Webhook};

/// Where TCP is listened on when nothing else is said.
const LISTEN: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 4664);
/// Threads that answer requests; the rig has one of its own.
const THREADS: usize = 2;

/// The daemon of a gonio-reflectometer: a queue of jobs, a page to watch them, hands that stop the rig.
#[derive(Parser)]
#[command(name = "goniod", version, args_conflicts_with_subcommands = true)]
struct Arguments {
    #[command(subcommand)]
    store_command: Option<StoreCommand>,
    /// Rig file [default: config/rig.toml where there is one, else the built-in simulator]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Where to listen: IP:PORT (port 0 takes a free one), unix:PATH, or unix for the usual socket; can be given several
    /// times, and what is not named is off [default: 127.0.0.1:4664 and unix, which is $XDG_RUNTIME_DIR/goniod.sock, as
    /// a service /run/goniod/goniod.sock]
    #[arg(long, value_name = "ADDR")]
    listen: Vec<Address>,
    /// Folder of the store and of the run directories
    #[arg(long, value_name = "DIR", default_value = "runs")]
    data: PathBuf,
    /// Start although the store does not know run directories that lie in the data folder, and remember that they belong
    /// to no store
    #[arg(long)]
    accept_runs: bool,
    /// File with the tokens that everybody needs who comes over TCP, made where there is none [default: tokens.toml in
    /// the data folder]
    #[arg(long, value_name = "FILE")]
    tokens: Option<PathBuf>,
    /// File that says whom to tell what happens, see config/notify.toml [default: notify.toml in the data folder, where
    /// there is one]
    #[arg(long, value_name = "FILE")]
    notify: Option<PathBuf>,
    /// Host name under which a browser asks for this daemon, besides localhost and its address; can be given several
    /// times
    #[arg(long, value_name = "NAME")]
    known_as: Vec<String>,
    /// Make a run directory of a data folder again from the store beside it, print its report as JSON (null where the store
    /// does not know the run), and end
    #[arg(long, value_name = "RUN_DIR", conflicts_with_all = ["config", "listen", "data", "tokens", "notify", "known_as"])]
    reconstruct: Option<PathBuf>,
    /// How the log on stderr is written; RUST_LOG says how much
    #[arg(long, value_enum, default_value = "human")]
    log: LogFormat,
}

/// What is done instead of serving.
#[derive(Subcommand)]
enum StoreCommand {
    /// Copy the store into a new file, complete and checked, also while a daemon uses it; prints the file
    Backup {
        /// The new file
        file: PathBuf,
        #[command(flatten)]
        data: Data,
    },
    /// Put a backup in the place of the store, which is kept under another name; no daemon may run
    Restore {
        /// The backup
        file: PathBuf,
        #[command(flatten)]
        data: Data,
    },
}

/// Which data folder.
#[derive(Args)]
struct Data {
    /// Folder of the store and of the run directories
    #[arg(long, value_name = "DIR", default_value = "runs")]
    data: PathBuf,
}

/// The daemon's command line, of which its manual page is made.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Runs the daemon as this process and returns its exit code.
///
/// The addresses that it listens on are printed to stdout, one a line, once it answers.
pub fn main() -> ExitCode {
    let arguments: Arguments = match terminal::arguments(|_| {}) {
        Ok(arguments) => arguments,
        Err(code) => return code,
    };
    terminal::log(arguments.log, LevelFilter::INFO);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(THREADS)
        .enable_all()
        .build();
    let ended = runtime
        .context("cannot start")
        .and_then(|runtime| runtime.block_on(carry_out(arguments)));
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            tracing::error!("{error:#}");
            let status = error.chain().find_map(status).unwrap_or(Status::Invalid);
            ExitCode::from(status.code())
        }
    }
}

/// The exit status that one error of a chain leads to.
fn status(error: &(dyn std::error::Error + 'static)) -> Option<Status> {
    let daemon = error.downcast_ref::<DaemonError>().map(DaemonError::status);
    daemon.or_else(|| error.downcast_ref::<SessionError>().map(SessionError::status))
}

async fn reconstruct(directory: &Path) -> anyhow::Result<()> {
    let report = crate::rebuild(directory).await?;
    println!("{}", serde_json::to_string_pretty(&report)?);
    Ok(())
}

async fn carry_out(mut arguments: Arguments) -> anyhow::Result<()> {
    match arguments.store_command.take() {
        Some(StoreCommand::Backup { file, data }) => {
            crate::backup(&data.data.join(STORE), &file)
                .await
                .map_err(DaemonError::from)?;
            terminal::line(file.display())?;
            Ok(())
        }
        Some(StoreCommand::Restore { file, data }) => restore(&file, &data.data).await,
        None => match &arguments.reconstruct {
            Some(directory) => reconstruct(directory).await,
            None => run(arguments).await,
        },
    }
}

/// Puts a backup in the place of the store of a data folder, and says what became of what was there.
async fn restore(backup: &Path, data: &Path) -> anyhow::Result<()> {
    session::prepare_output(data)?;
    let _lock = Lock::take(data)?;
    let now = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let store = data.join(STORE);
    let aside = crate::restore(backup, &store, &now.replace(':', ""))
        .await
        .map_err(DaemonError::from)?;
    if let Some(aside) = aside {
        tracing::info!("what was there is kept as {}", aside.display());
    }
    let runs = RunDirectories::of(data)?;
    let restored = Sqlite::open(&store).await.map_err(DaemonError::from)?;
    let known = runs.check_store(&store, &restored).await;
    restored.close().await;
    if let Err(DaemonError::StrangeRuns { count, such_as, .. }) = &known {
        // Whoever brings back an older store knows that it lacks what came after.
        runs.accept()?;
        tracing::warn!(
            "{count} runs are newer than the backup, such as {such_as}: their directories are whole by themselves, and \
             the daemon will not list them"
        );
    } else {
        known?;
    }
    terminal::line(store.display())?;
    Ok(())
}

async fn run(arguments: Arguments) -> anyhow::Result<()> {
    open_files();
    // Before signals are listened for: reading may block, and until then a signal ends the program by itself.
    let (rig, rig_name) = session::rig_text(arguments.config.as_deref())?;
    let webhook = webhook(&arguments)?;
    let ended = terminated()?;
    if arguments.accept_runs {
        session::prepare_output(&arguments.data)?;
        let accepted = RunDirectories::of(&arguments.data)?.accept()?;
        tracing::info!(
            "{accepted} runs in the data folder are accepted, whether the store knows them or not"
        );
    }
    let daemon = Daemon::open(Settings {
        rig,
        rig_name: rig_name.display().to_string(),
        // Clients are told of run directories, and work elsewhere.
        data: std::path::absolute(&arguments.data).context("--data")?,
        clock: SystemTime::now,
    })
    .await?;
    if let Some(webhook) = webhook {
        tokio::spawn(webhook.run(daemon.clone()));
    }
    let served = serve(&arguments, &daemon, ended).await;
    daemon.shutdown().await;
    served
}

/// Whom to tell what happens; a file that is named must be there.
fn webhook(arguments: &Arguments) -> anyhow::Result<Option<Webhook>> {
    match &arguments.notify {
        Some(file) => {
            let webhook = Webhook::read(file)?;
            anyhow::ensure!(webhook.is_some(), "there is no notify file {}", file.display());
            Ok(webhook)
        }
        None => Ok(Webhook::read(&arguments.data.join("notify.toml"))?),
    }
}

async fn serve(
    arguments: &Arguments,
    daemon: &Daemon,
    ended: impl Future<Output = &'static str>,
) -> anyhow::Result<()> {
    let limits = Limits::default();
    let tokens = tokens(arguments)?;
    let (close, closing) = watch::channel(());
    let mut servers = JoinSet::new();
    for address in addresses(arguments) {
        let listener = Listener::bind(&address).await?;
        let address = listener.address()?;
        let tcp = match &address {
            Address::Tcp(address) => Some(*address),
            Address::Unix(_) => None,
        };
        let access = Access::new(tcp, arguments.known_as.clone(), Some(tokens.clone()), &limits);
        let mut closing = closing.clone();
        let closed = async move {
            // An error means the same: nobody is left who could close it.
            let _ = closing.changed().await;
        };
        servers.spawn(http::serve(listener, access, limits, daemon.clone(), closed));
        tracing::info!("listening on {address}");
        terminal::line(&address)?;
        if let Some(address) = tcp {
            offer_sign_in(address, &tokens);
        }
    }
    notify(&[NotifyState::Ready]);
    let signal = tokio::select! {
        signal = ended => signal,
        () = watchdog(daemon) => unreachable!("the watchdog is fed for ever"),
    };
    tracing::info!("{signal}: finishing the reading");
    notify(&[NotifyState::Stopping]);
    // Still served meanwhile: an emergency stop must get through until the arms are at rest.
    daemon.shutdown().await;
    drop(close);
    while servers.join_next().await.is_some() {}
    Ok(())
}

/// Lets this process have as many files open as the system allows it: the store, the runs and the files that are
/// downloaded must not run short because of connections.
fn open_files() {
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: limit.maximum,
        ..limit
    };
    if let Err(error) = setrlimit(Resource::Nofile, raised) {
        tracing::debug!("no more than {:?} open files: {error}", limit.current);
    }
}

/// Where to listen: where the arguments say, else over TCP on this computer and on the usual socket.
fn addresses(arguments: &Arguments) -> Vec<Address> {
    if !arguments.listen.is_empty() {
        return arguments.listen.clone();
    }
    [Some(Address::Tcp(LISTEN)), usual_socket()]
        .into_iter()
        .flatten()
        .collect()
}

/// The usual socket, whose folder is made where it is missing and may be made.
fn usual_socket() -> Option<Address> {
    let address = Address::usual_socket();
    let Some(Address::Unix(path)) = &address else {
        tracing::warn!("no Unix socket: $XDG_RUNTIME_DIR is not set; --listen unix:PATH makes one elsewhere");
        return None;
    };
    let folder = path.parent().unwrap_or(path);
    if let Err(error) = fs::create_dir_all(folder) {
        let folder = folder.display();
        tracing::warn!(
            "no Unix socket: cannot make {folder} ({error}); --listen unix:PATH makes one elsewhere"
        );
        return None;
    }
    address
}

/// The tokens that everybody needs who comes over TCP.
fn tokens(arguments: &Arguments) -> anyhow::Result<Tokens> {
    let default = arguments.data.join("tokens.toml");
    let path = arguments.tokens.as_deref().unwrap_or(&default);
    let tokens = Tokens::open(path)?;
    tracing::info!("over TCP, a token of {} is needed", path.display());
    Ok(tokens)
}

/// Says how a browser signs in: to somebody who looks, and not to a log, which others may read.
fn offer_sign_in(mut address: SocketAddr, tokens: &Tokens) {
    if !std::io::stderr().is_terminal() {
        return;
    }
    if address.ip().is_unspecified() {
        address.set_ip(Ipv4Addr::LOCALHOST.into());
    }
    let link = tokens.sign_in_link(&Address::Tcp(address).to_string());
    terminal::say(format_args!("to sign in with a browser, open {link}"));
}

/// Returns which signal asked the daemon to end.
fn terminated() -> anyhow::Result<impl Future<Output = &'static str>> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    Ok(async move {
        tokio::select! {
            _ = terminate.recv() => "SIGTERM",
            _ = interrupt.recv() => "SIGINT",
        }
    })
}

/// Tells systemd that the daemon lives, as often as it wants to hear it, as long as the store answers.
async fn watchdog(daemon: &Daemon) {
    let Some(limit) = sd_notify::watchdog_enabled() else {
        return std::future::pending().await;
    };
    let mut every = tokio::time::interval(limit / 3);
    loop {
        every.tick().await;
        match tokio::time::timeout(limit / 3, daemon.waiting_jobs()).await {
            Ok(_) => notify(&[NotifyState::Watchdog]),
            Err(_) => tracing::error!("the store does not answer"),
        }
    }
}

fn notify(state: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(state) {
        tracing::warn!("cannot tell systemd: {error}");
    }
}
