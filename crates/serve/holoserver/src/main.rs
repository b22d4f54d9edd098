//! Serves one holodeck to workers and displays.

use std::process::ExitCode;

use clap::Parser;

/// Serve one holodeck: workers trace for it, displays look at it
#[derive(Parser)]
#[command(name = "holoserver", version)]
struct ServerProgram {
    #[command(flatten)]
    config: holo_server::Config,
}

#[tokio::main(worker_threads = 2)]
async fn main() -> ExitCode {
    holo_progress::exit_code(
        "holoserver",
        holo_server::run_until_signal(ServerProgram::parse().config).await,
    )
}
