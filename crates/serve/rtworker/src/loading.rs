//! Loads the scene after a server's welcome, and makes a tracer. A large scene that was prepared
//! before is mapped. Others come from the cache or from the server.

use std::{
    future::Future,
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use holo_net::{Inbox, Message, Outbox, SceneReceiver};
use holo_progress::{HumanBytes, HumanCount};
use holo_proto::control::{Control, Engine, RenderSettings, SceneInfo, Welcome};
use holo_raycast::{Raycaster, StoredScenes};
use holo_scene::Scene;
use holo_tracer::{Settings, Tracer};

use crate::{
    cache::{SceneCache, unpack},
    report::{Reporter, transfer_text},
    unexpected::unexpected,
};

/// Time between two reports of a step without known progress.
const STEP_EVERY: Duration = Duration::from_secs(1);

/// The tracer of the last session, and the stored scenes.
pub struct Loader {
    cache: Arc<SceneCache>,
    stored: StoredScenes,
    loaded: Option<(SceneInfo, RenderSettings, Arc<Tracer>)>,
    reporter: Reporter,
}

impl Loader {
    /// Returns a loader without a tracer.
    pub fn new(cache: SceneCache, stored: StoredScenes, reporter: Reporter) -> Loader {
        Loader { cache: Arc::new(cache), stored, loaded: None, reporter }
    }

    /// Returns the tracer for the server's scene and settings.
    ///
    /// It is the last session's tracer if that fits. Otherwise it is made from a prepared scene,
    /// from one in the cache, or from one that the server sends.
    pub async fn tracer(
        &mut self,
        inbox: &mut Inbox,
        outbox: &Outbox,
        welcome: &Welcome,
    ) -> Result<Arc<Tracer>> {
        let (info, settings) = (welcome.scene, welcome.settings);
        if let Some((scene, same, tracer)) = &self.loaded
            && (*scene, *same) == (info, settings)
        {
            return Ok(Arc::clone(tracer));
        }
        self.loaded = None;
        let raycaster = self.raycaster(inbox, outbox, info).await?;
        let triangles = HumanCount(raycaster.scene().triangles().len() as u64);
        let text = format!("preparing to trace {triangles} triangles");
        let build = tokio::task::spawn_blocking(move || build(raycaster, settings));
        let tracer = Arc::new(self.step(&text, build).await??);
        self.loaded = Some((info, settings, Arc::clone(&tracer)));
        Ok(tracer)
    }

    /// Reports that the server may send packets.
    pub fn ready(&mut self) {
        self.reporter.ready();
    }

    /// Returns the scene, prepared for casting rays.
    async fn raycaster(
        &mut self,
        inbox: &mut Inbox,
        outbox: &Outbox,
        info: SceneInfo,
    ) -> Result<Raycaster> {
        let text = format!("reading the scene, {}", HumanBytes(info.bytes));
        let stored = self.stored.clone();
        let opened = tokio::task::spawn_blocking(move || stored.open(&info.hash));
        match self.step(&text, opened).await? {
            Ok(Some(raycaster)) => return Ok(raycaster),
            Ok(None) => {}
            Err(unusable) => eprintln!("rtworker: {unusable}"),
        }
        let scene = self.scene(inbox, outbox, info).await?;
        let triangles = HumanCount(scene.triangles().len() as u64);
        let text = format!("preparing {triangles} triangles for tracing");
        let stored = self.stored.clone();
        let prepared = tokio::task::spawn_blocking(move || {
            stored.prepare(Arc::new(scene), Some(info.hash)).context(PREPARING)
        });
        let (raycaster, unusable) = self.step(&text, prepared).await??;
        if let Some(unusable) = unusable {
            eprintln!("rtworker: {unusable}");
        }
        Ok(raycaster)
    }

    async fn scene(
        &mut self,
        inbox: &mut Inbox,
        outbox: &Outbox,
        info: SceneInfo,
    ) -> Result<Scene> {
        let text = format!("reading the scene, {}", HumanBytes(info.bytes));
        let cache = Arc::clone(&self.cache);
        let cached = tokio::task::spawn_blocking(move || cache.get(&info));
        if let Some(scene) = self.step(&text, cached).await? {
            return Ok(scene);
        }
        outbox.control(&Control::SceneWanted)?;
        let packed = self.fetch(inbox, &info).await?;
        let (cache, stored) = (Arc::clone(&self.cache), self.stored.clone());
        let unpacked = tokio::task::spawn_blocking(move || -> Result<Scene> {
            let scene = unpack(&packed, &info)?;
            // Scenes that are stored when they are prepared are not stored twice.
            if !stored.keeps(&scene) {
                cache.put(&info, &packed);
            }
            Ok(scene)
        });
        self.step(&text, unpacked).await?
    }

    /// Receives the pieces of the scene.
    async fn fetch(&mut self, inbox: &mut Inbox, info: &SceneInfo) -> Result<Vec<u8>> {
        let mut receiver = SceneReceiver::new(info)?;
        let start = Instant::now();
        loop {
            match inbox.next().await? {
                Message::BlobChunk(chunk) => {
                    if receiver.take(&chunk)? {
                        return Ok(receiver.into_bytes());
                    }
                    let done = receiver.received();
                    let share = done as f64 / info.bytes as f64;
                    self.reporter.loading(share, &transfer_text(done, info.bytes, start));
                }
                Message::Control(Control::Bye(farewell)) => bail!("the server left: {farewell}"),
                Message::Control(_) => {}
                other => return Err(unexpected(&other)),
            }
        }
    }

    /// Waits for a step, and reports every second that it is in progress.
    async fn step<T>(&mut self, text: &str, work: impl Future<Output = T>) -> T {
        tokio::pin!(work);
        let mut tick = tokio::time::interval(STEP_EVERY);
        loop {
            tokio::select! {
                done = &mut work => return done,
                _ = tick.tick() => self.reporter.loading(0.0, text),
            }
        }
    }
}

const PREPARING: &str = "preparing the scene for tracing";

fn build(raycaster: Raycaster, settings: RenderSettings) -> Result<Tracer> {
    let paths = u32::from(settings.paths_per_sample);
    let settings_of_paths = Settings { bounces: settings.bounces, paths };
    let raycaster = Arc::new(raycaster);
    let tracer = Tracer::with_raycaster(raycaster, settings_of_paths).context(PREPARING)?;
    let tracer = if settings.virtual_distance { tracer.with_virtual_distance() } else { tracer };
    Ok(match settings.engine {
        Engine::Path => tracer,
        Engine::Gather => tracer.with_gather(),
        Engine::Captured => bail!("its rays were captured: nothing can be traced for it"),
    })
}
