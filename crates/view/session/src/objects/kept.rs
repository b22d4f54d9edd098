//! Objects that stay with a holodeck: a folder beside its file has their list and their models.
//!
//! Invariants:
//! - A model is written once, under its hash, and renamed into place. It is checked when it is
//!   read.
//! - What is read is bounded and not trusted. A list or a model that cannot be used is named, and
//!   the session goes on without it.

use std::{
    fs::File,
    io::{Read, Write},
    path::{Path, PathBuf},
    sync::Arc,
};

use anyhow::{Context, Result, bail, ensure};
use glam::DVec3;
use holo_local_objects::{LocalObject, ObjectModel, ObjectPose};
use holo_scene::Scene;
use serde::{Deserialize, Serialize};

use crate::scene_change::PlacedModel;

/// Longest list, bytes: 64 objects have 20 KB.
const MOST_LIST_BYTES: u64 = 1 << 20;

/// Longest packed model, bytes: a million triangles have 50 MB, and its pictures may have more.
const MOST_MODEL_BYTES: u64 = 1 << 30;

/// The list's name in the folder.
const LIST: &str = "objects.json";

/// A folder of objects.
#[derive(Clone, Debug)]
pub struct ObjectFolder {
    path: PathBuf,
    /// False if changes are not kept.
    pub is_writable: bool,
}

/// An object in the list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptObject {
    pub name: String,
    /// The file that the model was read from, for people.
    pub path: PathBuf,
    pub at: DVec3,
    pub turn: f64,
    pub scale: f64,
    /// The model's hash, its up axis, and its unit in units of the scene.
    pub model: String,
    pub up: DVec3,
    pub unit: f64,
}

impl KeptObject {
    /// Returns where it is.
    pub fn pose(&self) -> ObjectPose {
        ObjectPose { at: self.at, turn: self.turn, scale: self.scale }
    }
}

impl ObjectFolder {
    /// Returns the folder of a holodeck's file. Changes are kept there if it `is_writable`.
    #[must_use]
    pub fn beside(file: &Path, is_writable: bool) -> ObjectFolder {
        ObjectFolder { path: file.with_extension("objects"), is_writable }
    }

    /// Returns the list; empty if there is none.
    pub fn list(&self) -> Result<Vec<KeptObject>> {
        let path = self.path.join(LIST);
        if !path.exists() {
            return Ok(Vec::new());
        }
        let bytes = read(&path, MOST_LIST_BYTES)?;
        serde_json::from_slice(&bytes).with_context(|| format!("reading {}", path.display()))
    }

    /// Returns an object at its place in a scene with this up axis.
    ///
    /// # Errors
    /// If there is no such object, or it cannot be used.
    pub fn placed(&self, name: &str, up: DVec3) -> Result<PlacedModel> {
        let list = self.list()?;
        let unknown = no_object(name, list.iter().map(|object| object.name.as_str()));
        let object = list.iter().find(|object| object.name == name).context(unknown)?;
        let model = ObjectModel::new(self.model(object)?, object.up, object.unit)?;
        Ok(placed(name, &LocalObject::new(Arc::new(model), object.pose(), up)?))
    }

    /// Removes objects from the list. Their models stay.
    ///
    /// # Errors
    /// If the list cannot be read or written.
    pub fn forget(&self, names: &[String]) -> Result<()> {
        let before = self.list()?;
        let mut list = before.clone();
        list.retain(|object| !names.contains(&object.name));
        if list == before { Ok(()) } else { self.put_list(&list) }
    }

    /// Returns the model of an object.
    pub fn model(&self, object: &KeptObject) -> Result<Scene> {
        let hash = &object.model;
        let is_hash = hash.len() == 64 && hash.bytes().all(|sign| sign.is_ascii_hexdigit());
        ensure!(is_hash, "`{hash}` is no hash of a model");
        let path = self.of_model(hash);
        let packed = read(&path, MOST_MODEL_BYTES)?;
        ensure!(hex(&packed) == *hash, "{} is damaged", path.display());
        Scene::unpack(&packed).with_context(|| format!("reading {}", path.display()))
    }

    /// Writes a model, unless it is there. Returns its hash.
    pub fn put_model(&self, scene: &Scene) -> Result<String> {
        let packed = scene.pack();
        let hash = hex(&packed);
        let path = self.of_model(&hash);
        if !path.exists() {
            self.put(&path, &packed)?;
        }
        Ok(hash)
    }

    /// Writes the list.
    pub fn put_list(&self, objects: &[KeptObject]) -> Result<()> {
        let path = self.path.join(LIST);
        if objects.is_empty() && !path.exists() {
            return Ok(());
        }
        self.put(&path, &serde_json::to_vec_pretty(objects)?)
    }

    fn of_model(&self, hash: &str) -> PathBuf {
        self.path.join(format!("{hash}.scene"))
    }

    fn put(&self, path: &Path, bytes: &[u8]) -> Result<()> {
        let put = || {
            std::fs::create_dir_all(&self.path)?;
            let new = path.with_extension(format!("{}.new", std::process::id()));
            let mut file = File::create(&new)?;
            file.write_all(bytes)?;
            file.sync_all()?;
            drop(file);
            std::fs::rename(&new, path)
        };
        put().with_context(|| format!("writing {}", path.display()))
    }
}

/// Returns an object at its place.
pub(super) fn placed(name: &str, object: &LocalObject) -> PlacedModel {
    let model = Arc::clone(object.model().scene());
    PlacedModel { name: name.to_owned(), place: object.place(), pose: object.pose(), model }
}

/// Returns the words for an object that does not exist, beside those that do.
pub(super) fn no_object<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.collect();
    match names.is_empty() {
        true => format!("there is no object `{name}`, and no other one"),
        false => format!("there is no object `{name}`; objects: {}", names.join(", ")),
    }
}

fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    let reading = || format!("reading {}", path.display());
    let mut bytes = Vec::new();
    let file = File::open(path).with_context(reading)?;
    file.take(most + 1).read_to_end(&mut bytes).with_context(reading)?;
    if bytes.len() as u64 > most {
        bail!("{} has more than {most} bytes", path.display());
    }
    Ok(bytes)
}

fn hex(packed: &[u8]) -> String {
    Scene::content_hash(packed).iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use holo_scene::{Material, Sky};

    use super::*;

    fn triangle() -> Scene {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let material = vec![Material::grey("grey")];
        let sky = Sky::from([0.0; 3]);
        Scene::new(DVec3::ZERO, corners, vec![[0, 1, 2]], vec![0], material, sky).unwrap()
    }

    #[test]
    fn kept_objects_come_back_and_damaged_ones_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let folder = ObjectFolder::beside(&folder.path().join("room.holo"), true);
        assert_eq!(folder.list().unwrap(), []);
        folder.put_list(&[]).unwrap();
        assert!(!folder.path.exists(), "without objects there is no folder");
        let model = folder.put_model(&triangle()).unwrap();
        assert_eq!(folder.put_model(&triangle()).unwrap(), model);
        let kept = KeptObject {
            name: "a chair".into(),
            path: "chair.glb".into(),
            at: DVec3::new(1.0, 2.0, 0.5),
            turn: 30.0,
            scale: 2.0,
            model,
            up: DVec3::Y,
            unit: 0.01,
        };
        folder.put_list(std::slice::from_ref(&kept)).unwrap();
        assert_eq!(folder.list().unwrap(), std::slice::from_ref(&kept));
        assert_eq!(folder.model(&kept).unwrap(), triangle());

        let other = KeptObject { model: "../../etc/passwd".into(), ..kept.clone() };
        assert!(folder.model(&other).unwrap_err().to_string().contains("is no hash"));
        std::fs::write(folder.of_model(&kept.model), b"changed").unwrap();
        assert!(folder.model(&kept).unwrap_err().to_string().contains("is damaged"));
        std::fs::write(folder.path.join(LIST), b"{").unwrap();
        assert!(folder.list().is_err());
    }
}
