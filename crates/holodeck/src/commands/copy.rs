//! `holodeck copy`: copies a file's rays into other sections.

use std::path::PathBuf;

use anyhow::Result;
use holo_progress::HumanCount;
use holodeck::{
    config::{HolodeckConfig, Obstructions, SectionTable},
    files::{Reframed, copy},
};

use crate::commands::scene_args::{obstructions_parser, parse_section};

/// Copy the rays of a holodeck into a new one with other sections
///
/// A ray is copied if a new section can store it: if its own rays begin between where the old ray
/// began and what it hit. The rest is traced again by a fill of the new file. The old file stays
/// as it is.
#[derive(clap::Args)]
#[command(after_help = "Example:
  holodeck copy room.holo --section \"0,0,0 4,0,0 0,5,0 0,0,2.6 16,20,10\" -o finer.holo")]
pub struct CopyArgs {
    /// The holodeck whose rays are copied
    #[arg(value_name = "OLD.holo")]
    file: PathBuf,
    /// A section of the new file: origin, three axes and, if wanted, the grid. May be repeated
    #[arg(long, value_name = "\"OX,OY,OZ AX,AY,AZ BX,BY,BZ CX,CY,CZ [NX,NY,NZ]\"", value_parser = parse_section, allow_hyphen_values = true, required = true)]
    section: Vec<SectionTable>,
    /// Make sections to look into from outside, not to look out of
    #[arg(long)]
    exterior: bool,
    /// Whether objects inside sections are visible [default: auto]
    #[arg(long, value_parser = obstructions_parser())]
    obstructions: Option<Obstructions>,
    /// The new file
    #[arg(short, long, value_name = "NEW.holo")]
    output: PathBuf,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// See [`CopyArgs`].
pub fn run(args: &CopyArgs) -> Result<()> {
    let mut section = args.section.clone();
    section.iter_mut().for_each(|section| section.exterior |= args.exterior);
    let obstructions = args.obstructions;
    let config = HolodeckConfig { section, obstructions, ..HolodeckConfig::default() };
    let reframed = copy(&args.file, &args.output, &config)?;
    if args.json {
        holo_progress::print_line!("{}", serde_json::to_string(&reframed)?);
        return Ok(());
    }
    let Reframed { samples, kept, stored, share } = reframed;
    holo_progress::print_line!(
        "{} of {} samples kept ({:.1} %)",
        HumanCount(kept),
        HumanCount(samples),
        100.0 * share
    );
    if stored > kept {
        holo_progress::print_line!(
            "{} samples are stored, because rays may cross several sections",
            HumanCount(stored)
        );
    }
    Ok(())
}
