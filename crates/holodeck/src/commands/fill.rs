//! `holodeck fill`: traces a scene into a file without a viewer.

use std::{path::PathBuf, time::Duration};

use anyhow::Result;
use holo_net::Shutdown;
use holo_progress::{HumanBytes, HumanCount};
use holo_server::{Shard, Summary};
use holodeck::{
    config::HolodeckConfig,
    fill::{FillRequest, fill},
    prepare::OtherScene,
    settings::{Usage, scene_path},
};

use crate::commands::{listen_args::ListenArgs, program, scene_args::SceneArgs};

/// Trace a scene into a holodeck without a viewer; run again, it continues
///
/// Once the file has enough samples, they are traced again with more paths: four times as many in
/// each sweep over all beams. The samples get better, and the file's growth falls to a quarter each
/// time.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck fill room.obj -o room.holo --time 30m\n  \
    holodeck fill room.obj -o part-0.holo --time 8h --shard 0/8\n  \
    holodeck fill room.obj --views tour.vf --disk 50GB\n  \
    holodeck fill statue.obj -o statue.holo --exterior --sky 1,1,1 --samples 20M")]
pub struct FillArgs {
    /// The scene
    #[arg(value_name = "MODEL")]
    scene: Option<PathBuf>,
    /// The holodeck [default: the scene's name with .holo, in this folder]
    #[arg(short, value_name = "FILE.holo")]
    output: Option<PathBuf>,
    /// Stop after tracing for this time, such as 30s, 10m or 8h; loading does not count [default:
    /// 1m if neither --samples nor --disk is given]
    #[arg(long, value_name = "TIME", value_parser = holo_server::parse_time)]
    time: Option<Duration>,
    /// Stop after this many samples, such as 20M; those traced again count
    #[arg(long, value_name = "N", value_parser = holo_server::parse_count)]
    samples: Option<u64>,
    /// Stop before the file is longer than this, such as 500MB or 50GB
    #[arg(long, value_name = "SIZE", value_parser = holo_server::parse_size)]
    disk: Option<u64>,
    /// Fill only what these views see: a file with one view in each line, as in Radiance. Views
    /// that do not state both angles are taken for 1280 by 720 pixels
    #[arg(long, value_name = "FILE")]
    views: Option<PathBuf>,
    /// Enough samples for the file, such as 60M, or 0 for no new ones. Then known samples are
    /// traced again with more paths [default: 512 for each beam that sees something, at least 50M]
    #[arg(long, value_name = "N", value_parser = holo_server::parse_count)]
    enough: Option<u64>,
    /// Fill only the beams of this share, such as 0/8: the first of eight. `holodeck merge` puts
    /// the files of all shares together
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// If the file was made of the scene before an edit: go on with the scene as it is now
    #[arg(long)]
    restart: bool,
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
    /// Memory for beams that are kept at hand, MiB [default: 256]
    #[arg(long, value_name = "MIB", value_parser = holo_server::parse_memory)]
    cache: Option<u64>,
    #[command(flatten)]
    listen: ListenArgs,
    /// Also trace beams whose rays cannot hit anything, for comparison
    #[arg(long)]
    no_skip_unseen: bool,
    /// Print a summary as JSON at the end
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

/// The time that a file is filled by default.
const DEFAULT_TIME: Duration = Duration::from_secs(60);

/// See [`FillArgs`].
pub async fn run(args: FillArgs) -> Result<()> {
    let config = args.scene_args.resolve(args.scene.as_ref())?;
    let (json, request) = (args.json, request(args, config)?);
    let shutdown = Shutdown::new();
    shutdown.on_signals(false)?;
    let filled = fill(&request, &shutdown, super::print_invitation).await?;
    if let Some(summary) = filled {
        if json {
            holo_progress::print_line!("{}", serde_json::to_string(&summary)?);
        } else {
            let file = request.file.display();
            holo_progress::print_line!("{file}: {}", summary_words(&summary));
        }
    }
    Ok(())
}

/// Returns the fill that options and configuration ask for.
fn request(args: FillArgs, config: HolodeckConfig) -> Result<FillRequest> {
    let configured =
        config.time.as_deref().map(holo_server::parse_time).transpose().map_err(Usage)?;
    let has_end = args.samples.is_some() || args.disk.is_some();
    let time = args.time.or(configured.or(Some(DEFAULT_TIME)).filter(|_| !has_end));
    let enough =
        config.enough.as_deref().map(holo_server::parse_count).transpose().map_err(Usage)?;
    let file = match args.output {
        Some(output) => output,
        None => scene_path(&config)?.with_extension("holo").file_name().unwrap_or_default().into(),
    };
    Ok(FillRequest {
        other_scene: OtherScene::of_option(args.restart),
        listen: args.listen.into(),
        time,
        samples: args.samples,
        disk: args.disk,
        enough: args.enough.or(enough),
        shard: args.shard,
        views: args.views,
        threads: args.threads.or(config.threads),
        cache: args.cache.or(config.cache),
        traces_unseen: args.no_skip_unseen,
        quiet: args.quiet,
        ..FillRequest::new(program()?, file, config)
    })
}

/// Returns the summary of a fill, for people.
fn summary_words(summary: &Summary) -> String {
    format!(
        "{} samples added, {} made better, {} in all; {} ({} superseded), growing by about {}/h",
        HumanCount(summary.added),
        HumanCount(summary.better),
        HumanCount(summary.samples),
        HumanBytes(summary.file_bytes),
        HumanBytes(summary.superseded_bytes),
        HumanBytes(summary.bytes_per_hour as u64)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_numbers_with_units() {
        let summary = Summary {
            added: 1_234_567,
            better: 0,
            samples: 2_000_000,
            file_bytes: 300 << 20,
            superseded_bytes: 5 << 20,
            bytes_per_hour: 4_238_517_257.0,
            seconds: 60.0,
        };
        let words = summary_words(&summary);
        assert!(words.contains("1,234,567 samples added"), "{words}");
        assert!(words.contains("300.00 MiB (5.00 MiB superseded)"), "{words}");
        assert!(words.contains("growing by about 3.95 GiB/h"), "{words}");
    }
}
