//! Serves one holodeck to workers and displays.

use clap::Parser;

/// Serves one holodeck: workers trace for it, displays look at it.
///
/// Example: holoserver room.holo --listen 127.0.0.1:7070 --fill --time 30m
#[derive(Parser)]
#[command(name = "holoserver", version)]
struct Program {
    #[command(flatten)]
    config: holo_server::Config,
}

#[tokio::main(worker_threads = 2)]
async fn main() -> anyhow::Result<()> {
    holo_server::run_until_signal(Program::parse().config).await
}
