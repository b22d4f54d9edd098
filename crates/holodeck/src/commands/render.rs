//! `holodeck render`: traces a picture directly, as a reference for holodecks.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::Result;
use clap::ArgAction;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use holo_net::Shutdown;
use holo_view::{DenoiseArg, LookArgs, Quality, ViewArgs};
use holodeck::{
    render::{RenderRequest, RenderedPicture, WorkLimit, render},
    settings::{Usage, check_units, scene_path},
};

use crate::commands::{arguments::picture_path, scene_args::SceneArgs};

/// Make a picture straight from the tracer
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck render room.obj\n  \
    holodeck render room.obj --vp 1,2,1.6 --vd 0,1,0 --vh 60 --spp 256 -o truth.pfm")]
pub struct RenderArgs {
    /// The scene
    #[arg(value_name = "MODEL")]
    scene: Option<PathBuf>,
    /// The picture (.exr .hdr .pfm .png)
    /// [default: the scene's name with .png, in this folder]
    #[arg(short, value_name = "FILE", value_parser = picture_path())]
    output: Option<PathBuf>,
    #[command(flatten)]
    view: ViewArgs,
    #[command(flatten)]
    look: LookArgs,
    /// Paths per pixel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Trace for this time, such as 60s, with as many paths as fit; loading does not count
    /// [default: 10s]
    #[arg(long, value_name = "TIME", value_parser = holo_server::parse_time, conflicts_with = "spp")]
    time: Option<Duration>,
    /// `cached`: rays that leave curved mirrors and solid glass end in a cube of texels around the
    /// object, as soon as 16 paths have filled a texel. Pictures take less time and have a bias:
    /// reflections are as sharp as the texels, 256 along a side. Not with `--engine gather`
    #[arg(long, value_name = "traced|cached", default_value = "traced", action = ArgAction::Set,
        value_parser = caches())]
    reflections: bool,
    /// Denoise the picture by Open Image Denoise. `auto`: if it is installed; `off`; or the file of
    /// its library. The bias of denoised pictures is unknown
    #[arg(long, value_name = "auto|off|FILE", default_value = "off")]
    denoise: DenoiseArg,
    /// Also write every pixel's standard error to this file, as if its paths were independent. With
    /// `--engine gather`, every other path then uses cells of its own, and the error of cells,
    /// which pixels share, is included
    #[arg(long, value_name = "FILE", value_parser = picture_path())]
    se: Option<PathBuf>,
    /// Also write distances to this file (.exr .pfm): how far what each pixel's middle shows is from
    /// the eye, in scene units. The sky is infinite, and the corners of fisheyes have no number
    #[arg(long, value_name = "FILE", value_parser = picture_path())]
    depth: Option<PathBuf>,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

/// Parses the choice of reflections: true if they are cached.
fn caches() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["traced", "cached"]).map(|choice| choice == "cached")
}

/// The time that a picture is traced by default.
const DEFAULT_TIME: Duration = Duration::from_secs(10);

/// See [`RenderArgs`].
pub async fn run(args: RenderArgs) -> Result<()> {
    let config = args.scene_args.resolve(args.scene.as_ref())?;
    check_units(&config)?;
    let limit = match (args.spp, args.time) {
        (Some(paths), _) => WorkLimit::Paths(paths),
        (None, time) => WorkLimit::Time(time.unwrap_or(DEFAULT_TIME)),
    };
    let output = match &args.output {
        Some(output) => output.clone(),
        None => scene_path(&config)?.with_extension("png").file_name().unwrap_or_default().into(),
    };
    args.look.check(&output).map_err(Usage)?;
    let shutdown = Shutdown::new();
    let request = RenderRequest {
        view: args.view.clone(),
        limit,
        // Load it first, because tracing may take hours.
        denoiser: args.denoise.load(Quality::High)?,
        caches_reflections: args.reflections,
        has_errors: args.se.is_some(),
        has_depths: args.depth.is_some(),
        threads: args.threads.or(config.threads),
        quiet: args.quiet,
        config,
    };
    shutdown.on_signals(false)?;
    let rendered = render(request, &shutdown).await?;
    write(rendered, &args, &output)
}

/// Writes a picture and its standard errors, and reports them.
fn write(rendered: RenderedPicture, args: &RenderArgs, path: &Path) -> Result<()> {
    let RenderedPicture { picture, errors, depths, paths, spp: (least, most), seconds, .. } =
        rendered;
    let exposure = args.look.write(&picture, path)?;
    if let (Some(path), Some(errors)) = (&args.se, errors) {
        errors.write(path)?;
    }
    if let (Some(path), Some(depths)) = (&args.depth, depths) {
        depths.write(path)?;
    }
    let output = path.display();
    if rendered.untraced > 0 {
        eprintln!(
            "{output}: {:.1} % of the pixels were traced before the end; each of the others copies \
             one to its left or above it",
            100.0 * (picture.pixels.len() - rendered.untraced) as f64 / picture.pixels.len() as f64
        );
    }
    if rendered.nonfinite > 0 {
        eprintln!("{} paths were not finite and count as black", rendered.nonfinite);
    }
    let rate = paths as f64 / seconds;
    if args.json {
        let report = serde_json::json!({
            "picture": path, "spp": least, "paths": paths as f64, "seconds": seconds,
            "paths_per_second": rate, "nonfinite_paths": rendered.nonfinite,
            "untraced_pixels": rendered.untraced, "exposure": exposure,
        });
        holo_progress::print_line!("{report}");
    } else if !args.quiet {
        let count = if least == most { most.to_string() } else { format!("{least} to {most}") };
        let rate = rate / 1e6;
        holo_progress::print_line!(
            "{output}: {count} paths per pixel in {seconds:.1} s, {rate:.2} M/s"
        );
        if let Some(factor) = exposure {
            holo_progress::print_line!(
                "{output}: radiance times {factor:.4} (--exposure ={factor:.4})"
            );
        }
    }
    Ok(())
}
