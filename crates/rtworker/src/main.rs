//! Traces packets of rays for a holoserver.

use clap::Parser;

/// Traces packets of rays for a holoserver, on all cores of this machine.
///
/// Example: rtworker --connect 127.0.0.1:7070 --threads 4
#[derive(Parser)]
#[command(name = "rtworker", version)]
struct Program {
    #[command(flatten)]
    config: holo_rtworker::Config,
}

#[tokio::main(worker_threads = 2)]
async fn main() -> anyhow::Result<()> {
    holo_rtworker::run_until_signal(Program::parse().config).await
}
