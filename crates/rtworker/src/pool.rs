//! Threads that trace packets: a queue in, results out.

use std::{
    collections::VecDeque,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread::JoinHandle,
    time::Instant,
};

use holo_proto::{
    MAX_RAYS_PER_PACKET,
    bulk::{LiveHit, LivePacket, LiveRay, Packet, Traced},
};
use holo_section::{
    BeamId, BeamKey, BeamSampler, DVec3, RayCoords, Sample, SampleKind, Section, Viewpoint,
};
use holo_tracer::Tracer;
use tokio::sync::mpsc;

use crate::unseen::Answers;

/// Packets that a thread takes at a time: few, so that the threads end together, but more than one, so that they
/// seldom meet at the queue.
const TAKE: usize = 4;

/// Rays for records of indirect light for each sample that comes where there is none. For a display: two thirds of the time go into
/// records while most samples lack them. With nobody waiting: nine tenths, so that few samples of a file are noisy.
const EFFORT: u32 = 2;
const EFFORT_UNWATCHED: u32 = 16;

/// Makes the random numbers of live rays others than those of samples, whose kinds are 0 to 2.
const LIVE_SALT: u64 = 3 << 56;

/// A packet with the viewpoint that it refers to.
#[derive(Clone, Copy, Debug)]
pub struct BeamJob {
    /// What to trace. Its beam is known to exist.
    pub packet: Packet,
    /// Near which point the rays must pass.
    pub viewpoint: Option<Viewpoint>,
    /// The holodeck's seed.
    pub seed: u64,
}

/// A packet of either sort.
#[derive(Debug)]
pub enum Job {
    /// Of a beam.
    Beam(BeamJob),
    /// Of live rays, with the holodeck's seed.
    Live(LivePacket, u64),
}

/// A packet done.
#[derive(Debug)]
pub enum Done {
    /// Traced: what goes on the wire, and the samples in the order of their numbers.
    Traced(Traced, Vec<Sample>),
    /// Not traced, since no ray of its beam meets anything: the packet's name.
    Unseen(u64),
    /// Live rays traced, and what they saw in their order.
    Live(Traced, Vec<LiveHit>),
}

/// What all threads of a session trace.
pub struct Task {
    /// The engine, and the scene.
    pub tracer: Arc<Tracer>,
    /// The sections that beams belong to.
    pub sections: Arc<[Section]>,
    /// What is known of beams that see nothing; `None`: every beam is traced.
    pub unseen: Option<Answers>,
}

#[derive(Default)]
struct Queue {
    jobs: VecDeque<Job>,
    closed: bool,
}

#[derive(Default)]
struct Shared {
    queue: Mutex<Queue>,
    more: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        // The queue is only pushed to and popped from: a thread that panicked elsewhere leaves it whole.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The threads of one session. Dropped, it forgets what is queued and waits for what is being traced.
pub struct Pool {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl Pool {
    /// Starts `threads` threads that send what they have traced to `done`.
    ///
    /// # Errors
    /// If the operating system gives no thread.
    pub fn start(
        threads: u16,
        task: &Arc<Task>,
        done: &mpsc::UnboundedSender<Done>,
    ) -> std::io::Result<Pool> {
        let mut pool = Pool { shared: Arc::default(), threads: Vec::new() };
        for index in 0..threads {
            let (shared, task) = (Arc::clone(&pool.shared), Arc::clone(task));
            let done = done.clone();
            let thread = std::thread::Builder::new()
                .name(format!("trace-{index}"))
                .spawn(move || work(&shared, &task, &done))?;
            pool.threads.push(thread);
        }
        Ok(pool)
    }

    /// Queues packets, after those that are there.
    pub fn push(&self, jobs: impl IntoIterator<Item = Job>) {
        self.shared.lock().jobs.extend(jobs);
        self.shared.more.notify_all();
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        {
            let mut queue = self.shared.lock();
            queue.jobs.clear();
            queue.closed = true;
        }
        self.shared.more.notify_all();
        for thread in self.threads.drain(..) {
            // A thread that panicked has said so on standard error.
            let _ = thread.join();
        }
    }
}

fn work(shared: &Shared, task: &Task, done: &mpsc::UnboundedSender<Done>) {
    let mut jobs: Vec<Job> = Vec::with_capacity(TAKE);
    loop {
        {
            let mut queue = shared.lock();
            while queue.jobs.is_empty() {
                if queue.closed {
                    return;
                }
                queue = shared.more.wait(queue).unwrap_or_else(PoisonError::into_inner);
            }
            let take = queue.jobs.len().min(TAKE);
            jobs.extend(queue.jobs.drain(..take));
        }
        for job in jobs.drain(..) {
            if let Some(result) = trace(&job, task)
                && done.send(result).is_err()
            {
                return;
            }
        }
    }
}

fn trace(job: &Job, task: &Task) -> Option<Done> {
    match job {
        Job::Beam(job) => trace_beam(job, task),
        Job::Live(packet, seed) => Some(trace_live(packet, *seed, &task.tracer)),
    }
}

fn trace_live(packet: &LivePacket, seed: u64, tracer: &Tracer) -> Done {
    let start = Instant::now();
    // Somebody waits for them.
    tracer.set_effort(EFFORT);
    let hits: Vec<LiveHit> =
        packet.rays.iter().map(|ray| live_hit(tracer, ray, seed, packet.paths)).collect();
    let nanoseconds = u32::try_from(start.elapsed().as_nanos()).unwrap_or(u32::MAX);
    Done::Live(Traced { id: packet.id, count: hits.len() as u32, nanoseconds }, hits)
}

fn live_hit(tracer: &Tracer, ray: &LiveRay, seed: u64, paths: u16) -> LiveHit {
    let seed = holo_section::seed(0, BeamId(ray.number), 0) ^ seed ^ LIVE_SALT;
    let (origin, direction) =
        (DVec3::from_array(ray.origin), DVec3::from_array(ray.direction).normalize());
    let traced = tracer.trace_paths(origin, direction, seed, 0..u64::from(paths));
    // A display may ask for rays from anywhere; what numbers cannot hold there, it does not see.
    let usable = |x: f32| if x.is_finite() { x.max(0.0) } else { 0.0 };
    let distance = if traced.distance >= 0.0 { traced.distance as f32 } else { f32::INFINITY };
    LiveHit { radiance: traced.radiance.map(usable), distance }
}

fn trace_beam(job: &BeamJob, task: &Task) -> Option<Done> {
    let start = Instant::now();
    let Packet { key, first, count, paths, .. } = job.packet;
    let BeamKey { section: index, beam } = key;
    let section = key.section_in(&task.sections)?;
    let raycaster = task.tracer.raycaster();
    if task.unseen.as_ref().is_some_and(|unseen| unseen.is_unseen(raycaster, section, index, beam))
    {
        return Some(Done::Unseen(job.packet.id));
    }
    let is_watched = job.packet.kind() != SampleKind::Uniform;
    task.tracer.set_effort(if is_watched { EFFORT } else { EFFORT_UNWATCHED });
    let sampler = section.beam_sampler(index, beam, job.viewpoint.as_ref())?;
    // Samples of all kinds have the same numbers; their random numbers must not be the same.
    let salt = job.seed ^ ((job.packet.kind() as u64) << 56);
    let samples = (first..first + u32::from(count))
        .zip(0..)
        .map(|(number, at)| {
            let seed = holo_section::seed(index, beam, number) ^ salt;
            let named = job
                .packet
                .rays
                .and_then(|rays: [_; MAX_RAYS_PER_PACKET]| rays.get::<usize>(at).copied());
            let coords = named.unwrap_or_else(|| sampler.coords(number));
            sample(&task.tracer, section, &sampler, seed, coords, paths)
        })
        .collect();
    let nanoseconds = u32::try_from(start.elapsed().as_nanos()).unwrap_or(u32::MAX);
    Some(Done::Traced(Traced { id: job.packet.id, count: u32::from(count), nanoseconds }, samples))
}

/// Traces one sample: the ray at these positions, from the wall where the section lets rays begin.
fn sample(
    tracer: &Tracer,
    section: &Section,
    sampler: &BeamSampler,
    seed: u64,
    coords: RayCoords,
    paths: u16,
) -> Sample {
    let ray = sampler.ray(coords);
    let skipped = section.trace_start(&ray);
    let traced = tracer.trace_paths(
        ray.origin + ray.direction * skipped,
        ray.direction,
        seed,
        0..u64::from(paths),
    );
    // The distance counts from the entry point, wherever the ray was begun.
    Sample::encode(
        coords,
        traced.radiance,
        skipped + traced.distance,
        section.diagonal(),
        seed as u32,
    )
}
