//! Loads the scene after a server's welcome, from the cache or from the server, and makes a tracer.

use std::{
    future::Future,
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail};
use holo_net::{Inbox, Message, Outbox, SceneReceiver};
use holo_progress::{HumanBytes, HumanCount};
use holo_proto::control::{Control, Engine, RenderSettings, SceneInfo, Welcome};
use holo_raycast::Hierarchies;
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
    hierarchies: Hierarchies,
    loaded: Option<(SceneInfo, RenderSettings, Arc<Tracer>)>,
    reporter: Reporter,
}

impl Loader {
    /// Returns a loader without a tracer.
    pub fn new(cache: SceneCache, hierarchies: Hierarchies, reporter: Reporter) -> Loader {
        Loader { cache: Arc::new(cache), hierarchies, loaded: None, reporter }
    }

    /// Returns the tracer for the server's scene and settings.
    ///
    /// It is the last session's tracer if that fits. Otherwise it is made from a scene in the
    /// cache, or from one that the server sends.
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
        let scene = self.scene(inbox, outbox, info).await?;
        let triangles = HumanCount(scene.triangles().len() as u64);
        let text = format!("preparing {triangles} triangles for tracing");
        let hierarchies = self.hierarchies.clone();
        let build = tokio::task::spawn_blocking(move || build(scene, &hierarchies, settings));
        let tracer = Arc::new(self.step(&text, build).await??);
        self.loaded = Some((info, settings, Arc::clone(&tracer)));
        Ok(tracer)
    }

    /// Reports that the server may send packets.
    pub fn ready(&mut self) {
        self.reporter.ready();
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
        let cache = Arc::clone(&self.cache);
        let unpacked = tokio::task::spawn_blocking(move || -> Result<Scene> {
            let scene = unpack(&packed, &info)?;
            cache.put(&info, &packed);
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

fn build(scene: Scene, hierarchies: &Hierarchies, settings: RenderSettings) -> Result<Tracer> {
    let paths = u32::from(settings.paths_per_sample);
    let context = "preparing the scene for tracing";
    let (raycaster, rebuilt) = hierarchies.prepare(Arc::new(scene)).context(context)?;
    if let Some(reason) = rebuilt {
        eprintln!("rtworker: {reason}");
    }
    let settings_of_paths = Settings { bounces: settings.bounces, paths };
    let tracer = Tracer::with_raycaster(Arc::new(raycaster), settings_of_paths).context(context)?;
    let tracer = if settings.virtual_distance { tracer.with_virtual_distance() } else { tracer };
    Ok(match settings.engine {
        Engine::Path => tracer,
        Engine::Gather => tracer.with_gather(),
    })
}
