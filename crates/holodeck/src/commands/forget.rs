//! `holodeck forget`: removes the samples of some workers from a file, and what has their light.

use std::path::PathBuf;

use anyhow::Result;
use holo_progress::HumanCount;
use holodeck::files::{Forgotten, forget};

/// Remove the samples of some workers from a holodeck
///
/// `holodeck info` lists the workers of a file and their numbers; `holodeck status` names those
/// that were dropped. Samples in which other workers used their surface light go as well. A later
/// fill traces the removed samples again.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck forget room.holo --worker 3\n  \
    holodeck forget room.holo --token GkdS3h6pXzU")]
pub struct ForgetArgs {
    /// The holodeck; nothing else may write to it meanwhile
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// The number of a worker; may be repeated. 0 stands for all unknown workers
    #[arg(long, value_name = "N", required_unless_present = "token")]
    worker: Vec<u16>,
    /// The name of a token, for all workers of the machines that joined with it; may be repeated
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    token: Vec<String>,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// See [`ForgetArgs`].
pub fn run(args: &ForgetArgs) -> Result<()> {
    let forgotten = forget(&args.file, &args.worker, &args.token)?;
    if args.json {
        holo_progress::print_line!("{}", serde_json::to_string(&forgotten)?);
        return Ok(());
    }
    let Forgotten { samples, samples_of_others, unseen, cells, left } = forgotten;
    holo_progress::print_line!(
        "{} samples removed, {} are left",
        HumanCount(samples),
        HumanCount(left)
    );
    if samples_of_others > 0 {
        holo_progress::print_line!(
            "{} of the removed samples are of other workers, which used its surface light",
            HumanCount(samples_of_others)
        );
    }
    if unseen > 0 {
        holo_progress::print_line!(
            "{} beams that see nothing must be found again",
            HumanCount(unseen)
        );
    }
    if cells > 0 {
        holo_progress::print_line!(
            "{} cells of surface light must be made again",
            HumanCount(cells)
        );
    }
    Ok(())
}
