//! `holodeck picture`: makes a picture from what a holodeck holds.

use std::{path::PathBuf, time::Instant};

use anyhow::Result;
use holo_net::Shutdown;
use holo_progress::Meter;
use holo_server::Holodeck;
use holo_view::{DriverArgs, LookArgs, ObjectArgs, PictureReport, PointArgs, ViewArgs};
use holodeck::{
    prepare::SMALL_CACHE,
    session::{self, PictureRequest},
    settings::Usage,
    splats::with_splats,
};

use crate::commands::arguments::picture_path;

/// Make a picture from what a holodeck holds, without tracing anything
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck picture room.holo --view bedroom -o view.png\n  \
    holodeck picture room.holo --vp 12.5,0.5,5 --vd 0.7,0.7,0 --vh 60 --size 640x480 -o view.exr\n  \
    holodeck picture room.holo --falsecolor=1:1000 --log --contours -o luminance.png\n  \
    holodeck picture room.holo --object chair.glb@1,2,0,90 -o chair.png")]
pub struct PictureCommand {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// The picture (.exr .hdr .pfm .png)
    #[arg(short, value_name = "FILE", value_parser = picture_path())]
    output: PathBuf,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    driver: DriverArgs,
    #[command(flatten)]
    points: PointArgs,
    #[command(flatten)]
    objects: ObjectArgs,
    #[command(flatten)]
    look: LookArgs,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

/// See [`PictureCommand`].
pub async fn run(args: PictureCommand) -> Result<()> {
    args.driver.check().map_err(Usage)?;
    args.look.check(&args.output).map_err(Usage)?;
    let kept = Holodeck::open_read_only(&args.file, SMALL_CACHE)?.about.exposure;
    let look = args.look.with_kept_exposure(kept);
    let shutdown = Shutdown::new();
    shutdown.on_signals(false)?;
    let (json, quiet) = (args.json, args.quiet);
    let request = PictureRequest {
        driver: with_splats(&args.driver, &args.file)?,
        file: args.file,
        view: args.view,
        points: args.points,
        objects: args.objects,
        has_progress: !quiet && !json,
    };
    let Some((picture, report)) = session::picture(request, shutdown).await? else {
        return Ok(());
    };
    let path = args.output;
    let writing = Instant::now();
    let exposure = look.write(&picture, &path)?;
    let seconds = report.seconds + writing.elapsed().as_secs_f64();
    let report = PictureReport { picture: path, exposure, seconds, ..report };
    if json {
        holo_progress::print_line!("{}", serde_json::to_string(&report)?);
    } else {
        Meter::new(quiet).say(&report.to_string());
    }
    Ok(())
}
