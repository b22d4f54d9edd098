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
mod batch;
mod better;
mod cells;
mod claims;
mod coordinator;
mod damage;
mod doors;
mod events;
mod file_size;
mod forget;
mod guard;
mod handshakes;
mod holodeck;
mod light;
mod listen;
mod live;
mod log;
mod mailbox;
mod makers;
mod merge;
mod pace;
mod plausible;
mod progress;
mod recall;
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

use std::{net::SocketAddr, path::PathBuf, sync::Arc, time::Duration};

pub use about::{HolodeckDescription, SceneReading};
use anyhow::Result;
use clap::Args;
pub use file_size::outlive_file_size_limit;
pub use forget::Forgotten;
use holo_net::{Ending, Invitation, Shutdown};
use holo_proto::control::Farewell;
pub use holodeck::{Holodeck, remove_drafts};
pub use light::LightRecords;
use serde::{Deserialize, Serialize};
use tracing::info;

use coordinator::{Coordinator, FillOptions};
use doors::Doors;
use events::ServerEvent;
pub use makers::{MachineList, MadeBy};
pub use merge::Merged;
pub use plausible::RadianceLimits;
use progress::SampleProgress;
pub use progress::superseded_bytes;
pub use schedule::Goal;
use shard::Share;
pub use shard::{BeamList, Shard};
pub use unproven::UnprovenClaims;
pub use unseen::UnseenBeams;

/// Options of `holoserver`.
#[derive(Args, Clone, Debug)]
#[command(
    after_help = "Example:\n  holoserver room.holo --listen 127.0.0.1:7070 --fill --time 30m"
)]
pub struct Config {
    /// The holodeck to serve
    #[arg(value_name = "FILE.holo")]
    pub file: PathBuf,
    /// Where to listen; port 0 takes any free port. The address is printed. If other machines
    /// can reach the address, connections are encrypted, and only peers with the printed string may
    /// connect: workers and displays
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:7070")]
    pub listen: String,
    /// Encrypt connections and ask for a token even on this machine, as for a tunnel
    #[arg(long)]
    pub secure: bool,
    /// The address in the printed string, if others see this machine under another one
    #[arg(long, value_name = "HOST:PORT")]
    pub public: Option<String>,
    /// Folder of the certificate and the tokens [default: holodeck/server in the user's
    /// configuration folder]
    #[arg(long, value_name = "DIR")]
    pub identity: Option<PathBuf>,
    /// A certificate to use in place of the one that is made: a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "key")]
    pub cert: Option<PathBuf>,
    /// The certificate's key, a PEM file
    #[arg(long, value_name = "FILE.pem", requires = "cert")]
    pub key: Option<PathBuf>,
    /// Memory for beams that are kept at hand, MiB
    #[arg(long, value_name = "MIB", default_value_t = 256, value_parser = parse_memory)]
    pub cache: u64,
    /// Fill the file in batch order while no display wants anything
    #[arg(long)]
    pub fill: bool,
    /// End after tracing for so long, such as 30s, 10m or 8h; loading does not count
    #[arg(long, value_name = "TIME", value_parser = parse_time)]
    pub time: Option<Duration>,
    /// Enough samples for the file, such as 60M, or 0 for no new ones. Then known samples are
    /// traced again with more paths [default: 512 for each beam that sees something, at least 50M]
    #[arg(long, value_name = "N", value_parser = parse_count, requires = "fill")]
    pub enough: Option<u64>,
    /// End after so many samples, such as 20M; those traced again count
    #[arg(long, value_name = "N", value_parser = parse_count)]
    pub samples: Option<u64>,
    /// End before the file is longer than this, such as 500MB or 50GB
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    pub disk: Option<u64>,
    /// Fill only the beams of this share, such as 0/8: the first of eight
    #[arg(long, value_name = "I/N", requires = "fill")]
    pub shard: Option<Shard>,
    /// Fill only the beams in this list (made by the program that starts this one)
    #[arg(long, value_name = "FILE", requires = "fill", hide = true)]
    pub beams: Option<PathBuf>,
    /// Only show the file: do not write to it, and take no workers
    #[arg(long, conflicts_with_all = ["fill", "time", "samples", "disk"])]
    pub display_only: bool,
    /// Also trace beams whose rays cannot hit anything, for comparison
    #[arg(long)]
    pub no_skip_unseen: bool,
    /// Append what happens to this file: a JSON object in each line
    #[arg(long, value_name = "FILE")]
    pub log_file: Option<PathBuf>,
    /// Print a summary as JSON at the end
    #[arg(long)]
    pub json: bool,
    /// Print less
    #[arg(short, long)]
    pub quiet: bool,
    /// End when standard input ends (set by the program that starts this one)
    #[arg(long, hide = true)]
    pub with_parent: bool,
}

impl Config {
    /// Returns the defaults for `file`, on any free port.
    pub fn new(file: PathBuf) -> Config {
        Config {
            file,
            listen: "127.0.0.1:0".into(),
            secure: false,
            public: None,
            identity: None,
            cert: None,
            key: None,
            cache: 256,
            fill: false,
            enough: None,
            time: None,
            samples: None,
            disk: None,
            shard: None,
            beams: None,
            display_only: false,
            no_skip_unseen: false,
            log_file: None,
            json: false,
            quiet: true,
            with_parent: false,
        }
    }
}

/// Parses a time such as `30s`, `10m`, `8h`, or plain seconds.
///
/// # Errors
/// If it is none; the text is for people.
pub fn parse_time(text: &str) -> Result<Duration, String> {
    let (number, factor) = match text.char_indices().next_back() {
        Some((at, 's')) => (&text[..at], 1.0),
        Some((at, 'm')) => (&text[..at], 60.0),
        Some((at, 'h')) => (&text[..at], 3600.0),
        _ => (text, 1.0),
    };
    let seconds = number.parse::<f64>().ok().filter(|seconds| *seconds >= 0.0);
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds * factor).ok());
    time.ok_or_else(|| format!("`{text}` is not a time; write 30s, 10m or 8h"))
}

/// Parses a count such as `500k`, `20M`, `1.5G`, or a plain number.
///
/// # Errors
/// If it is none; the text is for people.
pub fn parse_count(text: &str) -> Result<u64, String> {
    let (number, factor) = match text.char_indices().next_back() {
        Some((at, 'k')) => (&text[..at], 1e3),
        Some((at, 'M')) => (&text[..at], 1e6),
        Some((at, 'G')) => (&text[..at], 1e9),
        _ => (text, 1.0),
    };
    let count = number.parse::<f64>().ok().map(|count| count * factor);
    let count = count.filter(|count| (0.0..1e18).contains(count));
    count
        .map(|count| count as u64)
        .ok_or_else(|| format!("`{text}` is not a count; write 500k, 20M or 1G"))
}

/// Units of lengths of files and memory, bytes. Units that end with another one come first.
const BYTE_UNITS: [(&str, f64); 10] = [
    ("KiB", 1024.0),
    ("MiB", 1_048_576.0),
    ("GiB", 1_073_741_824.0),
    ("TiB", 1_099_511_627_776.0),
    ("kB", 1e3),
    ("KB", 1e3),
    ("MB", 1e6),
    ("GB", 1e9),
    ("TB", 1e12),
    ("B", 1.0),
];

/// Most memory that can be stated, MiB: 16 TiB.
const MOST_MEBIBYTES: f64 = 16_777_216.0;

/// Parses a length of files such as `500MB`, `50GiB`, or plain bytes.
///
/// # Errors
/// If it is none; the text is for people.
pub fn parse_size(text: &str) -> Result<u64, String> {
    bytes(text, 1.0)
        .filter(|bytes| (0.0..1e18).contains(bytes))
        .map(|bytes| bytes as u64)
        .ok_or_else(|| format!("`{text}` is not a size; write 500MB, 50GB or 50GiB"))
}

/// Parses an amount of memory, such as `512`, `512MiB` or `2GiB`, and returns it in MiB. A plain
/// number is in MiB.
///
/// # Errors
/// If it is none; the text is for people.
pub fn parse_memory(text: &str) -> Result<u64, String> {
    let mebibyte = 1_048_576.0;
    bytes(text, mebibyte)
        .map(|bytes| (bytes / mebibyte).ceil())
        .filter(|mebibytes| (0.0..=MOST_MEBIBYTES).contains(mebibytes))
        .map(|mebibytes| mebibytes as u64)
        .ok_or_else(|| {
            format!("`{text}` is not an amount of memory; write 512 (MiB) or 2GiB, at most 16TiB")
        })
}

/// Returns the number of bytes in a text with a unit, or with `plain` if it has none.
fn bytes(text: &str, plain: f64) -> Option<f64> {
    let with_unit = |(unit, factor)| Some((text.strip_suffix(unit)?, factor));
    let (number, factor) = BYTE_UNITS.into_iter().find_map(with_unit).unwrap_or((text, plain));
    number.trim().parse::<f64>().ok().map(|number| number * factor)
}

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

/// Where a server takes connections.
#[derive(Clone, Debug)]
pub struct Ready {
    /// On this machine, without encryption.
    pub address: SocketAddr,
    /// From elsewhere, if it does.
    pub outside: Option<Outside>,
}

/// Where a server takes connections from other machines.
#[derive(Clone, Debug)]
pub struct Outside {
    /// The address that it listens at. Others may see this machine under another one.
    pub address: SocketAddr,
    /// What others join with.
    pub invitation: Invitation,
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
            false => Holodeck::open(&path, cache),
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

fn say_ready(ready: Ready) {
    if let Some(Outside { address, invitation }) = ready.outside {
        holo_progress::print_line!("join with {invitation}");
        holo_progress::print_line!("listening for other machines on {address}");
    }
    holo_progress::print_line!("listening on {}", ready.address);
}

/// Runs the whole program: [`run`] until a signal. It prints the address on standard output.
///
/// # Errors
/// As [`run`].
pub async fn run_until_signal(config: Config) -> Result<()> {
    outlive_file_size_limit()?;
    let shutdown = Shutdown::new();
    shutdown.on_signals(config.with_parent)?;
    let json = config.json;
    let _log = config.log_file.as_deref().map(log::start).transpose()?;
    // The first lines on standard output are for people, and for programs that start this one on
    // any free port.
    let summary = run(config, shutdown, say_ready).await?;
    if json {
        holo_progress::print_line!("{}", serde_json::to_string(&summary)?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units_of_ten_and_of_two() {
        for (text, bytes) in [
            ("500MB", 500_000_000),
            ("5MiB", 5 << 20),
            ("1.5 GiB", 3 << 29),
            ("2KiB", 2048),
            ("1TiB", 1 << 40),
            ("3kB", 3000),
            ("7B", 7),
            ("12", 12),
        ] {
            assert_eq!(parse_size(text), Ok(bytes), "{text}");
        }
        for bad in ["", "MiB", "-1MB", "5 apples", "nan", "1e30GB"] {
            assert!(parse_size(bad).unwrap_err().contains("GiB"), "{bad}");
        }
        assert_eq!(parse_memory("256"), Ok(256));
        assert_eq!(parse_memory("2GiB"), Ok(2048));
        assert_eq!(parse_memory("1B"), Ok(1));
        for bad in ["-1", "1e9", "inf", "9e18", "17TiB"] {
            assert!(parse_memory(bad).unwrap_err().contains("16TiB"), "{bad}");
        }
    }
}
