//! A room with radiance in closed form, samples of it, and its picture.

#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "tests")]

use glam::DVec3;
use holo_display::{Frame, SelectOptions, select_beams};
use holo_picture::View;
use holo_section::{BeamId, BeamKey, RayCoords, Sample, Section, SectionSpec, ViewClass};

/// The random number generator SplitMix64.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

pub fn section(
    origin: [f64; 3],
    sides: [f64; 3],
    grid: [u32; 3],
    class: ViewClass,
    obstructions: bool,
) -> Section {
    let axes = [[sides[0], 0.0, 0.0], [0.0, sides[1], 0.0], [0.0, 0.0, sides[2]]];
    Section::new(SectionSpec { origin, axes, grid, class, obstructions }).unwrap()
}

pub fn view(eye: [f64; 3], towards: [f64; 3], vh: f64, size: (u32, u32)) -> View {
    let (eye, towards) = (DVec3::from_array(eye), DVec3::from_array(towards));
    View::new(eye, towards - eye, DVec3::Z, Some(vh), None, size).unwrap()
}

/// Returns the radiance that a ray shows and its distance, from its origin and unit direction. The
/// distance is infinite if the ray hits nothing.
pub type Scene = fn(DVec3, DVec3) -> ([f32; 3], f64);

pub const ROOM: DVec3 = DVec3::new(10.0, 8.0, 6.0);
pub const BALL: DVec3 = DVec3::new(8.0, 4.6, 2.6);
pub const BALL_RADIUS: f64 = 0.7;

/// A closed room: a sharp shadow and a soft one, a checked floor, coloured walls, and a ball.
pub fn room(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let (mut nearest, mut colour) = (f64::INFINITY, [0.0; 3]);
    for axis in 0..3 {
        let speed = direction[axis];
        let wall = if speed > 0.0 { ROOM[axis] } else { 0.0 };
        let distance = (wall - origin[axis]) / speed;
        if speed != 0.0 && distance < nearest {
            let p = origin + direction * distance;
            nearest = distance;
            colour = wall_colour(axis, speed > 0.0, p);
        }
    }
    let to_ball = BALL - origin;
    let middle = to_ball.dot(direction);
    let inside = BALL_RADIUS * BALL_RADIUS - (to_ball.length_squared() - middle * middle);
    if inside > 0.0 && middle - inside.sqrt() > 0.0 && middle - inside.sqrt() < nearest {
        nearest = middle - inside.sqrt();
        let normal = (origin + direction * nearest - BALL) / BALL_RADIUS;
        let light = (0.15 + 0.85 * normal.dot(DVec3::new(-0.6, 0.0, 0.8)).max(0.0)) as f32;
        colour = [0.9 * light, 0.2 * light, 0.1 * light];
    }
    (colour, nearest)
}

fn wall_colour(axis: usize, positive: bool, p: DVec3) -> [f32; 3] {
    match (axis, positive) {
        (0, true) => {
            // A soft shadow's edge runs vertically, a sharp one's horizontally.
            let soft = (0.5 + 0.4 * ((p.y - 3.0) * 1.5).tanh()) as f32;
            let sharp = if p.z > 3.0 + 0.3 * (p.y - 4.0) { 1.0 } else { 0.35 };
            [soft * sharp, soft * sharp, 0.9 * soft * sharp]
        }
        (1, true) => [0.2, 0.6, 0.25],
        (1, false) => [0.6, 0.2, 0.2],
        (2, false) => {
            let check = ((p.x * 1.5).floor() + (p.y * 1.5).floor()).rem_euclid(2.0) as f32;
            [0.3 + 0.3 * check, 0.3 + 0.25 * check, 0.2 + 0.2 * check]
        }
        (2, true) => [0.8, 0.8, 0.75],
        _ => [0.5, 0.5, 0.6],
    }
}

/// A section inside [`room`].
pub fn room_section(grid: u32) -> Section {
    section([2.0, 2.5, 1.5], [4.0, 3.0, 3.0], [grid; 3], ViewClass::Interior, false)
}

pub fn room_view(size: (u32, u32)) -> View {
    view([3.3, 4.1, 3.2], [10.0, 4.3, 2.2], 60.0, size)
}

/// Returns the picture of a scene, row by row from the top. A pixel is the mean of `side`² regular
/// rays.
pub fn truth(scene: Scene, view: &View, size: (u32, u32), side: u32) -> Vec<[f32; 3]> {
    let mut pixels = Vec::new();
    for row in 0..size.1 {
        for column in 0..size.0 {
            let mut sum = [0.0_f64; 3];
            for part in 0..side * side {
                let x = f64::from(column) + (f64::from(part % side) + 0.5) / f64::from(side);
                let y = f64::from(row) + (f64::from(part / side) + 0.5) / f64::from(side);
                let (eye, direction) = view.ray(x / f64::from(size.0), 1.0 - y / f64::from(size.1));
                let colour = scene(eye, direction).0;
                (0..3).for_each(|i| sum[i] += f64::from(colour[i]));
            }
            pixels.push(sum.map(|channel| (channel / f64::from(side * side)) as f32));
        }
    }
    pixels
}

/// Returns a factor for a sample's radiance, with mean 1.
pub type Noise = fn(&mut Random) -> f32;

pub fn clean(_: &mut Random) -> f32 {
    1.0
}

/// Noise of one path: mostly dark, but some paths reach a lamp. Standard deviation 2.1.
pub fn one_path(random: &mut Random) -> f32 {
    let value = match random.unit() {
        u if u < 0.60 => 0.2,
        u if u < 0.98 => 0.5 + 2.0 * random.unit() as f32,
        _ => 15.0,
    };
    value / (0.60 * 0.2 + 0.38 * 1.5 + 0.02 * 15.0)
}

/// Noise of the mean of 16 paths. Standard deviation 0.53.
pub fn some_paths(random: &mut Random) -> f32 {
    (0..16).map(|_| one_path(random)).sum::<f32>() / 16.0
}

/// Exponential noise. Standard deviation 1.
pub fn exponential(random: &mut Random) -> f32 {
    -(1.0 - random.unit()).ln() as f32
}

/// Log-normal noise. Standard deviation 1.3, with a tail heavier than any exponential.
pub fn log_normal(random: &mut Random) -> f32 {
    let normal =
        (-2.0 * (1.0 - random.unit()).ln()).sqrt() * (std::f64::consts::TAU * random.unit()).cos();
    (normal - 0.5).exp() as f32
}

/// Returns the name of a beam of a section.
pub fn key(section: u16, beam: BeamId) -> BeamKey {
    BeamKey { section, beam }
}

pub type Stored = (BeamId, Sample);

pub fn traced(
    scene: Scene,
    section: &Section,
    beam: BeamId,
    coords: RayCoords,
    random: &mut Random,
    noise: Noise,
) -> Stored {
    let ray = section.ray(section.cells(beam).unwrap(), coords);
    let start = section.trace_start(&ray);
    let (colour, distance) = scene(ray.origin + ray.direction * start, ray.direction);
    let factor = noise(random);
    let sample = Sample::encode(
        coords,
        colour.map(|channel| channel * factor),
        distance + start,
        section.diagonal(),
        random.bits() as u32,
    );
    (beam, sample)
}

/// Returns samples of rays from the eye through random points of the picture, rounded to ray
/// coordinates.
pub fn near_samples(
    scene: Scene,
    section: &Section,
    view: &View,
    count: usize,
    seed: u64,
    noise: Noise,
) -> Vec<Stored> {
    let mut random = Random(seed);
    (0..count)
        .filter_map(|_| {
            let (eye, direction) = view.ray(random.unit(), random.unit());
            let hit = section.line(eye, direction)?;
            Some(traced(scene, section, section.beam(hit.pair), hit.coords, &mut random, noise))
        })
        .collect()
}

/// Returns about `count` samples spread over the whole beams that a view wants, in proportion to
/// their weights, as a batch stores them. Many of them miss the picture.
pub fn batch_samples(
    scene: Scene,
    section: &Section,
    view: &View,
    size: (u32, u32),
    count: usize,
    seed: u64,
    noise: Noise,
) -> Vec<Stored> {
    let mut random = Random(seed);
    let selection =
        select_beams(std::slice::from_ref(section), view, size, &SelectOptions::default());
    let mut stored = Vec::new();
    for wanted in &selection.beams {
        let sampler = section.beam_sampler(0, wanted.key.beam, None).unwrap();
        let share = f64::from(wanted.weight) * count as f64 / selection.covered.pixels;
        for number in 0..(share + random.unit()) as u32 {
            stored.push(traced(
                scene,
                section,
                wanted.key.beam,
                sampler.coords(number),
                &mut random,
                noise,
            ));
        }
    }
    stored
}

/// Returns the mean squared error, relative to the mean square of the reference.
pub fn relative_error(frame: &Frame, reference: &[[f32; 3]]) -> f64 {
    let (mut error, mut square) = (0.0, 0.0);
    for (pixel, reference) in frame.picture.pixels.iter().zip(reference) {
        for i in 0..3 {
            error += f64::from(pixel[i] - reference[i]).powi(2);
            square += f64::from(reference[i]).powi(2);
        }
    }
    error / square
}

/// Returns the mean of the picture relative to the mean of the reference, minus 1.
pub fn bias(frame: &Frame, reference: &[[f32; 3]]) -> f64 {
    let sum = |pixels: &[[f32; 3]]| {
        pixels.iter().flatten().map(|&channel| f64::from(channel)).sum::<f64>()
    };
    sum(&frame.picture.pixels) / sum(reference) - 1.0
}
