//! Traces packets of rays for a holoserver.

use std::process::ExitCode;

use clap::Parser;

/// Trace packets of rays for a holoserver, on all cores of this machine
#[derive(Parser)]
#[command(name = "rtworker", version)]
struct WorkerProgram {
    #[command(flatten)]
    config: holo_rtworker::WorkerConfig,
}

#[tokio::main(worker_threads = 2)]
async fn main() -> ExitCode {
    let ended = holo_rtworker::run_until_signal(WorkerProgram::parse().config).await;
    holo_progress::exit_code("rtworker", ended)
}
