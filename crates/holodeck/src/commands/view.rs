//! `holodeck view` and `replay`: run a viewer, with a server and workers as needed.

use std::path::PathBuf;

use anyhow::{Context, Result};
use holo_net::Shutdown;
use holo_view::{
    BrowserArgs, DriverArgs, LookArgs, ObjectArgs, PointArgs, ViewArgs, WindowRequest,
};
use holodeck::{
    prepare::{self, Edited, OtherScene},
    session::{self, FrontEnd, LiveSession},
    settings::Usage,
    splats::with_splats,
};

use crate::commands::{
    arguments::picture_path, listen_args::ListenArgs, program, scene_args::SceneArgs,
};

/// Options for showing and following a session.
#[derive(clap::Args, Clone)]
pub struct SessionArgs {
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
    #[command(flatten)]
    browser: BrowserArgs,
    /// Open a window, and serve no page
    #[arg(long, conflicts_with_all = ["http", "http_cert", "no_open"])]
    window: bool,
    /// Show nothing: follow a script and write pictures
    #[arg(long, conflicts_with_all = ["http", "http_cert", "no_open", "record", "window"])]
    headless: bool,
    /// Follow the lines of this file, each `SECONDS COMMAND` (`-`: standard input). Commands: view,
    /// picture FILE, object …, sky …, lamp NAME FACTOR, with PART,…, without PART,… (of the render
    /// cache), quit
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Without a script: end after this time, such as 20s
    #[arg(long, value_name = "TIME", default_value = "0", value_parser = holo_view::parse_seconds)]
    time: f64,
    /// Write a picture to this file at the end (.exr .hdr .pfm .png)
    #[arg(short, value_name = "FILE", value_parser = picture_path())]
    output: Option<PathBuf>,
    /// Report every picture as a line of JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

impl SessionArgs {
    /// Returns the viewer's options, for a server's address or the string to join it.
    fn viewer(&self, server: impl ToString) -> holo_view::Config {
        holo_view::Config {
            connect: server.to_string(),
            view: self.view.clone(),
            driver: self.driver.clone(),
            points: self.points.clone(),
            objects: self.objects.clone(),
            look: self.look,
            script: self.script.clone(),
            time: self.time,
            output: self.output.clone(),
            json: self.json,
            quiet: self.quiet,
            with_parent: false,
            crew: None,
        }
    }

    /// Refuses options without any effect. `keeps` is true if traced samples go to a file that
    /// stays, and `example` is a command that has an effect.
    fn check(&self, keeps: bool, example: &str) -> Result<(), Usage> {
        self.driver.check().map_err(Usage)?;
        self.look.look().map_err(Usage)?;
        if !self.headless {
            return self.check_walk(example);
        }
        let fills = keeps && self.time > 0.0;
        if self.script.is_none() && self.output.is_none() && !fills {
            return Err(Usage(format!(
                "this would write nothing: say -o FILE or --script FILE, as in\n  {example}"
            )));
        }
        Ok(())
    }

    /// Refuses options that do not apply to a session in which a person walks.
    fn check_walk(&self, example: &str) -> Result<(), Usage> {
        let said = [
            ("--script", self.script.is_some()),
            ("--time", self.time > 0.0),
            ("-o", self.output.is_some()),
            ("--json", self.json),
        ];
        match said.into_iter().find(|(_, is_said)| *is_said) {
            None => Ok(()),
            Some((option, _)) => Err(Usage(format!(
                "{option} is for sessions in which nobody walks: add --headless, as in\n  {example}"
            ))),
        }
    }

    /// Returns the front end of the session.
    ///
    /// # Errors
    /// If it cannot run here.
    fn front_end(&self, screen: WindowRequest) -> Result<FrontEnd> {
        let front_end = if self.headless {
            FrontEnd::Script
        } else if self.window {
            FrontEnd::Window { record: self.browser.record.clone(), screen }
        } else {
            FrontEnd::Browser(self.browser.clone())
        };
        front_end.check()?;
        Ok(front_end)
    }
}

/// Walk through a scene or a holodeck in a browser or a window, with everything on this machine
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck view room.obj\n  \
    holodeck view room.obj --window\n  \
    holodeck view room.obj --listen 0.0.0.0:7070\n  \
    holodeck view --join holodeck://192.0.2.7:7070/FINGERPRINT/TOKEN\n  \
    holodeck view room.obj --headless --time 20s -o view.png\n  holodeck view room.holo --headless --script walk.txt --size 640x480")]
pub struct ViewCommand {
    /// The scene, or a holodeck to go on with
    #[arg(value_name = "MODEL|FILE.holo")]
    what: Option<PathBuf>,
    /// Keep the samples in this file [default for a scene: forget them at the end]
    #[arg(long, value_name = "FILE.holo")]
    keep: Option<PathBuf>,
    /// Walk through what another machine serves: the string that its server prints
    #[arg(long, value_name = "STRING", conflicts_with_all = ["what", "keep", "listen", "threads", "cache"])]
    join: Option<String>,
    #[command(flatten)]
    listen: ListenArgs,
    #[command(flatten)]
    session: SessionArgs,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// If the file was made of the scene before an edit: go on with the scene as it is now
    #[arg(long, conflicts_with = "join")]
    restart: bool,
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
    /// Memory for beams that are kept at hand, MiB [default: 256]
    #[arg(long, value_name = "MIB", value_parser = holo_server::parse_memory)]
    cache: Option<u64>,
}

/// See [`ViewCommand`].
pub async fn view(mut args: ViewCommand, screen: WindowRequest) -> Result<()> {
    let is_holodeck =
        args.what.as_ref().is_some_and(|path| path.extension().is_some_and(|end| end == "holo"));
    args.session.check(
        is_holodeck || args.keep.is_some() || args.join.is_some(),
        "holodeck view room.obj --headless --time 20s -o view.png",
    )?;
    let front_end = args.session.front_end(screen)?;
    if let Some(server) = &args.join {
        let shutdown = Shutdown::new();
        shutdown.on_signals(false)?;
        let config = args.session.viewer(server);
        return front_end.show(config, shutdown, holo_view::at_once()).await;
    }
    let quiet = args.session.quiet || args.session.json;
    let (listen, program) = (args.listen.into(), program()?);
    if let Some(file) = args.what.as_ref().filter(|_| is_holodeck) {
        let (threads, cache) = (args.threads, args.cache);
        let file = file.clone();
        prepare::check_traced(&file)?;
        if args.restart {
            let again = file.clone();
            tokio::task::spawn_blocking(move || {
                Edited::read(&again, None, &holo_view::SceneChange::default())?.restart(&again)
            })
            .await??;
        }
        let scene = None;
        args.session.driver = with_splats(&args.session.driver, &file)?;
        let session =
            LiveSession { program, file, scene, threads, cache, quiet, listen, front_end };
        return session.run(|address| args.session.viewer(address), super::print_invitation).await;
    }
    let config = args.scene_args.resolve(args.what.as_ref())?;
    // Without a name, samples exist only as long as the session.
    let temporary = tempfile::tempdir().context("making a temporary folder")?;
    let file = args.keep.clone().unwrap_or_else(|| temporary.path().join("session.holo"));
    let (other_scene, shutdown) = (OtherScene::of_option(args.restart), Shutdown::new());
    shutdown.on_signals(false)?;
    prepare::make_unless_ended(&file, &config, other_scene, quiet, &shutdown).await?;
    let (threads, cache) = (args.threads.or(config.threads), args.cache.or(config.cache));
    let scene = Some(config);
    let session = LiveSession { program, file, scene, threads, cache, quiet, listen, front_end };
    session.run(|address| args.session.viewer(address), super::print_invitation).await
}

/// Walk through a holodeck without tracing anything
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck replay room.holo\n  \
    holodeck replay room.holo --headless --script walk.txt")]
pub struct ReplayCommand {
    /// The holodeck
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    #[command(flatten)]
    session: SessionArgs,
}

/// See [`ReplayCommand`].
pub async fn replay(mut args: ReplayCommand, screen: WindowRequest) -> Result<()> {
    args.session.check(false, "holodeck replay room.holo --headless -o view.png")?;
    let front_end = args.session.front_end(screen)?;
    args.session.driver = with_splats(&args.session.driver, &args.file)?;
    session::replay(args.file, front_end, |address| args.session.viewer(address)).await
}
