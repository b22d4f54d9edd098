//! Shows a holodeck that a holoserver serves.

use std::process::ExitCode;

use clap::Parser;

/// Shows a holodeck that a holoserver serves: follows a script and writes pictures.
///
/// Example: holoview --connect 127.0.0.1:7070 --script walk.txt --size 640x480
#[derive(Parser)]
#[command(name = "holoview", version)]
struct Program {
    #[command(flatten)]
    config: holo_view::Config,
}

#[tokio::main(worker_threads = 2)]
async fn main() -> ExitCode {
    let result = holo_view::run_until_signal(Program::parse().config).await;
    holo_progress::exit_code("holoview", result)
}
