//! `holodeck compare`: measures the difference between a picture and a reference.

use std::path::PathBuf;

use anyhow::Result;
use holo_picture::Picture;
use holodeck::compare::{ComparedPictures, compare};

/// Measure the difference between a picture and a reference; exposures are divided out
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck compare view.pfm truth.pfm\n  \
    holodeck compare view.pfm truth.pfm --se view_se.pfm --reference-se truth_se.pfm")]
pub struct CompareArgs {
    /// The picture (.exr .hdr .pfm)
    picture: PathBuf,
    /// The picture that it should be
    reference: PathBuf,
    /// Standard errors of the picture's pixels, as `render --se` writes them
    #[arg(long, value_name = "FILE")]
    se: Option<PathBuf>,
    /// Standard errors of the reference's pixels
    #[arg(long, value_name = "FILE")]
    reference_se: Option<PathBuf>,
    /// An earlier picture of the same view: also report how much worse the worst block became
    #[arg(long, value_name = "FILE")]
    before: Option<PathBuf>,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// See [`CompareArgs`].
pub fn run(args: &CompareArgs) -> Result<()> {
    let read = |path: &Option<PathBuf>| path.as_ref().map(Picture::read).transpose();
    let (picture, reference) = (Picture::read(&args.picture)?, Picture::read(&args.reference)?);
    let (se, reference_se) = (read(&args.se)?, read(&args.reference_se)?);
    let before = read(&args.before)?;
    let found = compare(&ComparedPictures {
        picture: &picture,
        reference: &reference,
        standard_errors: se.as_ref(),
        reference_errors: reference_se.as_ref(),
        before: before.as_ref(),
    })?;
    if args.json {
        holo_progress::print_line!("{}", serde_json::to_string(&found)?);
        return Ok(());
    }
    let mut text = format!("{} worst_block_shown={:.5}", found.measures, found.worst_block_shown);
    if let Some(away) = found.worst_block_away {
        text += &format!(" worst_block_away={away:.5}");
    }
    if let Some((half, worst)) = found.bias_99.zip(found.worst_block_beyond_noise) {
        text += &format!(" bias_99=±{half:.5} worst_block_beyond_noise={worst:.5}");
    }
    holo_progress::print_line!("{text}");
    Ok(())
}
