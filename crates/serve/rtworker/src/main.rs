//! Traces packets of rays for a holoserver.

use std::process::ExitCode;

use clap::Parser;

/// Trace packets of rays for a holoserver, on all cores of this machine
#[derive(Parser)]
#[command(name = "rtworker", version)]
struct Program {
    #[command(flatten)]
    config: holo_rtworker::Config,
}

#[tokio::main(worker_threads = 2)]
async fn main() -> ExitCode {
    let ended = holo_rtworker::run_until_signal(Program::parse().config).await;
    holo_progress::exit_code("rtworker", ended)
}
