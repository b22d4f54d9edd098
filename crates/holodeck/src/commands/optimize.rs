//! `holodeck optimize`: writes a file anew with the samples of each beam side by side.

use std::path::PathBuf;

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount};
use holodeck::files::{Optimized, optimize};

/// Write a holodeck anew, so that views are read faster
///
/// The samples of each beam are put side by side, and samples that better ones have replaced are
/// left out. Pictures stay the same. The new file takes the place of the old one once it is
/// complete, so the disk needs room for both, and nothing is lost if the command is ended.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  holodeck optimize room.holo")]
pub struct OptimizeArgs {
    /// The holodeck; nothing else may write to it meanwhile
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// See [`OptimizeArgs`].
pub fn run(args: &OptimizeArgs) -> Result<()> {
    let optimized = optimize(&args.file)?;
    if args.json {
        holo_progress::print_line!("{}", serde_json::to_string(&optimized)?);
        return Ok(());
    }
    let Optimized { samples, superseded, earlier, extents, bytes } = optimized;
    let [from, to] = bytes.map(HumanBytes);
    let [scattered, joined] = extents.map(HumanCount);
    holo_progress::print_line!("{from} -> {to}");
    holo_progress::print_line!(
        "{} samples lie in {joined} places instead of {scattered}",
        HumanCount(samples)
    );
    if superseded > 0 {
        holo_progress::print_line!(
            "{} samples that better ones had replaced are left out",
            HumanCount(superseded)
        );
    }
    if earlier > 0 {
        holo_progress::print_line!(
            "{} samples of the scene before an edit stay as they were",
            HumanCount(earlier)
        );
    }
    Ok(())
}
