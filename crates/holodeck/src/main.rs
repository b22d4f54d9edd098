//! `holodeck`: what a person types. It starts the other processes by running itself with their name as first argument,
//! so that this one program is enough.

mod compare;
mod config;
mod demo;
mod fill;
mod info;
mod prepare;
mod processes;
mod render;
mod scene_args;
mod view;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// An interactive ray cache: fill a scene's view rays once, walk through it ever after.
#[derive(Parser)]
#[command(
    name = "holodeck",
    version,
    after_help = "Examples:\n  holodeck                                        the bundled scene, everything on this machine\n  holodeck fill room.obj -o room.holo --time 8h   trace overnight\n  holodeck picture room.holo --vp 1,2,1.6 --vd 0,1,0 --vh 60 -o view.png"
)]
struct Program {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    /// Open the bundled scene with everything on this machine, and write pictures as it refines (the default)
    Demo(demo::Args),
    /// Walk through a scene or a holodeck: server, workers and viewer on this machine
    View(view::ViewCommand),
    /// Trace a scene into a holodeck without anybody looking; called again, it goes on
    Fill(fill::Args),
    /// Walk through a holodeck without tracing anything
    Replay(view::ReplayCommand),
    /// A picture from a holodeck, from what is stored
    Picture(view::PictureCommand),
    /// A picture straight from the tracer
    Render(render::Args),
    /// How far a picture is from a reference
    Compare(compare::Args),
    /// What a holodeck holds
    Info(info::InfoArgs),
    /// Read a whole holodeck and check it
    Verify(info::VerifyArgs),
    /// Serve one holodeck to workers and displays (also the program `holoserver`)
    Holoserver(holo_server::Config),
    /// Trace for a holoserver (also the program `rtworker`)
    Rtworker(holo_rtworker::Config),
    /// Show what a holoserver serves (also the program `holoview`)
    Holoview(holo_view::Config),
}

fn main() -> ExitCode {
    // clap ends with status 2 on wrong usage, by itself.
    let command = Program::parse().command.unwrap_or_else(|| Command::Demo(demo::Args::default()));
    let runtime =
        match tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build() {
            Ok(runtime) => runtime,
            Err(error) => {
                eprintln!("holodeck: starting the runtime: {error}");
                return ExitCode::FAILURE;
            }
        };
    let result = runtime.block_on(run(command));
    // A thread that reads standard input would hold up an orderly end for ever.
    runtime.shutdown_background();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("holodeck: {error:#}");
            match error.downcast_ref::<scene_args::Usage>() {
                Some(_) => ExitCode::from(2),
                None => ExitCode::FAILURE,
            }
        }
    }
}

async fn run(command: Command) -> anyhow::Result<()> {
    holo_server::outlive_file_size_limit()?;
    match command {
        Command::Demo(args) => demo::run(args).await,
        Command::View(args) => view::view(args).await,
        Command::Fill(args) => fill::run(args).await,
        Command::Replay(args) => view::replay(args).await,
        Command::Picture(args) => view::picture(args).await,
        Command::Render(args) => render::run(args).await,
        Command::Compare(args) => compare::run(&args),
        Command::Info(args) => info::info(&args),
        Command::Verify(args) => info::verify(&args),
        Command::Holoserver(config) => holo_server::run_until_signal(config).await,
        Command::Rtworker(config) => holo_rtworker::run_until_signal(config).await,
        Command::Holoview(config) => holo_view::run_until_signal(config).await,
    }
}
