//! A room with radiance in closed form, and a worker that computes samples of it instead of
//! tracing.
//!
//! The room is a box seen from inside, optionally with another box in it. Red grows along x, green
//! along y, blue along z, and every wall has a different brightness. If a program mistakes a wall,
//! an axis, a channel or a unit for another, the picture changes.

use std::{net::SocketAddr, time::Instant};

use holo_net::{Inbox, Message, NetError, Outbox};
use holo_picture::{Picture, View};
use holo_proto::{
    bulk::{LiveHit, LiveResults, LiveWork, Results, TracedPacket, WorkPackets},
    control::Control,
    frame::FrameKind,
    hello::Role,
};
use holo_section::{DVec3, Sample, Section};

use crate::LIMIT;

/// Brightness of the twelve walls: the room's (low x, high x, low y …), then the object's.
const BRIGHTNESS: [f64; 12] = [1.0, 0.6, 0.4, 1.5, 0.25, 2.2, 3.5, 5.0, 0.16, 7.5, 0.1, 11.0];

/// A room: a box seen from inside, optionally with an object, a box seen from outside.
#[derive(Clone, Copy, Debug)]
pub struct World {
    /// Low and high corner of the room.
    pub room: [DVec3; 2],
    /// Low and high corner of the object.
    pub object: Option<[DVec3; 2]>,
    /// Factor of all reported distances. It is 1, except in a test of the tests.
    pub stretch: f64,
}

/// The hit of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin, in lengths of its direction.
    pub distance: f64,
    /// Number of the wall: the room's from 0 (low x, high x, low y …), the object's from 6.
    pub wall: usize,
    /// Radiance of the wall at the hit.
    pub rgb: [f64; 3],
}

impl World {
    /// Returns the nearest wall along a direction from a point in the room.
    pub fn hit(&self, origin: DVec3, direction: DVec3) -> Hit {
        let [leave, wall] = slabs(self.room, origin, direction)[1];
        let mut nearest = (leave, wall as usize);
        if let Some(object) = self.object {
            let [[enter, wall], [leave, _]] = slabs(object, origin, direction);
            if enter > 0.0 && enter < leave {
                nearest = (enter, 6 + wall as usize);
            }
        }
        let (distance, wall) = nearest;
        let place = (origin + direction * distance - self.room[0]) / (self.room[1] - self.room[0]);
        let rgb = place.to_array().map(|share| BRIGHTNESS[wall] * (0.3 + share));
        Hit { distance, wall, rgb }
    }

    /// Returns the sample that a tracer should compute for a ray of a section.
    fn sample(
        &self,
        section: &Section,
        ray: &holo_section::SectionRay,
        coords: holo_section::RayCoords,
    ) -> Sample {
        let start = section.trace_start(ray);
        let hit = self.hit(ray.origin + ray.direction * start, ray.direction);
        let dither = (coords.0[0] as u32) << 24 | (coords.0[3] as u32) << 16 | 0x5aa5;
        let rgb = hit.rgb.map(|x| x as f32);
        Sample::encode(
            coords,
            rgb,
            (start + hit.distance) * self.stretch,
            section.diagonal(),
            dither.wrapping_mul(0x9e37_79b9),
        )
    }

    fn answer(&self, sections: &[Section], work: &WorkPackets) -> Results {
        let mut results = Results::default();
        for packet in &work.packets {
            let start = Instant::now();
            let viewpoint = packet.viewpoint.map(|index| &work.viewpoints[usize::from(index)]);
            let section = packet.key.section_in(sections).expect("the beam exists");
            let sampler = section
                .beam_sampler(packet.key.section, packet.key.beam, viewpoint)
                .expect("the beam exists");
            for number in packet.first..packet.first + u32::from(packet.count) {
                let named = packet.rays.map(|rays| rays[(number - packet.first) as usize]);
                let coords = named.unwrap_or_else(|| sampler.coords(number));
                results.samples.push(self.sample(section, &sampler.ray(coords), coords));
            }
            let count = u32::from(packet.count);
            results.packets.push(TracedPacket {
                id: packet.id,
                count,
                nanoseconds: nanoseconds(start),
            });
        }
        results
    }
}

impl World {
    fn answer_live(&self, work: &LiveWork) -> LiveResults {
        let mut results = LiveResults::default();
        for packet in &work.packets {
            let start = Instant::now();
            for ray in &packet.rays {
                let hit = self.hit(DVec3::from_array(ray.origin), DVec3::from_array(ray.direction));
                let distance = (hit.distance * self.stretch) as f32;
                results.hits.push(LiveHit { radiance: hit.rgb.map(|x| x as f32), distance });
            }
            let count = packet.rays.len() as u32;
            results.packets.push(TracedPacket {
                id: packet.id,
                count,
                nanoseconds: nanoseconds(start),
            });
        }
        results
    }
}

fn nanoseconds(since: Instant) -> u32 {
    u32::try_from(since.elapsed().as_nanos()).unwrap_or(u32::MAX)
}

/// Returns the parameters where a line enters and leaves a box, each with its wall (2·axis + side).
fn slabs([low, high]: [DVec3; 2], origin: DVec3, direction: DVec3) -> [[f64; 2]; 2] {
    let (mut enter, mut leave) = ([f64::NEG_INFINITY, 0.0], [f64::INFINITY, 0.0]);
    for axis in 0..3 {
        // A line parallel to these two walls meets the box only between them.
        if direction[axis] == 0.0 {
            if !(low[axis]..high[axis]).contains(&origin[axis]) {
                return [[f64::INFINITY, 0.0], [f64::NEG_INFINITY, 0.0]];
            }
            continue;
        }
        let at = |wall: DVec3| (wall[axis] - origin[axis]) / direction[axis];
        let sides = [[at(low), 2.0 * axis as f64], [at(high), 2.0 * axis as f64 + 1.0]];
        let [near, far] = if direction[axis] > 0.0 { sides } else { [sides[1], sides[0]] };
        if near[0] > enter[0] {
            enter = near;
        }
        if far[0] < leave[0] {
            leave = far;
        }
    }
    [enter, leave]
}

/// Joins a server as a worker with `world`, until the server says goodbye or closes the connection.
pub async fn work(address: SocketAddr, world: World) {
    let (mut inbox, outbox, welcome) = join(address, Role::Worker).await;
    let sections: Vec<Section> =
        welcome.iter().cloned().map(|spec| Section::new(spec).expect("valid")).collect();
    outbox.control(&Control::Ready { threads: 1 }).expect("it fits");
    loop {
        match inbox.next().await {
            Ok(Message::Work(work)) => {
                let results = world.answer(&sections, &work);
                outbox.send(FrameKind::Results, &results.encode()).expect("it fits");
            }
            Ok(Message::LiveWork(work)) => {
                let results = world.answer_live(&work);
                outbox.send(FrameKind::LiveResults, &results.encode()).expect("it fits");
            }
            Ok(Message::Control(Control::Ping(number))) => {
                outbox.control(&Control::Pong(number)).expect("it fits")
            }
            Ok(Message::Control(Control::Bye(_))) | Err(NetError::Closed | NetError::Io(_)) => {
                return;
            }
            Ok(_) => {}
            Err(error) => panic!("{error}"),
        }
    }
}

/// Connects in a role, and also returns the sections.
pub async fn join(
    address: SocketAddr,
    role: Role,
) -> (Inbox, Outbox, Vec<holo_section::SectionSpec>) {
    let joined = tokio::time::timeout(LIMIT, holo_net::connect(address, role, "a test"));
    let (inbox, outbox, welcome) = joined.await.expect("in time").expect("the server takes us");
    (inbox, outbox, welcome.sections)
}

/// The result of comparing a picture with the room.
#[derive(Debug)]
pub struct Verdict {
    /// Pixels compared: far enough from edges, and covered or traced live.
    pub compared: usize,
    /// Compared pixels without a matching colour within two pixels: column, row, shown, expected.
    pub wrong: Vec<(u32, u32, [f64; 3], [f64; 3])>,
    /// Mean relative error over the compared pixels.
    pub mean_error: f64,
    /// Covered pixels.
    pub covered: usize,
    /// Pixels that no section covers.
    pub uncovered: usize,
    /// Uncovered pixels that are not exactly 0, so they were traced live.
    pub live: usize,
}

/// Least distance, in pixels, of a compared pixel from an edge.
const MARGIN: u32 = 3;

/// Compares a picture with the room. A pixel must have a colour that the same wall has within two
/// pixels of it, within 1.6 %. RGBE rounds a channel, without bias, by up to 0.8 % of the largest
/// one, and a pixel is a mean of several samples.
///
/// Pixels within three pixels of an edge, or of the border of the covered part, are left out. Their
/// colour depends on how samples are spread.
pub fn compare(world: &World, sections: &[Section], view: &View, picture: &Picture) -> Verdict {
    let (width, height) = picture.size();
    // Includes a margin around the picture, because an edge just outside is as near as one inside.
    let across = width + 2 * MARGIN;
    let at = |column: u32, row: u32| {
        let place = |index: u32| f64::from(index) - f64::from(MARGIN) + 0.5;
        let (eye, direction) =
            view.ray(place(column) / f64::from(width), 1.0 - place(row) / f64::from(height));
        let covered = sections.iter().any(|section| section.line(eye, direction).is_some());
        (covered, world.hit(eye, direction))
    };
    let expected: Vec<(bool, Hit)> = (0..height + 2 * MARGIN)
        .flat_map(|row| (0..across).map(move |column| at(column, row)))
        .collect();
    // Returns all pixels at most `reach` pixels from one.
    let around = |column: u32, row: u32, reach: u32| {
        let rows = row + MARGIN - reach..=row + MARGIN + reach;
        let columns = column + MARGIN - reach..=column + MARGIN + reach;
        let expected = &expected;
        rows.flat_map(move |row| {
            columns.clone().map(move |column| expected[(row * across + column) as usize])
        })
    };
    let mut verdict = Verdict {
        compared: 0,
        wrong: Vec::new(),
        mean_error: 0.0,
        covered: 0,
        uncovered: 0,
        live: 0,
    };
    for row in 0..height {
        for column in 0..width {
            let (covered, hit) = expected[((row + MARGIN) * across + column + MARGIN) as usize];
            let rgb = picture.get(column, row).expect("inside").map(f64::from);
            verdict.covered += usize::from(covered);
            verdict.uncovered += usize::from(!covered);
            let is_shown = covered || rgb != [0.0; 3];
            verdict.live += usize::from(!covered && is_shown);
            let plain = around(column, row, MARGIN)
                .all(|(other, near)| other == covered && near.wall == hit.wall);
            if !plain || !is_shown {
                continue;
            }
            verdict.compared += 1;
            let wrong = (0..3).any(|channel| {
                let near = around(column, row, 2)
                    .map(|(_, near)| (near.rgb[channel] - hit.rgb[channel]).abs());
                let allowed = near.fold(0.0, f64::max) + 0.016 * hit.rgb[channel];
                (rgb[channel] - hit.rgb[channel]).abs() > allowed
            });
            if wrong {
                verdict.wrong.push((column, row, rgb, hit.rgb));
            }
            verdict.mean_error +=
                (0..3).map(|channel| rgb[channel] / hit.rgb[channel] - 1.0).sum::<f64>() / 3.0;
        }
    }
    verdict.mean_error /= verdict.compared.max(1) as f64;
    verdict
}
