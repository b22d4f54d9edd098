//! `holodeck`: the program that people start.
//!
//! It starts the other processes by running itself with their name as first argument, so that this
//! one program is enough.

mod commands;
mod memory;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use holo_view::{BrowserArgs, WindowRequest};
use holodeck::{session::FrontEnd, settings::Usage};

use commands::{
    arguments, bake, check, compare, copy, demo, export, fill, forget, import, info, merge,
    optimize, picture, render, sections, splats, status, tokens, view,
};

#[global_allocator]
static ALLOCATOR: memory::AbortingAllocator = memory::AbortingAllocator;

/// Stack of the thread that does the work, bytes: as large as a main thread's on usual systems.
const STACK: usize = 8 << 20;

/// An interactive ray cache: trace a scene's view rays once, and walk through it ever after
#[derive(Parser)]
#[command(
    name = "holodeck",
    version,
    after_help = "Examples:
  holodeck                                        walk through the bundled house
  holodeck --window                               the same, in a window
  holodeck view room.obj                          walk through a scene while it is traced
  holodeck render room.obj                        a picture of a scene, straight from the tracer
  holodeck fill room.obj -o room.holo --time 8h   trace overnight
  holodeck picture room.holo --vp 1,2,1.6 --vd 0,1,0 --vh 60 -o view.png

View options may be written as in Radiance, too: -vtc -vp 1 2 1.6 -vd 0 1 0"
)]
#[command(args_conflicts_with_subcommands = true)]
struct Program {
    /// Walk through the bundled house in a window, instead of a browser
    #[arg(long)]
    window: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    Demo(demo::DemoArgs),
    View(Box<view::ViewCommand>),
    Fill(fill::FillArgs),
    Replay(view::ReplayCommand),
    Picture(picture::PictureCommand),
    Render(render::RenderArgs),
    Sections(sections::SectionsArgs),
    Check(check::CheckArgs),
    Compare(compare::CompareArgs),
    Info(info::InfoArgs),
    Verify(info::VerifyArgs),
    Merge(merge::MergeArgs),
    Optimize(optimize::OptimizeArgs),
    Copy(copy::CopyArgs),
    Forget(forget::ForgetArgs),
    Bake(bake::BakeArgs),
    Splats(splats::SplatsArgs),
    Export(export::ExportArgs),
    Import(import::ImportArgs),
    Status(status::StatusArgs),
    Tokens(tokens::TokensArgs),
    /// Serve one holodeck to workers and displays (also the program `holoserver`)
    Holoserver(holo_server::Config),
    /// Trace for a holoserver (also the program `rtworker`)
    Rtworker(holo_rtworker::WorkerConfig),
    /// Show what a holoserver serves (also the program `holoview`)
    #[command(after_help = "Example:\n  holoview --connect 127.0.0.1:7070 --script walk.txt")]
    Holoview(holo_view::Config),
}

impl Command {
    /// Returns the name under which a command reports errors. The three commands that run as
    /// processes of their own use the processes' names.
    fn speaker(&self) -> &'static str {
        match self {
            Command::Holoserver(_) => "holoserver",
            Command::Rtworker(_) => "rtworker",
            Command::Holoview(_) => "holoview",
            _ => "holodeck",
        }
    }
}

/// Returns the command line's definition. Numbers below zero are values of options, so that an
/// error states the range of the option.
fn command() -> clap::Command {
    fn with_negative_numbers(command: clap::Command) -> clap::Command {
        let takes_values =
            |arg: &clap::Arg| arg.get_action().takes_values() && !arg.is_positional();
        let command = command.mut_args(|arg| match takes_values(&arg) {
            true => arg.allow_negative_numbers(true),
            false => arg,
        });
        command.mut_subcommands(with_negative_numbers)
    }
    with_negative_numbers(Program::command())
}

fn main() -> ExitCode {
    // On wrong usage, clap ends the process with status 2.
    let words = arguments::with_view_options(std::env::args_os());
    let program = command().get_matches_from(words);
    let program = Program::from_arg_matches(&program).unwrap_or_else(|error| error.exit());
    // Windows belong to the main thread, so everything else runs on another one.
    let (screen, desk) = holo_view::desk();
    let work = std::thread::Builder::new().stack_size(STACK).spawn(|| work(program, screen));
    desk.serve();
    match work.map(std::thread::JoinHandle::join) {
        Ok(Ok(code)) => code,
        // The panic has printed its reason.
        Ok(Err(_)) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("holodeck: starting a thread: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Executes the command line, on a separate thread.
fn work(program: Program, screen: WindowRequest) -> ExitCode {
    let speaker = program.command.as_ref().map_or("holodeck", Command::speaker);
    let runtime =
        match tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build() {
            Ok(runtime) => runtime,
            Err(error) => {
                eprintln!("{speaker}: starting the runtime: {error}");
                return ExitCode::FAILURE;
            }
        };
    let result = runtime.block_on(run(program, screen));
    // A thread that reads standard input would delay an orderly end for ever.
    runtime.shutdown_background();
    let is_usage = result.as_ref().is_err_and(|error| error.downcast_ref::<Usage>().is_some());
    let code = holo_progress::exit_code(speaker, result);
    if is_usage { ExitCode::from(2) } else { code }
}

async fn run(program: Program, screen: WindowRequest) -> anyhow::Result<()> {
    holo_server::outlive_file_size_limit()?;
    let Some(command) = program.command else {
        return if program.window {
            demo::walk(FrontEnd::Window { record: None, screen }).await
        } else if demo::has_desktop() {
            demo::walk(FrontEnd::Browser(BrowserArgs::default())).await
        } else {
            demo::run(demo::DemoArgs::default()).await
        };
    };
    match command {
        Command::Demo(args) => demo::run(args).await,
        Command::View(args) => view::view(*args, screen).await,
        Command::Fill(args) => fill::run(args).await,
        Command::Replay(args) => view::replay(args, screen).await,
        Command::Picture(args) => picture::run(args).await,
        Command::Render(args) => render::run(args).await,
        Command::Sections(args) => sections::run(&args),
        Command::Check(args) => check::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Info(args) => info::info(&args),
        Command::Verify(args) => info::verify(&args),
        Command::Merge(args) => merge::run(&args),
        Command::Optimize(args) => optimize::run(&args),
        Command::Copy(args) => copy::run(&args),
        Command::Forget(args) => forget::run(&args),
        Command::Bake(args) => bake::run(&args),
        Command::Splats(args) => splats::run(args),
        Command::Export(args) => export::run(args),
        Command::Import(args) => import::run(&args),
        Command::Status(args) => status::run(args).await,
        Command::Tokens(args) => tokens::run(&args),
        Command::Holoserver(config) => holo_server::run_until_signal(config).await,
        Command::Rtworker(config) => holo_rtworker::run_until_signal(config).await,
        Command::Holoview(config) => holo_view::run_until_signal(config).await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_below_zero_is_refused_with_the_range_of_its_option() {
        for (line, words) in [
            ("render a.obj --bounces -1", "0..="),
            ("render a.obj --spp -4", "1..="),
            ("fill a.obj --paths-per-sample -1", "1..="),
            ("fill a.obj --engine cached", "`gather` takes its place"),
            ("fill a.obj --disk -5", "is not a size"),
            ("fill a.obj --samples -5", "is not a count"),
            ("fill a.obj --max-rooms -1", "at least 1"),
            ("fill a.obj --cache -1", "amount of memory"),
        ] {
            let words_of_line = ["holodeck"].into_iter().chain(line.split(' '));
            let error = command().try_get_matches_from(words_of_line).unwrap_err().to_string();
            assert!(error.contains(words), "{line}: {error}");
        }
        let negative = ["holodeck", "render", "a.obj", "--vp", "-1,2,3"];
        assert!(command().try_get_matches_from(negative).is_ok());
    }

    /// Splits a line at blanks outside double quotes, as a shell does.
    fn shell_words(line: &str) -> Vec<String> {
        let (mut words, mut is_quoted) = (vec![String::new()], false);
        for letter in line.chars() {
            match letter {
                '"' => is_quoted = !is_quoted,
                ' ' if !is_quoted => words.push(String::new()),
                _ => words.last_mut().unwrap().push(letter),
            }
        }
        words
    }

    #[test]
    fn every_command_s_help_has_an_example_that_can_be_parsed() {
        let program = Program::command();
        let mut examples = Vec::new();
        for command in program.get_subcommands() {
            let name = command.get_name();
            let help = command.clone().render_long_help().to_string();
            // Further examples may be other commands that use the result.
            let has_own = help.contains(&format!("Example:\n  holodeck {name}"))
                || help.contains(&format!("Examples:\n  holodeck {name}"));
            let is_program = !help.contains("  holodeck ");
            assert!(help.contains("Example") && (has_own || is_program), "{name}: {help}");
            let lines = help.lines().skip_while(|line| !line.starts_with("Example"));
            examples.extend(lines.map(|line| line.trim().to_owned()));
        }
        for line in examples.iter().filter(|line| !line.starts_with("Example")) {
            let words = shell_words(line.strip_prefix("holodeck ").unwrap_or(line));
            let words = ["holodeck".to_owned()].into_iter().chain(words).map(Into::into);
            if let Err(error) = Program::try_parse_from(arguments::with_view_options(words)) {
                panic!("{line}: {error}");
            }
        }
    }
}
