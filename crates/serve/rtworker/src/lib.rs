//! The sample generator: one process that traces packets for a holoserver on all its cores (Larson
//! & Simmons 1999, §2.3).
//!
//! Invariants:
//! - The scene comes from the server, so no shared disk is needed. One copy serves all threads.
//! - A packet alone determines its rays. Traced again, it has the same rays.
#![forbid(unsafe_code)]

mod cache;
mod cells;
mod config;
mod loading;
mod pool;
mod report;
mod sending;
mod session;
mod unexpected;
mod unseen;

use std::time::Duration;

use anyhow::{Context, Result, bail};
pub use config::WorkerConfig;
use holo_net::{Destination, MachineKey, NetError, RETURN_TIME, Shutdown};
use holo_proto::control::Farewell;
pub use report::WorkerProgress;

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
    let mut worker = session::WorkerState::new(&config)?;
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
