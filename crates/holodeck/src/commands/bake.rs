//! `holodeck bake`: makes objects that are kept beside a file part of its scene.

use std::path::PathBuf;

use anyhow::Result;
use holodeck::bake::bake;

/// Make objects that were carried into a holodeck part of its scene
///
/// The objects are those that `object list` names in a session of the file. A generation of samples
/// begins: workers trace the scene with them from then on. In a session, `object bake NAME` does
/// the same.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  holodeck bake room.holo chair\n  \
    holodeck bake room.holo --take-out chair")]
pub struct BakeArgs {
    /// The holodeck; nothing else may write to it meanwhile
    #[arg(value_name = "FILE.holo")]
    file: PathBuf,
    /// Names of objects
    #[arg(value_name = "NAME", required_unless_present = "take_out")]
    names: Vec<String>,
    /// Take an object out of the scene that is part of it; may be repeated
    #[arg(long, value_name = "NAME")]
    take_out: Vec<String>,
    /// Report as JSON
    #[arg(long)]
    json: bool,
}

/// See [`BakeArgs`].
pub fn run(args: &BakeArgs) -> Result<()> {
    let objects = bake(&args.file, &args.names, &args.take_out)?;
    if args.json {
        holo_progress::print_line!("{}", serde_json::json!({ "objects": objects }));
    } else if objects.is_empty() {
        holo_progress::print_line!("no object is part of the scene");
    } else {
        holo_progress::print_line!("objects that are part of the scene: {}", objects.join(", "));
    }
    Ok(())
}
