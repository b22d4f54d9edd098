//! `holodeck compare`: measures the difference between a picture and a reference.

use std::path::PathBuf;

use anyhow::Result;
use holo_picture::Picture;
use serde::Serialize;

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

#[derive(Serialize)]
struct ComparisonReport {
    #[serde(flatten)]
    measures: holo_picture::Measures,
    /// The worst block's error as displayed, clipped at white.
    worst_block_shown: f64,
    /// The largest growth of a block's error as displayed, since the earlier picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_block_away: Option<f64>,
    /// Half the width of the 99 % confidence interval of the bias.
    #[serde(skip_serializing_if = "Option::is_none")]
    bias_99: Option<f64>,
    /// The worst block's error beyond its noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_block_beyond_noise: Option<f64>,
}

/// See [`CompareArgs`].
pub fn run(args: &CompareArgs) -> Result<()> {
    let read = |path: &PathBuf| Picture::read(path);
    let (picture, reference) = (read(&args.picture)?, read(&args.reference)?);
    let measures = holo_picture::compare(&picture, &reference)?;
    let worst_block_shown = holo_picture::worst_block_shown(&picture, &reference)?;
    let before = args.before.as_ref().map(read).transpose()?;
    let away = before.map(|before| holo_picture::worst_block_away(&picture, &before, &reference));
    let worst_block_away = away.transpose()?;
    let picture_se = args.se.as_ref().map(read).transpose()?;
    let reference_se = args.reference_se.as_ref().map(read).transpose()?;
    let (se, reference_se) = (picture_se.as_ref(), reference_se.as_ref());
    let (bias_99, worst_block_beyond_noise) = match se.or(reference_se) {
        None => (None, None),
        Some(_) => (
            Some(holo_picture::bias_interval(&picture, se, &reference, reference_se)?.1),
            Some(holo_picture::worst_block_beyond_noise(&picture, se, &reference, reference_se)?),
        ),
    };
    if args.json {
        holo_progress::print_line!(
            "{}",
            serde_json::to_string(&ComparisonReport {
                measures,
                worst_block_shown,
                worst_block_away,
                bias_99,
                worst_block_beyond_noise
            })?
        );
        return Ok(());
    }
    let mut text = format!("{measures} worst_block_shown={worst_block_shown:.5}");
    if let Some(away) = worst_block_away {
        text += &format!(" worst_block_away={away:.5}");
    }
    if let Some((half, worst)) = bias_99.zip(worst_block_beyond_noise) {
        text += &format!(" bias_99=±{half:.5} worst_block_beyond_noise={worst:.5}");
    }
    holo_progress::print_line!("{text}");
    Ok(())
}
