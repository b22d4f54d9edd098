//! `holodeck fill`: trace a scene into a file with nobody looking.

use std::{ffi::OsString, path::PathBuf, time::Duration};

use anyhow::Result;
use holo_net::Shutdown;

use crate::{
    prepare,
    processes::Server,
    scene_args::{SceneArgs, Usage},
};

/// Trace a scene into a holodeck without anybody looking; called again, it goes on.
///
/// Once the file has enough samples, they are traced again with more paths, four times as many in each sweep over all beams: better
/// rays, not more. Its growth falls to a quarter with each.
///
/// Example: holodeck fill room.obj -o room.holo --time 30m
#[derive(clap::Args)]
pub struct Args {
    /// The scene
    #[arg(value_name = "SCENE.obj")]
    scene: Option<PathBuf>,
    /// The holodeck
    #[arg(short, value_name = "FILE.holo")]
    output: PathBuf,
    /// Stop after so long, such as 30s, 10m or 8h
    #[arg(long, value_name = "TIME", value_parser = holo_server::parse_time)]
    time: Option<Duration>,
    /// Stop once so many samples have been traced, such as 20M, better ones included
    #[arg(long, value_name = "N", value_parser = holo_server::parse_count)]
    samples: Option<u64>,
    /// Samples after which the file has enough, such as 60M, and gets better ones, not more [default: 512 for each beam that sees
    /// something, at least 50M; 0: none more]
    #[arg(long, value_name = "N", value_parser = holo_server::parse_count)]
    enough: Option<u64>,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
    /// Memory for beams kept at hand, MiB [default: 256]
    #[arg(long, value_name = "MIB")]
    cache: Option<u64>,
    /// Trace beams of which no ray can meet anything, too: for comparison
    #[arg(long)]
    no_skip_unseen: bool,
    /// Print a summary as JSON at the end
    #[arg(long)]
    json: bool,
    /// Say less
    #[arg(short, long)]
    quiet: bool,
}

/// See [`Args`].
pub async fn run(args: Args) -> Result<()> {
    let config = args.scene_args.resolve(args.scene.as_ref())?;
    let configured =
        config.time.as_deref().map(holo_server::parse_time).transpose().map_err(Usage)?;
    let time = args.time.or(configured.filter(|_| args.samples.is_none()));
    if time.is_none() && args.samples.is_none() {
        return Err(Usage("how long? Say --time 30m or --samples 20M".into()).into());
    }
    let configured =
        config.enough.as_deref().map(holo_server::parse_count).transpose().map_err(Usage)?;
    let enough = args.enough.or(configured);
    // Only made, checked and closed here: the server is the one who writes.
    drop(prepare::make(&args.output, &config)?);
    let mut arguments: Vec<OsString> =
        vec![args.output.clone().into(), "--fill".into(), "--json".into()];
    if let Some(time) = time {
        arguments.extend(["--time".into(), time.as_secs_f64().to_string().into()]);
    }
    if let Some(samples) = args.samples {
        arguments.extend(["--samples".into(), samples.to_string().into()]);
    }
    if let Some(enough) = enough {
        arguments.extend(["--enough".into(), enough.to_string().into()]);
    }
    if let Some(cache) = args.cache.or(config.cache) {
        arguments.extend(["--cache".into(), cache.to_string().into()]);
    }
    if args.no_skip_unseen {
        arguments.push("--no-skip-unseen".into());
    }
    if args.quiet {
        arguments.push("--quiet".into());
    }
    let shutdown = Shutdown::new();
    shutdown.on_signals(false)?;
    let mut server = Server::start(arguments).await?;
    let mut worker = server.worker(args.threads.or(config.threads), true)?;
    tokio::select! {
        ended = server.process.wait() => ended?,
        // Ctrl-C: the server stores everything and says what it has.
        () = shutdown.wait() => server.process.end().await?,
        // A worker leaves when the server says goodbye; alone, it has failed, and nothing would ever be traced.
        ended = worker.wait() => match ended {
            Ok(()) => server.process.wait().await?,
            Err(error) => {
                server.process.end().await?;
                return Err(error);
            }
        },
    }
    worker.end().await?;
    let lines = server.output.await?;
    let last = lines.last().map(String::as_str).unwrap_or_default();
    if args.json {
        println!("{last}");
    } else if let Ok(summary) = serde_json::from_str::<serde_json::Value>(last) {
        println!(
            "{}: {} samples added, {} made better, {} in all, {} bytes ({} superseded), growing by {:.0} an hour",
            args.output.display(),
            summary["added"],
            summary["better"],
            summary["samples"],
            summary["file_bytes"],
            summary["superseded_bytes"],
            summary["bytes_per_hour"].as_f64().unwrap_or_default()
        );
    }
    Ok(())
}
