//! `holodeck export`: static files that draw a holodeck in a browser.

use std::path::PathBuf;

use anyhow::Result;
use holo_progress::{HumanBytes, HumanCount, Meter};
use holodeck::export::{ExportRequest, export};

/// Make a folder that draws a holodeck in any browser, with no server but for files
///
/// Any web server or bucket serves it, such as `python3 -m http.server`. Nothing in it is loaded
/// from elsewhere.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck export room.holo -o site/\n  \
    holodeck export room.holo --single -o room.html")]
pub struct ExportArgs {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// The folder to make, or the file with --single
    #[arg(short, value_name = "FOLDER|FILE.html")]
    output: PathBuf,
    /// Make one HTML file with everything in it; it opens without any server
    #[arg(long)]
    single: bool,
    /// Most splats [default: one for 7 samples, or for 2 if surfaces are drawn as splats; at
    /// most 1700000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1 << 30))]
    most: Option<u64>,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

/// See [`ExportArgs`].
pub fn run(args: ExportArgs) -> Result<()> {
    let mut meter = Meter::new(args.quiet || args.json);
    let (is_single, most) = (args.single, args.most);
    let request = ExportRequest { file: args.file, output: args.output, is_single, most };
    let report = export(&request, &mut |share| meter.show(share, "placing samples"))?;
    if args.json {
        holo_progress::print_line!("{}", serde_json::to_string(&report)?);
        return Ok(());
    }
    meter.say(&format!(
        "{}: {} in {} files, {} splats",
        report.export.display(),
        HumanBytes(report.bytes),
        report.files,
        HumanCount(report.splats.surfels)
    ));
    report.notes.iter().for_each(|note| meter.say(note));
    Ok(())
}
