//! `holodeck compare`: how far a picture is from a reference.

use std::path::PathBuf;

use anyhow::{Context, Result};
use holo_picture::Picture;
use serde::Serialize;

/// How far a picture is from a reference; exposures are divided out.
///
/// Example: holodeck compare view.pfm reference.pfm --se view_se.pfm --reference-se reference_se.pfm
#[derive(clap::Args)]
pub struct Args {
    /// The picture (.exr .hdr .pfm)
    picture: PathBuf,
    /// What it should be
    reference: PathBuf,
    /// Standard errors of the picture's pixels, as `render --se` writes them
    #[arg(long, value_name = "FILE")]
    se: Option<PathBuf>,
    /// Standard errors of the reference's pixels
    #[arg(long, value_name = "FILE")]
    reference_se: Option<PathBuf>,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    measures: holo_picture::Measures,
    /// Half the width of the bias' 99 % confidence interval.
    #[serde(skip_serializing_if = "Option::is_none")]
    bias_99: Option<f64>,
}

/// See [`Args`].
pub fn run(args: &Args) -> Result<()> {
    let read = |path: &PathBuf| Picture::read(path).with_context(|| format!("reading {}", path.display()));
    let (picture, reference) = (read(&args.picture)?, read(&args.reference)?);
    let measures = holo_picture::compare(&picture, &reference)?;
    let picture_se = args.se.as_ref().map(read).transpose()?;
    let reference_se = args.reference_se.as_ref().map(read).transpose()?;
    let bias_99 = match (&picture_se, &reference_se) {
        (None, None) => None,
        _ => {
            let interval =
                holo_picture::bias_interval(&picture, picture_se.as_ref(), &reference, reference_se.as_ref())?;
            Some(interval.1)
        }
    };
    if args.json {
        println!("{}", serde_json::to_string(&Report { measures, bias_99 })?);
        return Ok(());
    }
    match bias_99 {
        Some(half) => println!("{measures} bias_99=±{half:.5}"),
        None => println!("{measures}"),
    }
    Ok(())
}
