//! Options of the worker.

use std::path::PathBuf;

use clap::Args;

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
    /// Folder for scenes that servers have sent, and for what is prepared of them [default:
    /// holodeck/scenes in the user's cache folder]
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
    /// Report to the program that started this one. Standard input is the link to it
    #[arg(long, hide = true, requires = "with_parent")]
    pub reports: bool,
}
