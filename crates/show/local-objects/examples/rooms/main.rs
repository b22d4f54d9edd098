//! Measures objects that are carried into rooms against the tracer, which traces rooms and objects
//! together.
//!
//! `rooms FOLDER [CASE...]` prints, for each case and number of lights, the errors in the object's
//! pixels and in those around it where the object changes the room. Light around the object comes
//! from the tracer too, so the errors are those of the objects' light alone. What the tracer has
//! made is kept in FOLDER.
//!
//! `rooms speed` prints how long frames of a moving object take.

#![allow(clippy::unwrap_used, clippy::panic)]

mod scenes;
mod speed;

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use holo_display::{Frame, Interrupt, mix};
use holo_local_objects::{
    LayerDetail, LightProbe, LitObject, LocalObject, ObjectLayer, ObjectLighting, ObjectModel,
    ObjectPose, Room, probe_views,
};
use holo_picture::{Picture, View, luminance};
use holo_raycast::Raycaster;
use holo_scene::Scene;
use holo_tracer::{Settings, Tracer};
use rayon::prelude::*;
use scenes::{Case, cases};

/// Size of the pictures.
const SIZE: (u32, u32) = (88, 66);

/// Rays in each pixel of one of two pictures, and paths of each ray.
const RAYS: u32 = 64;
const PATHS: u64 = 2;

/// Side of a probe's faces, and rays in each texel.
const SIDE: u32 = 64;
const PROBE_RAYS: u32 = 24;

/// Passes of the light around objects at rest, as sessions have for files.
const REST_PASSES: u32 = 16;

/// Passes of the objects.
const PASSES: u32 = 64;

/// Relative change by the object above which a pixel of the room counts as changed.
const CHANGED: f32 = 0.02;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.first().map(String::as_str) {
        Some("speed") => speed::measure(&args[1..]),
        Some(folder) => {
            println!(
                "case            lights  object: bias   rms  max    room: before   rms   bias"
            );
            let named = |case: &Case| args.len() == 1 || args[1..].iter().any(|n| n == case.name);
            cases().into_iter().filter(named).for_each(|case| measure(Path::new(folder), &case));
        }
        None => panic!("see the source"),
    }
}

/// Returns the view of a case.
fn view(case: &Case, size: (u32, u32)) -> View {
    View::new(case.eye, case.towards, DVec3::Z, Some(case.angle), None, size).unwrap()
}

/// Returns the object of a case where it stands.
fn object(case: &Case) -> LocalObject {
    let model = ObjectModel::new(case.object(), DVec3::Z, 1.0).unwrap();
    let base = model.base();
    LocalObject::new(Arc::new(model), ObjectPose::at(base), DVec3::Z).unwrap()
}

/// Returns the tracer of a scene.
fn tracer(scene: Scene) -> Tracer {
    Tracer::new(Arc::new(scene), Settings::default()).unwrap()
}

/// Returns what is kept under a name, or else traces a picture by these rays of each pixel.
fn traced(
    path: &Path,
    tracer: &Tracer,
    view: &View,
    size: (u32, u32),
    rays: Range<u32>,
) -> Picture {
    if let Ok(known) = Picture::read(path) {
        return known;
    }
    let pixel = |pixel: u32| {
        let mut sum = glam::Vec3::ZERO;
        let shift = |axis: u32| f64::from(mix(axis, pixel)) / f64::from(u32::MAX);
        for ray in rays.clone() {
            // Roberts' R2 sequence, shifted in each pixel.
            let along = |step: f64, shift: f64| (f64::from(ray) * step + shift).fract();
            let dx = along(0.754_877_666_246_692_8, shift(1));
            let dy = along(0.569_840_290_998_053_3, shift(2));
            let x = (f64::from(pixel % size.0) + dx) / f64::from(size.0);
            let y = 1.0 - (f64::from(pixel / size.0) + dy) / f64::from(size.1);
            let (origin, direction) = view.ray(x, y);
            let seed = u64::from(pixel) << 32 | u64::from(ray);
            let traced = tracer.trace_paths(origin, direction, seed, 0..PATHS);
            sum += glam::Vec3::from(traced.radiance);
        }
        (sum / rays.len() as f32).to_array()
    };
    let pixels = (0..size.0 * size.1).into_par_iter().map(pixel).collect();
    let picture = Picture::from_pixels(size.0, size.1, pixels).unwrap();
    picture.write(path).unwrap();
    picture
}

/// Returns a frame of a picture of a room.
fn frame(picture: Picture, view: &View, room: &Room) -> Frame {
    let size = picture.size();
    let mut frame = Frame::black(size);
    frame.picture = picture;
    frame.depth = room.depth(view, size);
    frame
}

/// Returns the light around a place.
fn probe(folder: &Path, case: &Case, tracer: &Tracer, room: &Room, centre: DVec3) -> LightProbe {
    let mut face = 0;
    let frames = probe_views(centre).unwrap().map(|view| {
        face += 1;
        let path = folder.join(format!("{}-probe-{face}.pfm", case.name));
        frame(traced(&path, tracer, &view, (SIDE, SIDE), 0..PROBE_RAYS), &view, room)
    });
    LightProbe::new(centre, &frames).unwrap()
}

fn measure(folder: &Path, case: &Case) {
    let view = view(case, SIZE);
    let empty = tracer(case.room(false));
    let room = Room::new(Arc::new(Raycaster::build(Arc::new(case.room(false))).unwrap()));
    let path = |what: &str| folder.join(format!("{}-{what}.pfm", case.name));
    let before = traced(&path("empty"), &empty, &view, SIZE, 0..2 * RAYS);
    let whole = tracer(case.room(true));
    let truths = [("truth-1", 0..RAYS), ("truth-2", RAYS..2 * RAYS)]
        .map(|(name, rays)| traced(&path(name), &whole, &view, SIZE, rays));
    let mut truth = truths[0].clone();
    for (pixel, other) in truth.pixels.iter_mut().zip(&truths[1].pixels) {
        *pixel = std::array::from_fn(|channel| 0.5 * (pixel[channel] + other[channel]));
    }
    let object = object(case);
    let probe = probe(folder, case, &empty, &room, object.centre());
    for lights in [1, 2, 4, 8, 16] {
        let lighting = ObjectLighting::new(probe.clone(), lights, Some(&room));
        let moving = LitObject::new(object.clone(), Arc::new(lighting));
        let never = Interrupt::default();
        let objects = [moving.at_rest(Some(&room), REST_PASSES, &never).unwrap()];
        let base = frame(before.clone(), &view, &room);
        let (mut seen, detail) = (base.clone(), LayerDetail::Exact(PASSES));
        let mut layer = ObjectLayer::new(&base, &view, &objects, Some(&room), detail);
        layer.draw(&base, &objects, Some(&room), PASSES, &Interrupt::default());
        layer.compose(&mut seen);
        seen.picture.write(path(&format!("ours-{lights}"))).unwrap();
        let all = 0..before.pixels.len();
        let of = |picture: &Picture, at: usize| luminance(picture.pixels[at]);
        let is_object = |at: usize| {
            let covers = |dx: u32, dy: u32| {
                let column = at as u32 % SIZE.0 + dx;
                let row = at as u32 / SIZE.0 + dy;
                layer.shows_object((column - 1).min(SIZE.0 - 1), (row - 1).min(SIZE.1 - 1))
            };
            // Pixels at edges have a part of both: they count for neither.
            let around = [(1, 1), (0, 1), (2, 1), (1, 0), (1, 2)];
            let count = around.into_iter().filter(|&(dx, dy)| {
                (at as u32 % SIZE.0 + dx > 0) && (at as u32 / SIZE.0 + dy > 0) && covers(dx, dy)
            });
            count.count()
        };
        let marks: Vec<usize> = all.clone().map(is_object).collect();
        let inside: Vec<usize> = all.clone().filter(|&at| marks[at] == 5).collect();
        let changed = |at: usize| (of(&before, at) / of(&truth, at).max(1e-6) - 1.0).abs();
        let around: Vec<usize> =
            all.filter(|&at| marks[at] == 0 && changed(at) > CHANGED).collect();
        let errors = |picture: &Picture, pixels: &[usize], noise_share: f32| {
            let count = pixels.len().max(1) as f32;
            let mean = pixels.iter().map(|&at| of(&truth, at)).sum::<f32>() / count;
            let differences = pixels.iter().map(|&at| of(picture, at) - of(&truth, at));
            let square = differences.clone().map(|d| d * d).sum::<f32>() / count;
            // The noise of the truth is known from its halves, and is no error. Beside the object,
            // the picture without it has nearly the same noise, by the same numbers.
            let halves = pixels.iter().map(|&at| of(&truths[0], at) - of(&truths[1], at));
            let noise = halves.map(|d| 0.25 * d * d).sum::<f32>() / count;
            let square = (square - noise_share * noise).max(0.0);
            (100.0 * differences.sum::<f32>() / count / mean, 100.0 * square.sqrt() / mean)
        };
        let mean =
            inside.iter().map(|&at| of(&truth, at)).sum::<f32>() / inside.len().max(1) as f32;
        let relative =
            |&at: &usize| (of(&seen.picture, at) - of(&truth, at)) / of(&truth, at).max(0.3 * mean);
        let most = inside.iter().map(relative).max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let (bias, rms) = errors(&seen.picture, &inside, 1.0);
        let ((_, unchanged), (room_bias, left)) =
            (errors(&before, &around, 0.0), errors(&seen.picture, &around, 0.0));
        println!(
            "{:15} {lights:6}  {bias:+12.2} {rms:6.2} {:+5.0} {unchanged:12.2} {left:6.2} \
             {room_bias:+6.2}",
            case.name,
            100.0 * most.unwrap_or_default()
        );
    }
}
