//! Writes the bundled scenes to files.

use holo_scenes::{
    Bundled, MODELS, write, write_model, write_papers, write_reflections, write_teapot,
};
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

const HELP: &str = "\
Writes the bundled scenes: NAME.obj, NAME.mtl and NAME.toml each. `models` are small models as other
programs write them, to be opened with no option. `reflections` are mirrors for measurements, and
`papers` are a game of chess, glass with bubbles and a room with a mirror, as the papers show them.
`teapot` is a chrome teapot, to be carried into a room.

Usage: holo-scenes [cornell|corridor|interior|all|models|reflections|papers|teapot] [--out DIR]

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
        Ok(Some(Request { scenes, models, sets, dir })) => {
            for (name, write) in sets {
                match write(&dir) {
                    Ok(files) => files.iter().for_each(|file| println!("{}", file.display())),
                    Err(error) => {
                        eprintln!(
                            "holo-scenes: cannot write {name} into {}: {error}",
                            dir.display()
                        );
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

/// The name of several scenes that are written together, and what writes them.
type NamedSet = (&'static str, fn(&Path) -> io::Result<Vec<PathBuf>>);

/// What to write and where.
struct Request {
    scenes: Vec<Bundled>,
    models: bool,
    sets: Vec<NamedSet>,
    dir: PathBuf,
}

/// Returns the request; `None` if help was requested.
fn parse(mut words: impl Iterator<Item = String>) -> Result<Option<Request>, String> {
    let (mut scenes, mut models, mut sets) = (Vec::new(), false, Vec::<NamedSet>::new());
    let mut dir = PathBuf::from(".");
    while let Some(word) = words.next() {
        match word.as_str() {
            "--help" | "-h" => return Ok(None),
            "--out" => dir = words.next().ok_or("`--out` takes a directory")?.into(),
            "models" => models = true,
            "reflections" => sets.push(("reflections", write_reflections)),
            "papers" => sets.push(("papers", write_papers)),
            "teapot" => sets.push(("the teapot", |dir| Ok(vec![write_teapot(dir)?]))),
            "all" => scenes.extend(Bundled::ALL),
            name => scenes
                .push(Bundled::named(name).ok_or_else(|| format!("there is no scene `{name}`"))?),
        }
    }
    if scenes.is_empty() && !models && sets.is_empty() {
        scenes.extend(Bundled::ALL);
    }
    Ok(Some(Request { scenes, models, sets, dir }))
}
