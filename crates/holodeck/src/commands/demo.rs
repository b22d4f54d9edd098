//! `holodeck` without a command: shows the bundled scene, with all processes on this machine.

use std::{
    fmt::Write,
    io::IsTerminal,
    net::SocketAddr,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};
use holo_scenes::Bundled;
use holo_view::{DriverArgs, LookArgs, ObjectArgs, PointArgs, ViewArgs};
use holodeck::{
    config::{HolodeckConfig, ViewTable},
    listening::ListenOptions,
    prepare::{self, OtherScene},
    session::{FrontEnd, LiveSession},
};

use crate::commands::{print_invitation, program};

/// Trace the bundled house with everything on this machine, and write pictures as it refines
#[derive(clap::Args)]
#[command(after_help = "Example:\n  holodeck demo --time 60s --size 1280x720")]
pub struct DemoArgs {
    /// Time to trace: two thirds for the first room, the rest for the others
    #[arg(long, value_name = "TIME", default_value = "30s", value_parser = holo_view::parse_seconds)]
    time: f64,
    /// Folder for the scene, the holodeck and the pictures
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Size of the pictures
    #[arg(long, value_name = "WxH", default_value = "640x360", value_parser = holo_view::parse_size)]
    size: (u32, u32),
    /// Threads that trace [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
}

impl Default for DemoArgs {
    fn default() -> DemoArgs {
        DemoArgs { time: 30.0, out: "demo".into(), size: (640, 360), threads: None }
    }
}

/// Times of the first room's pictures, in seconds after its first ray.
const PICTURES: [f64; 9] = [1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0, 600.0];

/// Share of the time for the first room.
const FIRST_ROOM: f64 = 2.0 / 3.0;

/// Returns true if a person sits before a screen that can show a browser.
pub fn has_desktop() -> bool {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let has_screen =
        cfg!(any(windows, target_os = "macos")) || is_set("DISPLAY") || is_set("WAYLAND_DISPLAY");
    has_screen && std::io::stdout().is_terminal()
}

/// Walks through the bundled house. Its file is kept, so that the next walk begins with all its
/// samples.
pub async fn walk(front_end: FrontEnd) -> Result<()> {
    front_end.check()?;
    let out = DemoArgs::default().out;
    let config = house(&out)?;
    let file = out.join("interior.holo");
    drop(prepare::make(&file, &config, OtherScene::Refuse, true)?);
    eprintln!("everything is kept in {}", file.display());
    let listen = ListenOptions::default();
    let session = LiveSession {
        program: program()?,
        file,
        scene: Some(config),
        threads: None,
        cache: None,
        quiet: true,
        listen,
        front_end,
    };
    session.run(|address| viewer(address, None, None), print_invitation).await
}

/// Writes the bundled house to a folder, with a teapot to carry into it. Returns the house's
/// configuration.
fn house(folder: &Path) -> Result<HolodeckConfig> {
    let name = folder.display();
    std::fs::create_dir_all(folder).with_context(|| format!("making {name}"))?;
    let written = holo_scenes::write(Bundled::Interior, folder)
        .with_context(|| format!("writing to {name}"))?;
    holo_scenes::write_teapot(folder).with_context(|| format!("writing to {name}"))?;
    HolodeckConfig::read(&written.config)
}

fn viewer(
    address: SocketAddr,
    size: Option<(u32, u32)>,
    script: Option<PathBuf>,
) -> holo_view::Config {
    holo_view::Config {
        connect: address.to_string(),
        view: ViewArgs { size, ..ViewArgs::default() },
        driver: DriverArgs::default(),
        points: PointArgs::default(),
        objects: ObjectArgs::default(),
        look: LookArgs::default(),
        script,
        time: 0.0,
        output: None,
        json: false,
        quiet: false,
        with_parent: false,
        crew: None,
    }
}

/// See [`DemoArgs`].
pub async fn run(args: DemoArgs) -> Result<()> {
    let config = house(&args.out)?;
    holo_progress::print_line!("scene: {}", args.out.join("interior.obj").display());
    let file = args.out.join("interior.holo");
    // A demonstration shows how a picture emerges, so it always begins without samples.
    if file.exists() {
        std::fs::remove_file(&file).with_context(|| format!("removing {}", file.display()))?;
    }
    drop(prepare::make(&file, &config, OtherScene::Refuse, false)?);
    let path = args.out.join("script.txt");
    std::fs::write(&path, script(&config.view, args.time, &args.out))
        .with_context(|| format!("writing {}", path.display()))?;
    let session = LiveSession {
        program: program()?,
        file: file.clone(),
        scene: None,
        threads: args.threads,
        cache: None,
        quiet: false,
        listen: ListenOptions::default(),
        front_end: FrontEnd::Script,
    };
    let size = Some(args.size);
    session.run(|address| viewer(address, size, Some(path)), print_invitation).await?;
    let names: Vec<&str> = config.view.iter().map(|view| view.name.as_str()).collect();
    holo_progress::print_line!("{}", farewell(&args.out, &file, &names));
    Ok(())
}

/// Returns the session's script.
///
/// The first view gets [`FIRST_ROOM`] of the time, with pictures named by their seconds. The others
/// share the rest, with one picture each.
fn script(views: &[ViewTable], time: f64, out: &Path) -> String {
    let mut script = String::new();
    let others = views.len().saturating_sub(1);
    let first = if others == 0 { time } else { time * FIRST_ROOM };
    let other = (time - first) / others.max(1) as f64;
    for (index, view) in views.iter().enumerate() {
        // A view begins when the time of the previous one is over.
        let begin = [0.0, first, other][index.min(2)];
        // Writing to a text cannot fail.
        let _ = writeln!(script, "{begin} view {}", view.to_options());
        if index == 0 {
            // The picture at the end has the room's own name.
            for seconds in PICTURES.into_iter().filter(|&seconds| seconds <= first) {
                let picture = out.join(format!("{seconds:03}s.png"));
                let _ = writeln!(script, "{seconds} picture {}", picture.display());
            }
        }
        let end = if index == 0 { first } else { other };
        let picture = out.join(format!("{}.png", view.name));
        let _ = writeln!(script, "{end} picture {}", picture.display());
    }
    let _ = writeln!(script, "{} quit", if others == 0 { first } else { other });
    script
}

/// Returns a text about the results and about what to do with them.
fn farewell(out: &Path, file: &Path, names: &[&str]) -> String {
    format!(
        "pictures in {}: of the first room after 1 s of tracing (001s.png), 2 s and so on, \
         and one of each room ({})\n\
         now look from elsewhere, without tracing: holodeck picture {} --view NAME -o view.png\n\
         where NAME is one of {}\n\
         or walk through it in a browser: holodeck view {}",
        out.display(),
        names.iter().map(|name| format!("{name}.png")).collect::<Vec<_>>().join(", "),
        file.display(),
        names.join(", "),
        file.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(name: &str) -> ViewTable {
        let (vp, vd) = ([1.0, 2.0, 3.0], [0.0, 1.0, 0.0]);
        let none = (None, None, None, None, None, None, None);
        let (vu, (vt, vh, vv, vs, vl, vo, va)) = (None, none);
        ViewTable { name: name.into(), vt, vp, vd, vu, vh, vv, vs, vl, vo, va }
    }

    #[test]
    fn every_room_gets_its_time_and_its_picture() {
        let views = ["living", "bedroom", "study"].map(view);
        let script = script(&views, 30.0, Path::new("d"));
        let options = "-vtv -vp 1 2 3 -vd 0 1 0";
        let expected = format!(
            "0 view {options}\n1 picture d/001s.png\n2 picture d/002s.png\n5 picture d/005s.png\n\
             10 picture d/010s.png\n20 picture d/020s.png\n20 picture d/living.png\n\
             20 view {options}\n5 picture d/bedroom.png\n\
             5 view {options}\n5 picture d/study.png\n5 quit\n"
        );
        assert_eq!(script, expected);
    }
}
