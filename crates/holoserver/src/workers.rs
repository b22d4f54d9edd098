//! Workers, and the packets that each has been given.

use std::{collections::HashMap, time::Duration};

use holo_net::Outbox;
use holo_proto::bulk::{LivePacket, LiveWork, Packet, Traced, Work};
use holo_section::{BeamKey, Run, SampleKind, Viewpoint};
use thiserror::Error;

use crate::{events::ConnectionId, live::LiveAssignment};

/// Work that a worker gets ahead. It is long enough that the worker never waits for the server, and
/// short enough that a new view is traced at once (the paper allowed five seconds, §2.2).
const AHEAD: Duration = Duration::from_millis(150);

/// Rays ahead for each thread of a worker whose speed is not known yet.
const FIRST_RAYS_PER_THREAD: f64 = 400.0;

/// Most rays ahead, however fast a worker says it is: what is lost with it.
const MAX_RAYS_AHEAD: f64 = 1e6;

/// A packet that a worker has, with all that another worker would need.
#[derive(Clone, Copy, Debug)]
pub struct Assignment {
    /// The packet. Its `viewpoint` field is set when it is sent.
    pub packet: Packet,
    /// The viewpoint that its rays pass, if any.
    pub viewpoint: Option<Viewpoint>,
    /// The display whose view it serves, if any.
    pub display: Option<ConnectionId>,
}

impl Assignment {
    /// Returns its beam.
    pub fn key(&self) -> BeamKey {
        self.packet.key
    }

    /// Returns how its rays are chosen.
    pub fn kind(&self) -> SampleKind {
        match (self.packet.rays, self.viewpoint) {
            (Some(_), _) => SampleKind::SingleRay,
            (None, Some(_)) => SampleKind::ViewpointLimited,
            (None, None) => SampleKind::Uniform,
        }
    }

    /// Returns the samples that it asks for.
    pub fn run(&self) -> Run {
        Run { kind: self.kind(), ..self.packet.run() }
    }

    /// Returns what it costs, in rays of `usual_paths` paths.
    pub fn work(&self, usual_paths: u16) -> f64 {
        f64::from(self.packet.count) * f64::from(self.packet.paths) / f64::from(usual_paths.max(1))
    }
}

/// Why the server refused a worker's results.
#[derive(Debug, Error)]
pub enum ResultsError {
    #[error("it sent results for a packet that it was not given")]
    Unknown,
    #[error("it sent {found} samples for a packet of {asked} rays")]
    Count { found: u32, asked: u8 },
    #[error("it says that a beam sees nothing, but it was not asked to look")]
    NotAsked,
}

/// One connected worker.
pub struct Worker {
    pub outbox: Outbox,
    /// Its name, for people.
    pub name: String,
    threads: f64,
    /// Work is counted in rays of so many paths.
    usual_paths: u16,
    seconds_per_ray: Option<f64>,
    rays_ahead: f64,
    work_ahead: f64,
    assigned: HashMap<u64, Assignment>,
    /// Live rays: they are not stored.
    live: HashMap<u64, LiveAssignment>,
    waits_for_light: bool,
}

impl Worker {
    /// Returns a worker that is not ready yet. Its work is counted in rays of `usual_paths` paths.
    pub fn new(outbox: Outbox, name: String, usual_paths: u16) -> Worker {
        Worker {
            outbox,
            name,
            threads: 0.0,
            usual_paths,
            seconds_per_ray: None,
            rays_ahead: 0.0,
            work_ahead: 0.0,
            assigned: HashMap::new(),
            live: HashMap::new(),
            waits_for_light: false,
        }
    }

    /// Takes note that it has loaded the scene.
    pub fn ready(&mut self, threads: u16) {
        self.threads = f64::from(threads.max(1));
    }

    /// Sets whether it must first get the known records of light. Until then it gets no work,
    /// because it would make records that others have made.
    pub fn wait_for_light(&mut self, waits: bool) {
        self.waits_for_light = waits;
    }

    /// Returns the work that it should get now, in rays of the usual paths. That is 0 while it has
    /// nearly enough, so that work goes out in messages of good size.
    pub fn hunger(&self) -> f64 {
        let ahead = match self.seconds_per_ray {
            Some(seconds) => {
                (AHEAD.as_secs_f64() * self.threads / seconds).max(self.threads * 84.0)
            }
            None => self.threads * FIRST_RAYS_PER_THREAD,
        };
        let ahead = ahead.min(MAX_RAYS_AHEAD);
        if self.threads == 0.0 || self.waits_for_light || self.work_ahead > 0.7 * ahead {
            0.0
        } else {
            ahead - self.work_ahead
        }
    }

    /// Returns the rays that it has and that are to be stored.
    pub fn rays_ahead(&self) -> f64 {
        self.rays_ahead
    }

    /// Sends it packets.
    pub fn assign(&mut self, assignments: Vec<Assignment>) {
        let mut work = Work::default();
        for mut assignment in assignments {
            assignment.packet.viewpoint = assignment.viewpoint.map(|viewpoint| {
                let known = work.viewpoints.iter().position(|&other| other == viewpoint);
                known.unwrap_or_else(|| {
                    work.viewpoints.push(viewpoint);
                    work.viewpoints.len() - 1
                }) as u16
            });
            work.packets.push(assignment.packet);
            self.rays_ahead += f64::from(assignment.packet.count);
            self.work_ahead += assignment.work(self.usual_paths);
            self.assigned.insert(assignment.packet.id, assignment);
        }
        // A message holds what a worker's hunger allows, which is far below a frame's limit.
        let _ = self.outbox.send(holo_proto::frame::Kind::Work, &work.encode());
    }

    /// Sends it live rays.
    pub fn assign_live(&mut self, assignments: Vec<LiveAssignment>) {
        let mut work = LiveWork::default();
        for assignment in assignments {
            let LiveAssignment { id, paths, ref rays, .. } = assignment;
            work.packets.push(LivePacket { id, paths, rays: rays.clone() });
            self.work_ahead += rays.len() as f64;
            self.live.insert(id, assignment);
        }
        // As with packets of beams.
        let _ = self.outbox.send(holo_proto::frame::Kind::LiveWork, &work.encode());
    }

    /// Takes the results of live rays: the worker no longer has them.
    pub fn finish_live(&mut self, traced: &Traced) -> Result<LiveAssignment, ResultsError> {
        let asked = self.live.get(&traced.id).ok_or(ResultsError::Unknown)?.rays.len();
        if asked != traced.count as usize {
            return Err(ResultsError::Count { found: traced.count, asked: asked as u8 });
        }
        let assignment = self.live.remove(&traced.id).ok_or(ResultsError::Unknown)?;
        self.work_ahead -= asked as f64;
        self.took(traced, asked as f64, asked as f64);
        Ok(assignment)
    }

    /// Takes away all live rays.
    pub fn take_live(&mut self) -> impl Iterator<Item = LiveAssignment> + use<> {
        std::mem::take(&mut self.live).into_values()
    }

    /// Takes the results of a packet: the worker no longer has it.
    pub fn finish(&mut self, traced: &Traced) -> Result<Assignment, ResultsError> {
        let assignment = *self.assigned.get(&traced.id).ok_or(ResultsError::Unknown)?;
        let asked = assignment.packet.count;
        if u32::from(asked) != traced.count {
            // It stays in the list, and another worker gets it.
            return Err(ResultsError::Count { found: traced.count, asked });
        }
        self.assigned.remove(&traced.id);
        let work = assignment.work(self.usual_paths);
        self.rays_ahead -= f64::from(asked);
        self.work_ahead -= work;
        self.took(traced, work, f64::from(asked));
        Ok(assignment)
    }

    /// Learns its speed from a packet of so much work and so many rays.
    fn took(&mut self, traced: &Traced, work: f64, rays: f64) {
        // Smoothed over some hundred rays: beams differ much in what a ray costs.
        let seconds = f64::from(traced.nanoseconds.max(1)) * 1e-9 / work;
        let share = 0.005 * rays;
        self.seconds_per_ray =
            Some(self.seconds_per_ray.map_or(seconds, |mean| mean + share * (seconds - mean)));
    }

    /// Ends a packet that it did not trace, because its beam sees nothing.
    pub fn finish_unseen(&mut self, id: u64) -> Result<Assignment, ResultsError> {
        let assignment = self.assigned.remove(&id).ok_or(ResultsError::Unknown)?;
        self.rays_ahead -= f64::from(assignment.packet.count);
        self.work_ahead -= assignment.work(self.usual_paths);
        Ok(assignment)
    }

    /// Returns the packets that it has not done.
    pub fn into_assignments(self) -> impl Iterator<Item = Assignment> {
        self.assigned.into_values()
    }

    /// Iterates over the packets that it has not done.
    pub fn assignments(&self) -> impl Iterator<Item = &Assignment> {
        self.assigned.values()
    }

    /// Returns whether it has no packet whose samples are stored.
    pub fn is_idle(&self) -> bool {
        self.assigned.is_empty()
    }
}
