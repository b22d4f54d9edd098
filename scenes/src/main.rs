//! Writes the bundled scenes to files.

use holo_scenes::{Bundled, MODELS, write, write_model, write_reflections, write_teapot};
use std::path::PathBuf;
use std::process::ExitCode;

const HELP: &str = "\
Writes the bundled scenes: NAME.obj, NAME.mtl and NAME.toml each. `models` are small models as other
programs write them, to be opened with no option. `reflections` are mirrors for measurements.
`teapot` is a chrome teapot, to be carried into a room.

Usage: holo-scenes [cornell|corridor|interior|all|models|reflections|teapot] [--out DIR]

Options:
  --out DIR   where to write; created if it does not exist [default: the current directory]
  --help      this text

Example:
  holo-scenes interior --out /tmp/scenes
";

fn main() -> ExitCode {
    match parse(std::env::args().skip(1)) {
        Ok(None) => {
            print!("{HELP}");
            ExitCode::SUCCESS
        }
        Ok(Some(Request { scenes, models, reflections, has_teapot, dir })) => {
            if has_teapot {
                match write_teapot(&dir) {
                    Ok(file) => println!("{}", file.display()),
                    Err(error) => {
                        eprintln!("holo-scenes: cannot write into {}: {error}", dir.display());
                        return ExitCode::FAILURE;
                    }
                }
            }
            if reflections {
                match write_reflections(&dir) {
                    Ok(files) => files.iter().for_each(|file| println!("{}", file.display())),
                    Err(error) => {
                        eprintln!("holo-scenes: cannot write into {}: {error}", dir.display());
                        return ExitCode::FAILURE;
                    }
                }
            }
            for name in if models { &MODELS[..] } else { &[] } {
                match write_model(name, &dir) {
                    Ok(file) => println!("{}", file.unwrap_or_default().display()),
                    Err(error) => {
                        eprintln!(
                            "holo-scenes: cannot write {name} into {}: {error}",
                            dir.display()
                        );
                        return ExitCode::FAILURE;
                    }
                }
            }
            for scene in scenes {
                match write(scene, &dir) {
                    Ok(written) => println!("{}", written.obj.display()),
                    Err(error) => {
                        eprintln!(
                            "holo-scenes: cannot write {} into {}: {error}",
                            scene.name(),
                            dir.display()
                        );
                        return ExitCode::FAILURE;
                    }
                }
            }
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("holo-scenes: {message}\n\n{HELP}");
            ExitCode::from(2)
        }
    }
}

/// What to write and where.
struct Request {
    scenes: Vec<Bundled>,
    models: bool,
    reflections: bool,
    has_teapot: bool,
    dir: PathBuf,
}

/// Returns the request; `None` if help was requested.
fn parse(mut words: impl Iterator<Item = String>) -> Result<Option<Request>, String> {
    let (mut scenes, mut models, mut reflections) = (Vec::new(), false, false);
    let mut has_teapot = false;
    let mut dir = PathBuf::from(".");
    while let Some(word) = words.next() {
        match word.as_str() {
            "--help" | "-h" => return Ok(None),
            "--out" => dir = words.next().ok_or("`--out` takes a directory")?.into(),
            "models" => models = true,
            "reflections" => reflections = true,
            "teapot" => has_teapot = true,
            "all" => scenes.extend(Bundled::ALL),
            name => scenes
                .push(Bundled::named(name).ok_or_else(|| format!("there is no scene `{name}`"))?),
        }
    }
    if scenes.is_empty() && !models && !reflections && !has_teapot {
        scenes.extend(Bundled::ALL);
    }
    Ok(Some(Request { scenes, models, reflections, has_teapot, dir }))
}
