//! The scene that a session's driver draws from. It is fetched in pieces between other messages,
//! and prepared on a thread of its own.
//!
//! Invariant: a blob is used only if its bytes have the announced hash.

use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use holo_net::{Outbox, SceneReceiver};
use holo_proto::{
    bulk::BlobChunk,
    control::{Control, SceneInfo},
    stand_ins::{StandInRecord, decode},
};
use holo_raycast::{Hierarchies, Raycaster};
use holo_scene::Scene;

use super::driver_choice::{LoadedScene, LoadedStandIn};

/// Collects the blobs of a scene.
pub struct SceneLoader {
    outbox: Outbox,
    scene: SceneInfo,
    receiver: SceneReceiver,
    /// The packed scene, once it has arrived completely.
    packed: Option<Vec<u8>>,
    stand_ins: Option<SceneInfo>,
}

/// The blobs of a scene, as they arrived.
pub struct Blobs {
    packed: Vec<u8>,
    hash: [u8; 32],
    stand_ins: Option<(Vec<u8>, [u8; 32])>,
}

impl SceneLoader {
    /// Requests the scene from the server; `None` if it has no scene.
    ///
    /// # Errors
    /// If the scene exceeds the limit on its size.
    pub fn ask(scene: SceneInfo, outbox: &Outbox) -> Result<Option<SceneLoader>> {
        if scene.bytes == 0 {
            return Ok(None);
        }
        let receiver = SceneReceiver::new(&scene)?;
        outbox.control(&Control::SceneWanted)?;
        let outbox = outbox.clone();
        Ok(Some(SceneLoader { outbox, scene, receiver, packed: None, stand_ins: None }))
    }

    /// Returns how many bytes of the scene have arrived, and how many it has.
    pub fn progress(&self) -> (u64, u64) {
        let bytes = if self.packed.is_some() { self.scene.bytes } else { self.receiver.received() };
        (bytes, self.scene.bytes)
    }

    /// Records that the server also has stand-ins for the scene.
    pub fn announce_stand_ins(&mut self, info: SceneInfo) {
        self.stand_ins = Some(info);
    }

    /// Adds a piece. Returns the blobs once all pieces have arrived.
    ///
    /// # Errors
    /// If a piece is out of order or too long.
    pub fn take(&mut self, chunk: &BlobChunk) -> Result<Option<Blobs>> {
        if !self.receiver.take(chunk)? {
            return Ok(None);
        }
        let next = match (&self.packed, self.stand_ins) {
            (None, Some(info)) if info.bytes > 0 => Some(SceneReceiver::new(&info)?),
            _ => None,
        };
        if let Some(next) = next {
            let whole = std::mem::replace(&mut self.receiver, next);
            self.packed = Some(whole.into_bytes());
            self.outbox.control(&Control::StandInsWanted)?;
            return Ok(None);
        }
        let empty = SceneReceiver::new(&self.scene)?;
        let last = std::mem::replace(&mut self.receiver, empty).into_bytes();
        let (packed, stand_ins) = match (self.packed.take(), self.stand_ins) {
            (Some(packed), Some(info)) => (packed, Some((last, info.hash))),
            _ => (last, None),
        };
        Ok(Some(Blobs { packed, hash: self.scene.hash, stand_ins }))
    }
}

impl Blobs {
    /// Unpacks the scene and prepares it for casting rays. For millions of triangles this takes
    /// seconds the first time.
    ///
    /// # Errors
    /// If a blob does not have its announced hash, or cannot be used.
    pub fn build(self) -> Result<LoadedScene> {
        ensure!(
            Scene::content_hash(&self.packed) == self.hash,
            "the scene's bytes do not have the announced hash"
        );
        let scene = Scene::unpack(&self.packed).context("reading the server's scene")?;
        drop(self.packed);
        let prepared = Hierarchies::new(None).prepare(Arc::new(scene));
        let (raycaster, rebuilt) = prepared.context("preparing the scene")?;
        if let Some(reason) = rebuilt {
            eprintln!("holoview: {reason}");
        }
        let stand_ins = match self.stand_ins {
            Some((blob, hash)) => build_stand_ins(&blob, hash)?,
            None => Vec::new(),
        };
        Ok(LoadedScene { raycaster: Arc::new(raycaster), stand_ins })
    }
}

fn build_stand_ins(blob: &[u8], hash: [u8; 32]) -> Result<Vec<LoadedStandIn>> {
    ensure!(
        Scene::content_hash(blob) == hash,
        "the stand-ins' bytes do not have the announced hash"
    );
    let parts = decode(blob).context("reading the server's stand-ins")?;
    let build = |part: StandInRecord| {
        let build = || {
            Raycaster::build(Arc::new(Scene::unpack(&part.packed)?)).map_err(anyhow::Error::from)
        };
        let raycaster =
            build().with_context(|| format!("preparing a stand-in of section {}", part.section))?;
        let (section, kind) = (part.section, part.kind);
        Ok(LoadedStandIn { section, kind, raycaster: Arc::new(raycaster) })
    };
    parts.into_iter().map(build).collect()
}
