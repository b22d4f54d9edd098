//! One connection to a server: fetch the scene, then trace what comes.

use std::hash::{BuildHasher, RandomState};
use std::{net::SocketAddr, sync::Arc, time::Duration};

use anyhow::{Context, Result, bail, ensure};
use holo_light::Store;
use holo_net::{Inbox, Message, NetError, Outbox, SceneReceiver};
use holo_proto::{
    ProtoError,
    bulk::{Light, LiveResults, Results, Work},
    control::{Control, Engine, RenderSettings, SceneInfo, Welcome},
    frame::Kind,
    hello::Role,
};
use holo_scene::Scene;
use holo_section::Section;
use holo_tracer::{Settings, Tracer};
use tokio::sync::mpsc;

use crate::{
    Config,
    cache::{SceneCache, unpack},
    pool::{BeamJob, Done, Job, Pool, Task},
    unseen::Answers,
};

/// Packets put into one message at the most: 5,000 samples, some milliseconds of work.
const MAX_RESULTS: usize = 256;

/// How long finished packets wait for company before they are sent, unless there are many.
const GATHER: Duration = Duration::from_millis(1);

/// Records of light wait so long at the most before others are told: some are made twice meanwhile.
const SHARE_EVERY: Duration = Duration::from_millis(5);

/// Records in one message: a megabyte.
const SHARED_RECORDS: usize = 1 << 13;

/// A connection that the server has taken.
pub type Connection = (Inbox, Outbox, Welcome);

/// Connects as a worker.
pub async fn connect(address: SocketAddr) -> Result<Connection, NetError> {
    let name = format!("rtworker {}", std::process::id());
    holo_net::connect(address, Role::Worker, &name).await
}

/// What is kept from one connection to the next.
pub struct Worker {
    threads: u16,
    cache: Arc<SceneCache>,
    loaded: Option<(SceneInfo, RenderSettings, Arc<Tracer>)>,
}

impl Worker {
    pub fn new(config: &Config) -> Worker {
        let cores = std::thread::available_parallelism()
            .map_or(1, |n| u16::try_from(n.get()).unwrap_or(u16::MAX));
        let cache = Arc::new(SceneCache::new(config.scene_cache.clone()));
        Worker { threads: config.threads.unwrap_or(cores).max(1), cache, loaded: None }
    }

    /// Works until the server says goodbye; gives its reason.
    pub async fn session(&mut self, (inbox, outbox, welcome): Connection) -> Result<String> {
        let sections =
            welcome.sections.iter().cloned().map(Section::new).collect::<Result<Arc<[_]>, _>>();
        let sections = sections.context("the server's sections")?;
        let (sender, mut messages) = mpsc::unbounded_channel();
        let reader = tokio::spawn(read(inbox, outbox.clone(), sender));
        let ended = self.serve(&mut messages, &outbox, &welcome, sections).await;
        reader.abort();
        if let Err(error) = &ended
            && error.downcast_ref::<NetError>().is_none()
        {
            outbox.control(&Control::Failed { reason: format!("{error:#}") })?;
            outbox.drained().await;
        }
        ended
    }

    async fn serve(
        &mut self,
        messages: &mut Messages,
        outbox: &Outbox,
        welcome: &Welcome,
        sections: Arc<[Section]>,
    ) -> Result<String> {
        let tracer = self.tracer(messages, outbox, welcome).await?;
        let (done, results) = mpsc::unbounded_channel();
        let unseen = welcome.skip_unseen.then(Answers::new);
        let task = Arc::new(Task { tracer, sections: Arc::clone(&sections), unseen });
        let pool = Pool::start(self.threads, &task, &done).context("starting threads")?;
        let light = task.tracer.light().cloned();
        let sender =
            tokio::spawn(send_results(results, outbox.clone(), light.clone().map(NewLight::new)));
        if light.is_some() {
            outbox.control(&Control::LightWanted)?;
        }
        outbox.control(&Control::Ready { threads: self.threads })?;
        let ended = loop {
            match next(messages).await {
                Ok(Message::Work(work)) => match jobs(&work, &sections, welcome.settings.seed) {
                    Ok(jobs) => pool.push(jobs),
                    Err(error) => break Err(error),
                },
                Ok(Message::LiveWork(work)) => {
                    let seed = welcome.settings.seed;
                    pool.push(work.packets.into_iter().map(|packet| Job::Live(packet, seed)));
                }
                Ok(Message::Light(message)) => {
                    if let Some(store) = &light {
                        message.records.into_iter().for_each(|record| {
                            store.receive(record);
                        });
                    }
                }
                Ok(Message::Control(Control::Bye { reason })) => break Ok(reason),
                Ok(Message::Control(_) | Message::BlobChunk(_)) => {}
                Ok(other) => break Err(unexpected(&other)),
                Err(error) => break Err(error),
            }
        };
        // Waiting for the threads must not hold up the runtime.
        tokio::task::spawn_blocking(move || drop(pool)).await?;
        sender.abort();
        ended
    }

    /// The tracer for the server's scene and settings: kept from before, or from the scene cache, or fetched.
    async fn tracer(
        &mut self,
        messages: &mut Messages,
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
        let cache = Arc::clone(&self.cache);
        let cached = tokio::task::spawn_blocking(move || cache.get(&info)).await?;
        let scene = match cached {
            Some(scene) => scene,
            None => {
                outbox.control(&Control::SceneWanted)?;
                let packed = fetch(messages, &info).await?;
                let cache = Arc::clone(&self.cache);
                tokio::task::spawn_blocking(move || -> Result<Scene> {
                    let scene = unpack(&packed, &info)?;
                    cache.put(&info, &packed);
                    Ok(scene)
                })
                .await??
            }
        };
        let tracer = tokio::task::spawn_blocking(move || build(scene, settings)).await??;
        let tracer = Arc::new(tracer);
        self.loaded = Some((info, settings, Arc::clone(&tracer)));
        Ok(tracer)
    }
}

fn build(scene: Scene, settings: RenderSettings) -> Result<Tracer> {
    let paths = u32::from(settings.paths_per_sample);
    let tracer = Tracer::new(Arc::new(scene), Settings { bounces: settings.bounces, paths })
        .context("preparing the scene for tracing")?;
    let tracer = if settings.virtual_distance { tracer.with_virtual_distance() } else { tracer };
    Ok(match settings.engine {
        Engine::Path => tracer,
        Engine::Cached => tracer.with_cache(settings.accuracy, RandomState::new().hash_one(())),
    })
}

type Messages = mpsc::UnboundedReceiver<Result<Message, NetError>>;

/// Reads messages and answers pings at once, whatever the rest of the process does.
async fn read(
    mut inbox: Inbox,
    outbox: Outbox,
    messages: mpsc::UnboundedSender<Result<Message, NetError>>,
) {
    loop {
        let message = inbox.next().await;
        if let Ok(Message::Control(Control::Ping(number))) = message {
            if outbox.control(&Control::Pong(number)).is_err() {
                return;
            }
            continue;
        }
        let over = message.is_err();
        if messages.send(message).is_err() || over {
            return;
        }
    }
}

async fn next(messages: &mut Messages) -> Result<Message> {
    Ok(messages.recv().await.unwrap_or(Err(NetError::Closed))?)
}

async fn fetch(messages: &mut Messages, info: &SceneInfo) -> Result<Vec<u8>> {
    let mut receiver = SceneReceiver::new(info)?;
    loop {
        match next(messages).await? {
            Message::BlobChunk(chunk) => {
                if receiver.take(&chunk)? {
                    return Ok(receiver.into_bytes());
                }
            }
            Message::Control(Control::Bye { reason }) => bail!("the server left: {reason}"),
            Message::Control(_) => {}
            other => return Err(unexpected(&other)),
        }
    }
}

fn unexpected(message: &Message) -> anyhow::Error {
    let name = match message {
        Message::Control(_) => "control",
        Message::Work(_) => "work",
        Message::Results(_) => "results",
        Message::View(_) => "view",
        Message::Samples(_) => "samples",
        Message::BlobChunk(_) => "scene",
        Message::Unseen(_) => "unseen beams",
        Message::Light(_) => "light",
        Message::Rays(_) => "wanted rays",
        Message::LiveWanted(_) => "live rays",
        Message::LiveWork(_) => "live work",
        Message::LiveResults(_) => "live results",
        Message::LiveSamples(_) => "live samples",
    };
    anyhow::anyhow!("the server sent a {name} message, which workers do not take")
}

/// Checks that every packet's beam exists, once, so that the threads need not.
fn jobs(work: &Work, sections: &[Section], seed: u64) -> Result<Vec<Job>> {
    work.packets
        .iter()
        .map(|packet| {
            let known = packet.key.section_in(sections).is_some();
            ensure!(known, "the server asked for {}, which does not exist", packet.key);
            let viewpoint =
                packet.viewpoint.and_then(|index| work.viewpoints.get(usize::from(index))).copied();
            Ok(Job::Beam(BeamJob { packet: *packet, viewpoint, seed }))
        })
        .collect()
}

/// Sends finished packets, many to a message when they come fast, at once when they come slowly; and records of light as they
/// are made, before the packets that they were made for.
async fn send_results(
    mut results: mpsc::UnboundedReceiver<Done>,
    outbox: Outbox,
    mut light: Option<NewLight>,
) {
    let mut batch = Vec::with_capacity(MAX_RESULTS);
    loop {
        // A packet whose light is not known yet takes long: others may use its records already.
        let wait = if light.is_some() { SHARE_EVERY } else { Duration::MAX };
        let received = tokio::time::timeout(wait, results.recv_many(&mut batch, MAX_RESULTS)).await;
        if let Some(light) = &mut light
            && light.send(&outbox).is_err()
        {
            return;
        }
        match received {
            Err(_) => continue,
            Ok(0) => return,
            Ok(_) => {}
        }
        if batch.len() < MAX_RESULTS / 4 {
            tokio::time::sleep(GATHER).await;
            while let Ok(done) = results.try_recv() {
                batch.push(done);
                if batch.len() >= MAX_RESULTS {
                    break;
                }
            }
        }
        let (mut message, mut live) = (Results::default(), LiveResults::default());
        for done in batch.drain(..) {
            match done {
                Done::Traced(traced, samples) => {
                    message.packets.push(traced);
                    message.samples.extend_from_slice(&samples);
                }
                Done::Unseen(id) => message.unseen.push(id),
                Done::Live(traced, hits) => {
                    live.packets.push(traced);
                    live.hits.extend(hits);
                }
            }
        }
        // 256 packets of 21 samples are far below a frame's limit.
        let has_live = !live.packets.is_empty();
        if has_live && outbox.send(Kind::LiveResults, &live.encode()).is_err() {
            return;
        }
        let has_samples = !message.packets.is_empty() || !message.unseen.is_empty();
        if has_samples && outbox.send(Kind::Results, &message.encode()).is_err() {
            return;
        }
    }
}

/// Records of light that the server may not have: all that were there when the connection began, for the server may have lost
/// them, and those made since.
struct NewLight {
    store: Arc<Store>,
    before: usize,
    next: usize,
}

impl NewLight {
    fn new(store: Arc<Store>) -> NewLight {
        let before = store.len();
        NewLight { store, before, next: 0 }
    }

    fn send(&mut self, outbox: &Outbox) -> Result<(), ProtoError> {
        while self.next < self.store.len() {
            let (records, next) = if self.next < self.before {
                let next = self.before.min(self.next + SHARED_RECORDS);
                ((self.next..next).filter_map(|index| self.store.get(index)).collect(), next)
            } else {
                self.store.made_since(self.next, SHARED_RECORDS)
            };
            self.next = next;
            if !records.is_empty() {
                outbox.send(Kind::Light, &Light { records }.encode())?;
            }
        }
        Ok(())
    }
}
