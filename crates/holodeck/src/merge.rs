//! `holodeck merge`: merges several files of one scene into one.

use std::path::PathBuf;

use anyhow::{Context, Result};
use holo_progress::HumanCount;
use holo_server::{Holodeck, Merged};

use crate::prepare::SMALL_CACHE;

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
    let mut total = Merged::default();
    let mut into = None;
    for path in &args.parts {
        let part = Holodeck::open_read_only(path, SMALL_CACHE)?;
        let into = match &into {
            Some(into) => into,
            None if args.into.exists() => into.insert(Holodeck::open(&args.into, SMALL_CACHE)?),
            None => into.insert(part.without_samples(&args.into)?),
        };
        for skipped in part.file.skipped() {
            eprintln!(
                "{}: {} blocks of kind {}, which a later version wrote, are not merged",
                path.display(),
                skipped.blocks,
                skipped.kind
            );
        }
        let doing = || format!("merging {} into {}", path.display(), args.into.display());
        let merged = into.merge(&part).with_context(doing)?;
        if !args.quiet && !args.json {
            holo_progress::print_line!("{}: {}", path.display(), words(&merged));
        }
        total.added += merged.added;
        total.better += merged.better;
        total.known += merged.known;
    }
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
