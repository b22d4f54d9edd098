//! `holodeck splats`: makes a hierarchy of a holodeck's surfaces, for huge files and for pages.

use std::path::PathBuf;

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount, Meter};
use holodeck::{
    settings::Usage,
    splats::{self, SplatReport, SplatRequest},
};

/// Make splats of a holodeck: discs with the light of all its samples, in a hierarchy
///
/// `--driver splats` draws them. However large the holodeck is, that opens at once.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck splats room.holo\n  \
    holodeck picture room.holo --driver splats -o view.png")]
pub struct SplatsArgs {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// The file to write [default: the holodeck's name with .splats]
    #[arg(short, value_name = "FILE.splats")]
    output: Option<PathBuf>,
    /// Distance between splats, metres [default: as fine as the samples allow, at least 0.005]
    #[arg(long, value_name = "METRES")]
    spacing: Option<f64>,
    /// Most splats; more of them make the spacing larger [default: one for 4 samples]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1 << 30))]
    most: Option<u64>,
    /// Find surfaces by the samples alone, even though the holodeck has its scene
    #[arg(long)]
    ignore_scene: bool,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

/// See [`SplatsArgs`].
pub fn run(args: SplatsArgs) -> Result<()> {
    let is_length = |spacing: &f64| spacing.is_finite() && *spacing > 0.0;
    if args.spacing.is_some_and(|spacing| !is_length(&spacing)) {
        return Err(Usage("--spacing is a length above 0".to_owned()).into());
    }
    let request = SplatRequest {
        output: args.output.unwrap_or_else(|| splats::beside(&args.file)),
        file: args.file,
        spacing: args.spacing,
        most: args.most,
        ignores_scene: args.ignore_scene,
    };
    let mut meter = Meter::new(args.quiet || args.json);
    let report = splats::make(&request, &mut |share| meter.show(share, "placing samples"))?;
    if args.json {
        holo_progress::print_line!("{}", serde_json::to_string(&report)?);
    } else {
        meter.say(&words(&report));
    }
    Ok(())
}

fn words(report: &SplatReport) -> String {
    format!(
        "{}: {}, {} splats of {} samples, {:.4} units apart, {} nodes in {} levels; {} samples hit \
         nothing, {} lie on no surface; {:.1} s",
        report.splats.display(),
        HumanBytes(report.bytes),
        HumanCount(report.surfels),
        HumanCount(report.samples),
        report.spacing,
        HumanCount(report.nodes),
        report.levels,
        HumanCount(report.misses),
        HumanCount(report.unplaced),
        report.reading_seconds + report.building_seconds
    )
}
