//! `holodeck merge`: merges several files of one scene into one.

use std::path::PathBuf;

use anyhow::Result;
use holo_progress::HumanCount;
use holodeck::files::{Merged, MergedPart, merge};

/// Put the samples of several holodecks of one scene into one
///
/// A sample in several files is stored once, with the most paths. A merge may therefore be
/// repeated.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  holodeck merge room.holo part-0.holo part-1.holo part-2.holo")]
pub struct MergeArgs {
    /// The file that gets all samples; made if it does not exist
    #[arg(value_name = "FILE.holo")]
    into: PathBuf,
    /// The files whose samples it gets; they stay as they are
    #[arg(value_name = "PART.holo", required = true)]
    parts: Vec<PathBuf>,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

/// See [`MergeArgs`].
pub fn run(args: &MergeArgs) -> Result<()> {
    let total = merge(&args.into, &args.parts, |MergedPart { path, merged, skipped }| {
        for skipped in skipped {
            eprintln!(
                "{}: {} blocks of kind {}, which a later version wrote, are not merged",
                path.display(),
                skipped.blocks,
                skipped.kind
            );
        }
        if !args.quiet && !args.json {
            holo_progress::print_line!("{}: {}", path.display(), words(&merged));
        }
    })?;
    if args.json {
        holo_progress::print_line!("{}", serde_json::to_string(&total)?);
    }
    Ok(())
}

fn words(merged: &Merged) -> String {
    let Merged { added, better, known } = *merged;
    let [added, better, known] = [added, better, known].map(HumanCount);
    format!("{added} samples added, {better} made better, {known} were there already")
}
