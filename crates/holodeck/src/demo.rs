//! `holodeck` alone: the bundled scene, with everything on this machine.

use std::{fmt::Write, path::PathBuf};

use anyhow::{Context, Result};
use holo_proto::control::Engine;
use holo_scenes::Bundled;
use holo_view::{DriverArgs, PointArgs, ViewArgs};

use crate::{config::Config, prepare, view::LiveSession};

/// Open the bundled scene with everything on this machine, and write pictures as it refines.
///
/// Example: holodeck demo --time 60s
#[derive(clap::Args)]
pub struct Args {
    /// How long to trace
    #[arg(long, value_name = "TIME", default_value = "20s", value_parser = holo_view::parse_seconds)]
    time: f64,
    /// Where scene, holodeck and pictures go
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Size of the pictures
    #[arg(long, value_name = "WxH", default_value = "640x360", value_parser = holo_view::parse_size)]
    size: (u32, u32),
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
}

impl Default for Args {
    fn default() -> Args {
        Args { time: 20.0, out: "demo".into(), size: (640, 360), threads: None }
    }
}

/// When pictures are written, seconds.
const PICTURES: [f64; 9] = [1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0, 600.0];

/// See [`Args`].
pub async fn run(args: Args) -> Result<()> {
    let out = args.out.display();
    std::fs::create_dir_all(&args.out).with_context(|| format!("making {out}"))?;
    let written = holo_scenes::write(Bundled::Interior, &args.out)
        .with_context(|| format!("writing to {out}"))?;
    println!("scene: {}", written.obj.display());
    let mut config = Config::read(&written.config)?;
    // Records of so many small surfaces take longer than a demonstration does.
    config.engine = Some(Engine::Path);
    let file = args.out.join("interior.holo");
    // A demonstration shows how a picture comes about: from nothing, every time.
    if file.exists() {
        std::fs::remove_file(&file).with_context(|| format!("removing {}", file.display()))?;
    }
    drop(prepare::make(&file, &config)?);
    let mut script = String::new();
    for seconds in PICTURES.into_iter().filter(|&seconds| seconds < args.time) {
        writeln!(
            script,
            "{seconds} picture {}",
            args.out.join(format!("{seconds:03}s.png")).display()
        )?;
    }
    writeln!(script, "{} quit", args.time)?;
    let path = args.out.join("script.txt");
    std::fs::write(&path, script).with_context(|| format!("writing {}", path.display()))?;
    let last = args.out.join("last.png");
    let session = LiveSession { file: file.clone(), threads: args.threads, cache: None };
    session
        .run(|address| holo_view::Config {
            connect: address.to_string(),
            view: ViewArgs { size: args.size, ..ViewArgs::default() },
            driver: DriverArgs::default(),
            points: PointArgs::default(),
            script: Some(path),
            time: 0.0,
            output: Some(last.clone()),
            json: false,
            quiet: false,
            with_parent: false,
        })
        .await?;
    println!("the pictures are in {out}; the last is {}", last.display());
    println!(
        "from another place, without tracing: holodeck picture {} --view NAME -o view.png",
        file.display()
    );
    let names: Vec<&str> = config.view.iter().map(|view| view.name.as_str()).collect();
    println!("where NAME is one of {}", names.join(", "));
    Ok(())
}
