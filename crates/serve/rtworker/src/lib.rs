//! The sample generator: one process that traces packets for a holoserver on all its cores (Larson
//! & Simmons 1999, §2.3).
//!
//! Invariants:
//! - The scene comes from the server, so no shared disk is needed. One copy serves all threads.
//! - A packet alone determines its rays. Traced again, it has the same rays.
#![forbid(unsafe_code)]

mod cache;
mod cells;
mod loading;
mod pool;
mod report;
mod sending;
mod session;
mod unexpected;
mod unseen;

use std::{path::PathBuf, time::Duration};

use anyhow::{Context, Result, bail};
use clap::Args;
use holo_net::{Destination, MachineKey, NetError, RETURN_TIME, Shutdown};
use holo_proto::control::Farewell;
pub use report::ReportState;

/// Options of `rtworker`.
#[derive(Args, Clone, Debug)]
#[command(after_help = "Examples:\n  rtworker --connect 127.0.0.1:7070 --threads 4\n  \
    rtworker --join holodeck://192.0.2.7:7070/FINGERPRINT/TOKEN")]
pub struct WorkerConfig {
    /// The holoserver: its address on this machine, or the string to join with that it prints
    #[arg(
        long,
        visible_alias = "join",
        value_name = "HOST:PORT|STRING",
        default_value = "127.0.0.1:7070"
    )]
    pub connect: String,
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    pub threads: Option<u16>,
    /// Give way to other programs by this much (0 to 19)
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(i32).range(0..=19))]
    pub nice: i32,
    /// How long to try to reach the server, at the start and after a lost connection. A server that
    /// starts again has at least five minutes
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0)]
    pub retry: f64,
    /// Folder for scenes that servers have sent, and their hierarchies [default: holodeck/scenes in
    /// the user's cache folder]
    #[arg(long, value_name = "DIR")]
    pub scene_cache: Option<PathBuf>,
    /// Folder of this machine's key, by which servers know it [default: holodeck/machines in the
    /// user's configuration folder]
    #[arg(long, value_name = "DIR")]
    pub identity: Option<PathBuf>,
    /// Print less
    #[arg(short, long)]
    pub quiet: bool,
    /// End when standard input ends (set by the program that starts this one)
    #[arg(long, hide = true)]
    pub with_parent: bool,
}

/// Traces for a server until the server says goodbye, or `shutdown` is triggered.
///
/// # Errors
/// If the server cannot be reached for `config.retry` seconds, refuses, drops this worker, breaks
/// the protocol, or its scene cannot be traced.
pub async fn run(config: WorkerConfig, shutdown: Shutdown) -> Result<()> {
    let server = Destination::parse(&config.connect)?;
    if config.nice > 0 {
        // If the system refuses, tracing continues at normal priority.
        let _ = rustix::process::nice(config.nice);
    }
    let machine = machine_key(&config)?;
    let mut worker = session::WorkerState::new(&config);
    let retry = Duration::try_from_secs_f64(config.retry).unwrap_or_default();
    let mut patience = retry;
    loop {
        let lost = tokio::select! {
            ended = serve(&mut worker, &config, &server, &machine, patience) => match ended {
                Ok(Farewell::Dropped { reason }) => {
                    bail!("the server has dropped this worker: {reason}")
                }
                Ok(farewell) => {
                    chat(&config, &format!("leaving: {farewell}"));
                    return Ok(());
                }
                Err(error) => error,
            },
            () = shutdown.wait() => return Ok(()),
        };
        match lost.downcast_ref::<NetError>() {
            Some(NetError::StartsAgain) => {
                say(&config, &format!("{lost}; trying to reach it"));
                patience = retry.max(RETURN_TIME);
            }
            Some(error) if error.is_lost() => {
                say(&config, &format!("lost the server ({lost}); trying to reach it again"));
                patience = retry;
            }
            _ => return Err(lost.context(format!("working for {server}"))),
        }
    }
}

/// Returns this machine's key. If it cannot be kept, servers take this process for a new machine.
fn machine_key(config: &WorkerConfig) -> Result<MachineKey> {
    let Some(folder) = config.identity.clone().or_else(MachineKey::users_folder) else {
        return Ok(MachineKey::new()?);
    };
    let system = rustix::system::uname();
    match MachineKey::open(&folder, &system.nodename().to_string_lossy()) {
        Err(error) if config.identity.is_none() => {
            say(config, &format!("{error}; servers take this process for a new machine"));
            Ok(MachineKey::new()?)
        }
        key => Ok(key?),
    }
}

async fn serve(
    worker: &mut session::WorkerState,
    config: &WorkerConfig,
    server: &Destination,
    machine: &MachineKey,
    patience: Duration,
) -> Result<Farewell> {
    let connection = match session::reach(server, machine, patience).await {
        // The connection was never established, so the caller must not try for ever.
        Err(NetError::Io(error)) => {
            return Err(anyhow::Error::msg(error.to_string()))
                .with_context(|| format!("no holoserver answers at {server} (is it running?)"));
        }
        Err(error @ NetError::Closed) => {
            return Err(anyhow::Error::msg(error.to_string()))
                .with_context(|| format!("no holoserver answers at {server} (is it one?)"));
        }
        connection => connection?,
    };
    chat(config, &format!("connected to {server}"));
    worker.session(connection).await
}

/// Prints a line for a person who has started this program by hand.
fn chat(config: &WorkerConfig, text: &str) {
    if !config.with_parent {
        say(config, text);
    }
}

fn say(config: &WorkerConfig, text: &str) {
    if !config.quiet {
        eprintln!("rtworker: {text}");
    }
}

/// Runs the whole program: [`run`] until a signal.
///
/// # Errors
/// As [`run`].
pub async fn run_until_signal(config: WorkerConfig) -> Result<()> {
    let shutdown = Shutdown::new();
    shutdown.on_signals(config.with_parent)?;
    run(config, shutdown).await
}
