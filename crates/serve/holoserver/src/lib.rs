//! The holodeck server: one file, the workers that trace for it, and the displays that look at it
//! (Larson & Simmons 1999, §2.2).
//!
//! Who is connected decides what the server does. It answers a display's view first from the file
//! and then by tracing. With workers and no display it fills the file in batch order. Without
//! workers it only shows what is stored. Anyone may come and go at any time.

mod about;
mod allotment;
mod assignment;
mod audits;
mod baked;
mod baked_models;
mod batch;
mod better;
mod captured;
mod cells;
mod claims;
mod config;
mod coordinator;
mod damage;
mod doors;
mod events;
mod file_size;
mod forget;
mod guard;
mod handshakes;
mod holodeck;
mod listen;
mod live;
mod log;
mod mailbox;
mod makers;
mod merge;
mod optimize;
mod pace;
mod plausible;
mod progress;
mod radiance_limits;
mod recall;
mod reframe;
mod schedule;
mod shard;
#[cfg(test)]
mod simulation;
mod stand_ins;
mod unproven;
mod unseen;
mod wishes;
mod worker_id;
mod workers;

use std::{net::SocketAddr, sync::Arc, time::Duration};

pub use about::{HolodeckDescription, SceneReading};
use anyhow::Result;
pub use baked::{BakedObject, BakedPose};
pub use captured::{CapturedCounts, CapturedRay};
pub use config::{Config, parse_count, parse_memory, parse_size, parse_time};
pub use doors::{Outside, Ready};
pub use file_size::outlive_file_size_limit;
pub use forget::Forgotten;
use holo_net::{Ending, ParentLink, Shutdown};
use holo_proto::control::Farewell;
pub use holodeck::{Holodeck, remove_drafts};
pub use radiance_limits::RadianceLimits;
use serde::{Deserialize, Serialize};
use tracing::info;

use coordinator::{Coordinator, FillOptions};
use doors::Doors;
use events::ServerEvent;
pub use makers::{MachineList, MadeBy};
pub use merge::Merged;
pub use optimize::Optimized;
use progress::SampleProgress;
pub use progress::superseded_bytes;
pub use reframe::Reframed;
pub use schedule::Goal;
use shard::Share;
pub use shard::{BeamList, Shard};
pub use unproven::UnprovenClaims;
pub use unseen::UnseenBeams;

/// What a server did.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Summary {
    /// Samples added.
    pub added: u64,
    /// Samples traced again with more paths, which replaced others.
    pub better: u64,
    /// Samples in the file at the end.
    pub samples: u64,
    /// The file's length, bytes.
    pub file_bytes: u64,
    /// Bytes among these of samples that better ones have replaced.
    pub superseded_bytes: u64,
    /// The file's growth over the last ten seconds.
    pub bytes_per_hour: f64,
    /// Seconds since tracing began; 0 if no worker was ever ready.
    pub seconds: f64,
}

/// Serves a holodeck until its goal is reached or `shutdown` is triggered. It calls `ready` once it
/// takes connections.
///
/// # Errors
/// If the file cannot be opened or written, or the address is not free.
pub async fn run(config: Config, shutdown: Shutdown, ready: impl FnOnce(Ready)) -> Result<Summary> {
    let doors = Doors::open(&config).await?;
    let cache = config.cache << 20;
    let path = config.file.clone();
    let open = move || {
        let holodeck = match config.display_only {
            true => Holodeck::open_read_only(&path, cache),
            false => Holodeck::open(&path, cache).and_then(|holodeck| {
                holodeck.about.check_traced(&path)?;
                Ok(holodeck)
            }),
        };
        if config.no_skip_unseen { holodeck.map(Holodeck::without_skipping) } else { holodeck }
    };
    let holodeck = Arc::new(tokio::task::spawn_blocking(open).await??);
    for warning in &holodeck.warnings {
        eprintln!("{}: {warning}", config.file.display());
    }
    let file = config.file.display();
    info!(%file, address = %doors.ready.address, fill = config.fill, "serving");
    ready(doors.ready.clone());

    let (events, receiver) = tokio::sync::mpsc::unbounded_channel();
    let goal = Goal { time: config.time, samples: config.samples, disk: config.disk };
    let progress = SampleProgress::new(&holodeck.file.stats(), config.quiet);
    let beams = config.beams.as_deref().map(BeamList::read).transpose()?;
    let fill = config.fill.then(|| FillOptions {
        enough: config.enough,
        share: Share { shard: config.shard.unwrap_or_default(), beams },
    });
    let coordinator = Coordinator::new(Arc::clone(&holodeck), events.clone(), fill, goal, progress);
    let mut listening = doors.listen(&holodeck, &events);
    let watching = tokio::spawn(async move {
        let farewell = match shutdown.ending().await {
            Ending::ForGood => Farewell::SessionOver,
            Ending::ToStartAgain => Farewell::StartsAgain,
        };
        // If the coordinator has ended, nothing is left to end.
        let _ = events.send(ServerEvent::Shutdown(farewell));
    });
    // Not one of the runtime's threads: it may wait for the disk when memory for samples runs out.
    let runtime = tokio::runtime::Handle::current();
    let doors = async move { listening.shutdown().await };
    let decide = move || runtime.block_on(coordinator.run(receiver, doors));
    let totals = tokio::task::spawn_blocking(decide).await?;
    watching.abort();
    // Time for the farewells to leave.
    tokio::time::sleep(Duration::from_millis(50)).await;
    let stats = holodeck.file.stats();
    let totals = totals?;
    info!(added = totals.added, better = totals.better, samples = stats.samples, "ended");
    Ok(Summary {
        added: totals.added,
        better: totals.better,
        samples: stats.samples,
        file_bytes: stats.file_bytes,
        superseded_bytes: superseded_bytes(&stats),
        bytes_per_hour: totals.bytes_per_hour,
        seconds: totals.seconds,
    })
}

/// A report of a server to the program that started it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub enum ServerReport {
    /// The server takes connections.
    Listening {
        /// The address on this machine, without encryption.
        address: SocketAddr,
        /// The address for other machines, and the string that they join with, if they may.
        outside: Option<(SocketAddr, String)>,
    },
    /// The server has ended in order.
    Ended(Summary),
}

impl From<Ready> for ServerReport {
    fn from(Ready { address, outside }: Ready) -> ServerReport {
        let outside = outside.map(|outside| (outside.address, outside.invitation.to_string()));
        ServerReport::Listening { address, outside }
    }
}

fn say_ready(ready: Ready) {
    if let Some(Outside { address, invitation }) = ready.outside {
        holo_progress::print_line!("join with {invitation}");
        holo_progress::print_line!("listening for other machines on {address}");
    }
    holo_progress::print_line!("listening on {}", ready.address);
}

/// Runs the whole program: [`run`] until a signal. It prints the address on standard output, or
/// reports it to the program that started this one.
///
/// # Errors
/// As [`run`].
pub async fn run_until_signal(config: Config) -> Result<()> {
    outlive_file_size_limit()?;
    let parent = config.reports.then(ParentLink::of_standard_input).transpose()?;
    let shutdown = Shutdown::new();
    shutdown.on_signals(config.with_parent)?;
    let json = config.json;
    let _log = config.log_file.as_deref().map(log::start).transpose()?;
    let ready = |ready: Ready| match &parent {
        Some(parent) => parent.report(&ServerReport::from(ready)),
        None => say_ready(ready),
    };
    let summary = run(config, shutdown, ready).await?;
    if let Some(parent) = &parent {
        parent.report(&ServerReport::Ended(summary));
    } else if json {
        holo_progress::print_line!("{}", serde_json::to_string(&summary)?);
    }
    Ok(())
}
