//! The scene that a session's driver draws from. If this machine has it prepared, it is mapped.
//! Otherwise it is fetched in pieces between other messages, and prepared on a thread of its own.
//!
//! Invariants:
//! - A blob is used only if its bytes have the announced hash.
//! - Files are read on threads of their own. Messages do not wait for them.

use std::sync::{Arc, OnceLock};

use anyhow::{Context, Result, ensure};
use holo_net::{Outbox, SceneReceiver};
use holo_proto::{
    bulk::BlobChunk,
    control::{Control, SceneInfo},
    stand_ins::{StandInRecord, decode},
};
use holo_raycast::{Raycaster, StoredScenes};
use holo_scene::Scene;

use super::driver_choice::{LoadedScene, LoadedStandIn};

/// Collects the blobs of a scene.
pub struct SceneLoader {
    outbox: Outbox,
    scene: SceneInfo,
    /// The scene, if this machine has it prepared. Then it is not fetched.
    prepared: Arc<OnceLock<Arc<Raycaster>>>,
    receiver: SceneReceiver,
    /// The packed scene, once it has arrived completely.
    packed: Option<Vec<u8>>,
    stand_ins: Option<SceneInfo>,
}

/// The blobs of a scene, as they arrived.
pub struct Blobs {
    scene: SceneSource,
    stand_ins: Option<(Vec<u8>, [u8; 32])>,
}

/// Where a scene comes from.
enum SceneSource {
    /// From this machine.
    Prepared(Arc<Raycaster>),
    /// From the server, with its announced hash.
    Packed(Vec<u8>, [u8; 32]),
}

impl SceneLoader {
    /// Looks for the prepared scene in `stored`, and requests what is missing from the server.
    /// `None` if the server has no scene. Must be called within a tokio runtime.
    ///
    /// # Errors
    /// If the scene exceeds the limit on its size.
    pub fn ask(
        scene: SceneInfo,
        outbox: &Outbox,
        stored: StoredScenes,
    ) -> Result<Option<SceneLoader>> {
        if scene.bytes == 0 {
            return Ok(None);
        }
        let receiver = SceneReceiver::new(&scene)?;
        let (outbox, prepared) = (outbox.clone(), Arc::new(OnceLock::new()));
        let (found, requests) = (Arc::clone(&prepared), outbox.clone());
        tokio::task::spawn_blocking(move || {
            let opened = stored.open(&scene.hash).unwrap_or_else(|unusable| {
                eprintln!("holoview: {unusable}");
                None
            });
            // The reader of messages learns from the answer that the scene is there.
            let request = match opened {
                Some(raycaster) => {
                    let _ = found.set(Arc::new(raycaster));
                    Control::StandInsWanted
                }
                None => Control::SceneWanted,
            };
            // If the connection is lost, the session learns of it from its reader.
            let _ = requests.control(&request);
        });
        let loader =
            SceneLoader { outbox, scene, prepared, receiver, packed: None, stand_ins: None };
        Ok(Some(loader))
    }

    /// Returns how many bytes of the scene have arrived, and how many it has.
    pub fn progress(&self) -> (u64, u64) {
        let bytes = if self.packed.is_some() { self.scene.bytes } else { self.receiver.received() };
        (bytes, self.scene.bytes)
    }

    /// Records which stand-ins the server has for the scene. Their length is 0 if there are none.
    /// Returns the scene if nothing else is missing.
    ///
    /// # Errors
    /// If they exceed the limit on their size.
    pub fn announce_stand_ins(&mut self, info: SceneInfo) -> Result<Option<Blobs>> {
        self.stand_ins = Some(info);
        let Some(prepared) = self.prepared.get() else { return Ok(None) };
        if info.bytes == 0 {
            let scene = SceneSource::Prepared(Arc::clone(prepared));
            return Ok(Some(Blobs { scene, stand_ins: None }));
        }
        self.receiver = SceneReceiver::new(&info)?;
        Ok(None)
    }

    /// Adds a piece. Returns the blobs once all pieces have arrived.
    ///
    /// # Errors
    /// If a piece is out of order or too long.
    pub fn take(&mut self, chunk: &BlobChunk) -> Result<Option<Blobs>> {
        if !self.receiver.take(chunk)? {
            return Ok(None);
        }
        if let Some(prepared) = self.prepared.get() {
            let scene = SceneSource::Prepared(Arc::clone(prepared));
            let whole = self.taken()?;
            return Ok(Some(Blobs {
                scene,
                stand_ins: self.stand_ins.map(|info| (whole, info.hash)),
            }));
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
        let last = self.taken()?;
        let (packed, stand_ins) = match (self.packed.take(), self.stand_ins) {
            (Some(packed), Some(info)) => (packed, Some((last, info.hash))),
            _ => (last, None),
        };
        Ok(Some(Blobs { scene: SceneSource::Packed(packed, self.scene.hash), stand_ins }))
    }

    /// Takes the bytes that have arrived.
    fn taken(&mut self) -> Result<Vec<u8>> {
        let empty = SceneReceiver::new(&self.scene)?;
        Ok(std::mem::replace(&mut self.receiver, empty).into_bytes())
    }
}

impl Blobs {
    /// Unpacks a scene from the server and prepares it for casting rays. For millions of triangles
    /// this takes seconds.
    ///
    /// # Errors
    /// If a blob does not have its announced hash, or cannot be used.
    pub fn build(self, stored: &StoredScenes) -> Result<LoadedScene> {
        let raycaster = match self.scene {
            SceneSource::Prepared(raycaster) => raycaster,
            SceneSource::Packed(packed, hash) => build(packed, hash, stored)?,
        };
        let stand_ins = match self.stand_ins {
            Some((blob, hash)) => build_stand_ins(&blob, hash)?,
            None => Vec::new(),
        };
        Ok(LoadedScene { raycaster, stand_ins })
    }
}

fn build(packed: Vec<u8>, hash: [u8; 32], stored: &StoredScenes) -> Result<Arc<Raycaster>> {
    ensure!(
        Scene::content_hash(&packed) == hash,
        "the scene's bytes do not have the announced hash"
    );
    let scene = Scene::unpack(&packed).context("reading the server's scene")?;
    drop(packed);
    let prepared = stored.prepare(Arc::new(scene), Some(hash));
    let (raycaster, unusable) = prepared.context("preparing the scene")?;
    if let Some(unusable) = unusable {
        eprintln!("holoview: {unusable}");
    }
    Ok(Arc::new(raycaster))
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
