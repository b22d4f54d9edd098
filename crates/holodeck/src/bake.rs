//! Objects that were carried into a scene become part of it, in a file that nobody else writes.

use std::path::Path;

use anyhow::Result;
use glam::DVec3;
use holo_server::Holodeck;
use holo_view::{ObjectFolder, SceneChange};

use crate::prepare::{Edited, SMALL_CACHE};

/// Makes objects that are kept beside a file part of its scene, and takes others out of it. A
/// generation of samples begins. Returns the names of all objects that are part of the scene then.
///
/// # Errors
/// If there is no such object, the scene cannot be read again, or the file cannot be written. It
/// then has the scene before.
pub fn bake(path: &Path, baked: &[String], taken_out: &[String]) -> Result<Vec<String>> {
    let about = Holodeck::open_read_only(path, SMALL_CACHE)?.about;
    about.check_traced(path)?;
    let up = DVec3::from_array(about.up);
    let folder = ObjectFolder::beside(path, true);
    let baked = baked.iter().map(|name| folder.placed(name, up));
    let baked = baked.collect::<Result<_>>()?;
    let change = SceneChange { baked, taken_out: taken_out.to_vec(), ..SceneChange::default() };
    let edited = Edited::read(path, None, &change)?;
    edited.restart(path)?;
    Ok(edited.stated().objects)
}
