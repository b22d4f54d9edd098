//! One connection to a server: loads the scene, then traces packets.

use std::{sync::Arc, time::Duration};

use anyhow::{Context, Result, ensure};
use holo_net::{Destination, Inbox, MachineKey, Message, NetError, Outbox};
use holo_progress::said_once;
use holo_proto::{
    bulk::WorkPackets,
    control::{Control, Engine, Farewell, Welcome},
    hello::Role,
};
use holo_raycast::StoredScenes;
use holo_section::Section;
use tokio::sync::mpsc;

use crate::{
    WorkerConfig,
    cache::SceneCache,
    cells::CellExchange,
    loading::Loader,
    pool::{BeamJob, Pool, PoolJob, Task},
    report::Reporter,
    sending::send_results,
    unexpected::unexpected,
    unseen::UnseenCache,
};

/// A connection that the server has accepted.
pub type Connection = (Inbox, Outbox, Welcome);

/// Connects as a worker. If no server answers, tries again for `patience`.
pub async fn reach(
    server: &Destination,
    machine: &MachineKey,
    patience: Duration,
) -> Result<Connection, NetError> {
    let system = rustix::system::uname();
    let (host, process) = (system.nodename().to_string_lossy(), std::process::id());
    let name = format!("rtworker on {host} #{process}");
    // The caller has reported the attempt.
    holo_net::reach(server, Role::Worker, &name, Some(machine), patience, |_, _| {}).await
}

/// The state that survives from one connection to the next.
pub struct WorkerState {
    threads: u16,
    loader: Loader,
}

impl WorkerState {
    /// Returns a worker without a scene.
    ///
    /// # Errors
    /// If reports are wanted, and there is no link to the program that started this one.
    pub fn new(config: &WorkerConfig) -> std::io::Result<WorkerState> {
        let cores = std::thread::available_parallelism()
            .map_or(1, |n| u16::try_from(n.get()).unwrap_or(u16::MAX));
        let cache = SceneCache::new(config.scene_cache.clone());
        let stored = StoredScenes::new(config.scene_cache.clone());
        let reporter = Reporter::new(config)?;
        let loader = Loader::new(cache, stored, reporter);
        Ok(WorkerState { threads: config.threads.unwrap_or(cores).max(1), loader })
    }

    /// Works until the server says goodbye, and returns the reason. A server that starts again is
    /// an error, as a lost one is.
    pub async fn session(&mut self, (mut inbox, outbox, welcome): Connection) -> Result<Farewell> {
        let sections =
            welcome.sections.iter().cloned().map(Section::new).collect::<Result<Arc<[_]>, _>>();
        let sections = sections.context("the server's sections")?;
        let ended = self.serve(&mut inbox, &outbox, &welcome, sections).await;
        if let Err(error) = &ended
            && error.downcast_ref::<NetError>().is_none()
        {
            outbox.control(&Control::Failed { reason: said_once(error.as_ref()) })?;
            outbox.drained().await;
        }
        ended
    }

    async fn serve(
        &mut self,
        inbox: &mut Inbox,
        outbox: &Outbox,
        welcome: &Welcome,
        sections: Arc<[Section]>,
    ) -> Result<Farewell> {
        let tracer = self.loader.tracer(inbox, outbox, welcome).await?;
        let (finished, results) = mpsc::unbounded_channel();
        let unseen = welcome.skip_unseen.then(UnseenCache::new);
        let task = Arc::new(Task { tracer, sections: Arc::clone(&sections), unseen });
        let pool = Pool::start(self.threads, &task, &finished).context("starting threads")?;
        let sender = tokio::spawn(send_results(results, outbox.clone()));
        let has_cells = welcome.settings.engine == Engine::Gather;
        let exchange = has_cells
            .then(|| CellExchange::start(Arc::clone(&task.tracer), outbox.clone()))
            .transpose()
            .context("starting a thread")?;
        if has_cells {
            // The tracer may have the light of others from an earlier connection.
            for maker in task.tracer.trusted_makers() {
                outbox.control(&Control::CellsUsed { maker })?;
            }
            outbox.control(&Control::CellsWanted)?;
        }
        outbox.control(&Control::Ready { threads: self.threads })?;
        self.loader.ready();
        let seed = welcome.settings.seed;
        let ended = loop {
            let message = match inbox.next().await {
                Ok(Message::Control(Control::Bye(farewell))) => break Ok(farewell),
                Ok(message) => message,
                Err(error) => break Err(error.into()),
            };
            if let Message::Cells(cells) = message {
                if let Some(exchange) = &exchange {
                    exchange.receive(cells);
                }
                continue;
            }
            if let Err(error) = take(message, &pool, &sections, seed) {
                break Err(error);
            }
        };
        // Waiting for the threads must not block the runtime.
        tokio::task::spawn_blocking(move || drop(pool)).await?;
        sender.abort();
        ended
    }
}

/// Processes a message of the server: work for the pool.
fn take(message: Message, pool: &Pool, sections: &[Section], seed: u64) -> Result<()> {
    match message {
        Message::Work(work) => pool.push(jobs(&work, sections, seed)?),
        Message::LiveWork(work) => {
            pool.push(work.packets.into_iter().map(|packet| PoolJob::Live(packet, seed)));
        }
        Message::Control(_) | Message::BlobChunk(_) => {}
        other => return Err(unexpected(&other)),
    }
    Ok(())
}

/// Returns the jobs of a message. Checks here that every beam exists, so that the threads need not.
fn jobs(work: &WorkPackets, sections: &[Section], seed: u64) -> Result<Vec<PoolJob>> {
    work.packets
        .iter()
        .map(|packet| {
            let section = sections.get(usize::from(packet.key.section));
            let known = section.is_some_and(|section| packet.key.beam.0 < section.beam_count());
            ensure!(
                known,
                "the server sent a packet of beam {} of section {}, which does not exist",
                packet.key.beam.0,
                packet.key.section
            );
            let viewpoint =
                packet.viewpoint.and_then(|index| work.viewpoints.get(usize::from(index))).copied();
            Ok(PoolJob::Beam(BeamJob { packet: *packet, viewpoint, seed }))
        })
        .collect()
}
