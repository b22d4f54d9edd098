//! Threads that trace packets: a queue in, results out.

use std::{collections::VecDeque, sync::Arc, thread::JoinHandle, time::Instant};

use holo_proto::{
    MAX_RAYS_PER_PACKET,
    bulk::{LiveHit, LivePacket, LiveRay, Packet, TracedPacket},
};
use holo_section::{BeamId, BeamKey, BeamSampler, DVec3, RayCoords, Sample, Section, Viewpoint};
use holo_tracer::Tracer;
use parking_lot::{Condvar, Mutex, MutexGuard};
use tokio::sync::mpsc;

use crate::unseen::UnseenCache;

/// Packets that a thread takes at a time. They are few, so that the threads end together. If a
/// thread took only one, threads would often wait for each other at the queue.
const TAKE: usize = 4;

/// Distinguishes the random numbers of live rays from those of samples, whose kinds are 0 to 2.
const LIVE_SALT: u64 = 3 << 56;

/// A packet of a beam, with the viewpoint that it refers to.
#[derive(Clone, Copy, Debug)]
pub struct BeamJob {
    /// The packet. Its beam exists.
    pub packet: Packet,
    /// The sphere that the rays must pass, if any.
    pub viewpoint: Option<Viewpoint>,
    /// The holodeck's seed.
    pub seed: u64,
}

/// Work for a thread.
#[derive(Debug)]
pub enum PoolJob {
    /// A packet of a beam.
    Beam(BeamJob),
    /// A packet of live rays, with the holodeck's seed.
    Live(LivePacket, u64),
}

/// A finished packet.
#[derive(Debug)]
pub enum PoolResult {
    /// A traced packet: its message, and the samples in the order of their numbers.
    Traced(TracedPacket, Vec<Sample>),
    /// The number of a packet that was not traced, because no ray of its beam hits anything.
    Unseen(u64),
    /// Traced live rays: their message, and the hits in the order of the rays.
    Live(TracedPacket, Vec<LiveHit>),
}

/// The task of all threads of a session.
pub struct Task {
    /// The engine, with the scene.
    pub tracer: Arc<Tracer>,
    /// The holodeck's sections.
    pub sections: Arc<[Section]>,
    /// Answers whether beams are unseen; `None` if every beam is traced.
    pub unseen: Option<UnseenCache>,
}

#[derive(Default)]
struct Queue {
    jobs: VecDeque<PoolJob>,
    closed: bool,
}

#[derive(Default)]
struct PoolState {
    queue: Mutex<Queue>,
    more: Condvar,
}

impl PoolState {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        // The queue is only pushed to and popped from, so a thread that panics leaves it intact.
        self.queue.lock()
    }
}

/// The threads of one session. Dropping the pool discards the queue, and waits for packets that are
/// being traced.
pub struct Pool {
    shared: Arc<PoolState>,
    threads: Vec<JoinHandle<()>>,
}

impl Pool {
    /// Starts `threads` threads that send finished packets to `finished`.
    ///
    /// # Errors
    /// If the operating system starts no thread.
    pub fn start(
        threads: u16,
        task: &Arc<Task>,
        finished: &mpsc::UnboundedSender<PoolResult>,
    ) -> std::io::Result<Pool> {
        let mut pool = Pool { shared: Arc::default(), threads: Vec::new() };
        for index in 0..threads {
            let (shared, task) = (Arc::clone(&pool.shared), Arc::clone(task));
            let finished = finished.clone();
            let thread = std::thread::Builder::new()
                .name(format!("trace-{index}"))
                .spawn(move || work(&shared, &task, &finished))?;
            pool.threads.push(thread);
        }
        Ok(pool)
    }

    /// Appends jobs to the queue.
    pub fn push(&self, jobs: impl IntoIterator<Item = PoolJob>) {
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
            // A thread that panicked has reported it on standard error.
            let _ = thread.join();
        }
    }
}

fn work(shared: &PoolState, task: &Task, finished: &mpsc::UnboundedSender<PoolResult>) {
    let mut jobs: Vec<PoolJob> = Vec::with_capacity(TAKE);
    loop {
        {
            let mut queue = shared.lock();
            while queue.jobs.is_empty() {
                if queue.closed {
                    return;
                }
                shared.more.wait(&mut queue);
            }
            let take = queue.jobs.len().min(TAKE);
            jobs.extend(queue.jobs.drain(..take));
        }
        for job in jobs.drain(..) {
            if let Some(result) = trace(&job, task)
                && finished.send(result).is_err()
            {
                return;
            }
        }
    }
}

fn trace(job: &PoolJob, task: &Task) -> Option<PoolResult> {
    match job {
        PoolJob::Beam(job) => trace_beam(job, task),
        PoolJob::Live(packet, seed) => Some(trace_live(packet, *seed, &task.tracer)),
    }
}

fn trace_live(packet: &LivePacket, seed: u64, tracer: &Tracer) -> PoolResult {
    let start = Instant::now();
    let hits: Vec<LiveHit> =
        packet.rays.iter().map(|ray| live_hit(tracer, ray, seed, packet.paths)).collect();
    let nanoseconds = u32::try_from(start.elapsed().as_nanos()).unwrap_or(u32::MAX);
    PoolResult::Live(TracedPacket { id: packet.id, count: hits.len() as u32, nanoseconds }, hits)
}

fn live_hit(tracer: &Tracer, ray: &LiveRay, seed: u64, paths: u16) -> LiveHit {
    let (pixel, round) = LiveRay::pixel_and_round(ray.number);
    let seed = holo_section::seed(0, BeamId(pixel.into()), 0) ^ seed ^ LIVE_SALT;
    let (first, paths) = (u64::from(round) * u64::from(paths), u64::from(paths));
    let (origin, direction) =
        (DVec3::from_array(ray.origin), DVec3::from_array(ray.direction).normalize());
    let traced = tracer.trace_paths(origin, direction, seed, first..first + paths);
    // A display may request rays from anywhere, even from places where numbers overflow. Such rays
    // are black.
    let usable = |x: f32| if x.is_finite() { x.max(0.0) } else { 0.0 };
    let distance = if traced.distance >= 0.0 { traced.distance as f32 } else { f32::INFINITY };
    LiveHit { radiance: traced.radiance.map(usable), distance }
}

fn trace_beam(job: &BeamJob, task: &Task) -> Option<PoolResult> {
    let start = Instant::now();
    let Packet { key, first, count, paths, .. } = job.packet;
    let BeamKey { section: index, beam } = key;
    let section = key.section_in(&task.sections)?;
    let raycaster = task.tracer.raycaster();
    if task.unseen.as_ref().is_some_and(|unseen| unseen.is_unseen(raycaster, section, index, beam))
    {
        return Some(PoolResult::Unseen(job.packet.id));
    }
    let sampler = section.beam_sampler(index, beam, job.viewpoint.as_ref())?;
    // Samples of all kinds have the same numbers, but need different random numbers.
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
    Some(PoolResult::Traced(
        TracedPacket { id: job.packet.id, count: u32::from(count), nanoseconds },
        samples,
    ))
}

/// Traces one sample: the ray at `coords`, from the point where tracing begins in the section.
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
    // The distance counts from the entry point, even if tracing begins elsewhere.
    Sample::encode(
        coords,
        traced.radiance,
        skipped + traced.distance,
        section.diagonal(),
        seed as u32,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_scene::{Bsdf, Material, Scene};
    use holo_tracer::Settings;

    const PIXELS: u32 = 400;
    const ROUNDS: u32 = 64;

    /// A floor of 4 × 4 at height 0 below a lamp of 1 × 1 at height 1.
    fn lit_floor() -> Tracer {
        let square = |half: f64, height: f64| {
            [(-half, -half), (half, -half), (half, half), (-half, half)]
                .map(|(x, y)| DVec3::new(x, y, height))
        };
        let positions = [square(2.0, 0.0), square(0.5, 1.0)].concat();
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]];
        let (mut floor, mut lamp) = (Material::grey("floor"), Material::grey("lamp"));
        floor.bsdf = Bsdf::Diffuse { kd: [0.5; 3] };
        lamp.emission = [10.0; 3];
        let materials = vec![floor, lamp];
        let made = Scene::from_world(&positions, &triangles, &[0, 0, 1, 1], materials, [0.0; 3]);
        let settings = Settings { bounces: Some(0), ..Settings::default() };
        Tracer::new(Arc::new(made.unwrap().0), settings).unwrap()
    }

    /// Returns the mean over pixels of their means over all rounds, and the variance of the latter.
    fn of_pixels(tracer: &Tracer, number: impl Fn(u32, u32) -> u64) -> (f64, f64) {
        let ray = |number| LiveRay {
            origin: [0.7, 0.2, 0.5],
            direction: DVec3::NEG_Z.to_array(),
            number,
        };
        let radiance = |number| f64::from(live_hit(tracer, &ray(number), 5, 1).radiance[1]);
        let of_pixel = |pixel| {
            (0..ROUNDS).map(|round| radiance(number(pixel, round))).sum::<f64>() / f64::from(ROUNDS)
        };
        let means: Vec<f64> = (0..PIXELS).map(of_pixel).collect();
        let count = f64::from(PIXELS);
        let mean = means.iter().sum::<f64>() / count;
        let squares = means.iter().map(|own| (own - mean) * (own - mean)).sum::<f64>();
        (mean, squares / (count - 1.0))
    }

    #[test]
    fn live_rays_of_one_pixel_are_stratified_and_have_the_same_expectation() {
        let tracer = lit_floor();
        let (mean, variance) = of_pixels(&tracer, LiveRay::number);
        let independent = |pixel, round| LiveRay::number(PIXELS + pixel * ROUNDS + round, 0);
        let (expected, variance_alone) = of_pixels(&tracer, independent);
        let error = ((variance + variance_alone) / f64::from(PIXELS)).sqrt();
        assert!((mean - expected).abs() < 4.5 * error, "{mean} {expected} ± {error}");
        // Without strata, a ratio of variances of 400 pixels is below 0.63 once in 10^5 runs.
        assert!(variance < 0.63 * variance_alone, "{variance} {variance_alone}");
        // The same number gives the same ray.
        assert_eq!(of_pixels(&tracer, LiveRay::number), (mean, variance));
    }
}
