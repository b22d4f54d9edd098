//! Workers and what each has been given.

use std::{collections::HashMap, time::Duration};

use holo_net::Outbox;
use holo_proto::bulk::{LivePacket, LiveWork, Packet, Traced, Work};
use holo_section::{Run, SampleKind, Viewpoint};
use thiserror::Error;

use crate::{listen::ConnectionId, live::LiveAssignment};

/// Work that a worker is given ahead: long enough that it never waits for the server, short enough that a new view is
/// traced at once (the paper allowed five seconds, §2.2).
const AHEAD: Duration = Duration::from_millis(150);

/// Rays given ahead to a worker whose speed is not known yet, per thread.
const FIRST_RAYS_PER_THREAD: f64 = 400.0;

/// Rays given ahead at the most, whatever a worker says of its speed: what is lost with it.
const MAX_RAYS_AHEAD: f64 = 1e6;

/// A packet given out, with what is needed to give it to another.
#[derive(Clone, Copy, Debug)]
pub struct Assignment {
    /// The packet; its `viewpoint` field is set when it is sent.
    pub packet: Packet,
    /// The viewpoint that limits it.
    pub viewpoint: Option<Viewpoint>,
    /// The display whose view it serves, if any.
    pub display: Option<ConnectionId>,
}

impl Assignment {
    /// How its rays are chosen.
    pub fn kind(&self) -> SampleKind {
        match (self.packet.rays, self.viewpoint) {
            (Some(_), _) => SampleKind::SingleRay,
            (None, Some(_)) => SampleKind::ViewpointLimited,
            (None, None) => SampleKind::Uniform,
        }
    }

    /// The samples that it asks for.
    pub fn run(&self) -> Run {
        Run { kind: self.kind(), ..self.packet.run() }
    }

    /// What it costs, in rays of `usual_paths` paths.
    pub fn work(&self, usual_paths: u16) -> f64 {
        f64::from(self.packet.count) * f64::from(self.packet.paths) / f64::from(usual_paths.max(1))
    }
}

/// Why a worker's results were not taken.
#[derive(Debug, Error)]
pub enum ResultsError {
    #[error("it sent results for a packet that it was not given")]
    Unknown,
    #[error("it sent {found} samples for a packet of {asked} rays")]
    Count { found: u32, asked: u8 },
    #[error("it calls a beam unseen, and was not asked to look")]
    NotAsked,
}

/// One connected worker.
pub struct Worker {
    pub outbox: Outbox,
    /// Its name, for people.
    pub name: String,
    threads: f64,
    /// Paths of the rays in which work is counted.
    usual_paths: u16,
    seconds_per_ray: Option<f64>,
    rays_ahead: f64,
    work_ahead: f64,
    assigned: HashMap<u64, Assignment>,
    /// Rays that are not stored.
    live: HashMap<u64, LiveAssignment>,
    waits_for_light: bool,
}

impl Worker {
    /// Connected, not ready yet. Its work is counted in rays of `usual_paths` paths.
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

    /// It has loaded the scene.
    pub fn ready(&mut self, threads: u16) {
        self.threads = f64::from(threads.max(1));
    }

    /// Whether it is still to be given the light that is known: until then it gets no work, for it would do others' again.
    pub fn wait_for_light(&mut self, waits: bool) {
        self.waits_for_light = waits;
    }

    /// Work that it should be given now, in rays of the usual paths; zero while it has enough, so that work goes out in good-sized messages.
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

    /// Rays that it was given and has not done, but for live ones.
    pub fn rays_ahead(&self) -> f64 {
        self.rays_ahead
    }

    /// Gives it packets.
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

    /// Gives it live rays.
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

    /// Takes live rays' results off the list, once.
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

    /// Takes all live rays off the list.
    pub fn take_live(&mut self) -> impl Iterator<Item = LiveAssignment> + use<> {
        std::mem::take(&mut self.live).into_values()
    }

    /// Takes a packet's results off the list, once.
    pub fn finish(&mut self, traced: &Traced) -> Result<Assignment, ResultsError> {
        let assignment = *self.assigned.get(&traced.id).ok_or(ResultsError::Unknown)?;
        let asked = assignment.packet.count;
        if u32::from(asked) != traced.count {
            // Still on the list: somebody else traces it.
            return Err(ResultsError::Count { found: traced.count, asked });
        }
        self.assigned.remove(&traced.id);
        let work = assignment.work(self.usual_paths);
        self.rays_ahead -= f64::from(asked);
        self.work_ahead -= work;
        self.took(traced, work, f64::from(asked));
        Ok(assignment)
    }

    /// Learns of its speed: a packet of so many rays, and of so much work.
    fn took(&mut self, traced: &Traced, work: f64, rays: f64) {
        // Smoothed over some hundred rays: beams differ much in what a ray costs.
        let seconds = f64::from(traced.nanoseconds.max(1)) * 1e-9 / work;
        let share = 0.005 * rays;
        self.seconds_per_ray =
            Some(self.seconds_per_ray.map_or(seconds, |mean| mean + share * (seconds - mean)));
    }

    /// Takes a packet off the list that it did not trace, since its beam sees nothing. Says nothing of its speed.
    pub fn finish_unseen(&mut self, id: u64) -> Result<Assignment, ResultsError> {
        let assignment = self.assigned.remove(&id).ok_or(ResultsError::Unknown)?;
        self.rays_ahead -= f64::from(assignment.packet.count);
        self.work_ahead -= assignment.work(self.usual_paths);
        Ok(assignment)
    }

    /// What it was given and has not done.
    pub fn into_assignments(self) -> impl Iterator<Item = Assignment> {
        self.assigned.into_values()
    }

    /// Packets that it has not done.
    pub fn assignments(&self) -> impl Iterator<Item = &Assignment> {
        self.assigned.values()
    }

    /// Whether it has anything to do that is stored.
    pub fn is_idle(&self) -> bool {
        self.assigned.is_empty()
    }
}
