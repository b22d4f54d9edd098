//! Compares three ways to turn requests of the render cache into rays: exactly, as single rays that
//! can be stored, and as weights of beams.
//!
//! The camera walks through a room known in closed form, with a few new samples for each frame.
//!
//! `cargo run --release -p holo-driver-rendercache --example requests`

use glam::DVec3;
use holo_display::{SelectOptions, select_beams, viewpoint_radius};
use holo_driver_rendercache::{
    Moment, Place, PointImage, PointImageParams, RayResult as PointSample,
};
use holo_picture::{Picture, View, compare};
use holo_section::{
    BeamId, RayCoords, Section, SectionSpec, ViewClass, Viewpoint, ray_eye_distance,
};
use std::collections::HashMap;
use std::error::Error;

const SIZE: (u32, u32) = (320, 240);
const FRAMES: usize = 90;
const ROOM: DVec3 = DVec3::new(10.0, 8.0, 4.0);
const BALL: DVec3 = DVec3::new(6.5, 4.6, 1.6);
const SPREAD: f64 = 16.0;

/// A way to turn requests into rays.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// Rays are traced as requested, as by a renderer without a holodeck.
    Exactly,
    /// The nearest rays that can be stored.
    SingleRays,
    /// Weights of the view's beams. Any rays of these that pass the eye are traced.
    Beams,
}

/// Radiance and distance of what a ray meets.
fn room(origin: DVec3, along: DVec3) -> ([f32; 3], f64) {
    let (mut nearest, mut colour) = (f64::INFINITY, [0.0; 3]);
    for axis in 0..3 {
        let wall = if along[axis] > 0.0 { ROOM[axis] } else { 0.0 };
        let distance = (wall - origin[axis]) / along[axis];
        if along[axis] != 0.0 && distance < nearest {
            let at = origin + along * distance;
            let check = (0..3)
                .filter(|&other| other != axis)
                .map(|other| (at[other] * 1.5).floor())
                .sum::<f64>();
            let bright = 0.3 + 0.4 * check.rem_euclid(2.0) as f32;
            (nearest, colour) =
                (distance, [bright, bright * (0.4 + 0.2 * axis as f32), 0.5 * bright]);
        }
    }
    let to_ball = BALL - origin;
    let middle = to_ball.dot(along);
    let inside = 0.6 - (to_ball.length_squared() - middle * middle);
    if inside > 0.0 && middle > inside.sqrt() && middle - inside.sqrt() < nearest {
        nearest = middle - inside.sqrt();
        let up = (origin.z + along.z * nearest - BALL.z) / 0.8;
        let light = (0.5 + 0.5 * up) as f32;
        colour = [0.9 * light, 0.2 * light, 0.1 * light];
    }
    (colour, nearest)
}

/// A walk of 1.5 units a second with turns of 90 degrees a second, 30 frames a second, and a second
/// of rest.
fn view(frame: usize) -> Result<View, holo_picture::ViewError> {
    let step = frame.min(FRAMES - 30) as f64;
    let angle = 0.2 + 0.35 * (step / 30.0 * std::f64::consts::PI).sin();
    let eye = DVec3::new(1.5 + 0.05 * step, 3.0 + 0.01 * step, 1.7);
    View::new(eye, DVec3::new(angle.cos(), angle.sin(), -0.05), DVec3::Z, Some(60.0), None, SIZE)
}

fn truth(view: &View) -> Picture {
    let mut picture = Picture::new(SIZE.0, SIZE.1);
    for (pixel, number) in picture.pixels.iter_mut().zip(0..) {
        let (column, row) = (number % SIZE.0, number / SIZE.0);
        let mut sum = [0.0; 3];
        for part in 0..16 {
            let x = (f64::from(column) + (f64::from(part % 4) + 0.5) / 4.0) / f64::from(SIZE.0);
            let y = 1.0 - (f64::from(row) + (f64::from(part / 4) + 0.5) / 4.0) / f64::from(SIZE.1);
            let (eye, along) = view.ray(x, y);
            let colour = room(eye, along).0;
            sum = [0, 1, 2].map(|i| sum[i] + colour[i] / 16.0);
        }
        *pixel = sum;
    }
    picture
}

/// A server that gives its newest view's beams their share, the least filled first.
#[derive(Default)]
struct Server {
    rays: HashMap<BeamId, u32>,
}

impl Server {
    fn deal(
        &mut self,
        section: &Section,
        beams: &[(BeamId, f32)],
        eye: &Viewpoint,
        count: usize,
    ) -> Vec<(BeamId, RayCoords)> {
        let mut dealt = Vec::new();
        while dealt.len() < count {
            let ratio = |&(beam, weight): &(BeamId, f32)| {
                f64::from(self.rays.get(&beam).copied().unwrap_or(0)) / f64::from(weight)
            };
            let Some(&(beam, weight)) = beams.iter().min_by(|a, b| ratio(a).total_cmp(&ratio(b)))
            else {
                break;
            };
            let number = self.rays.entry(beam).or_default();
            let Some(sampler) = section.beam_sampler(0, beam, Some(eye)) else { break };
            let packet = (weight / 2.0).max(*number as f32 / 4.0).clamp(1.0, 21.0) as u32;
            dealt.extend((*number..*number + packet).map(|number| (beam, sampler.coords(number))));
            *number += packet;
        }
        dealt
    }
}

fn walk(way: Way, mismatch: usize) -> Result<[f64; 2], Box<dyn Error>> {
    let axes = [[9.6, 0.0, 0.0], [0.0, 7.6, 0.0], [0.0, 0.0, 3.6]];
    let spec = SectionSpec {
        origin: [0.2; 3],
        axes,
        grid: [24, 19, 9],
        class: ViewClass::Interior,
        obstructions: true,
    };
    let sections = [Section::new(spec)?];
    let section = &sections[0];
    let (count, step) = ((SIZE.0 * SIZE.1) as usize / mismatch, 0.4 / 256.0);
    let mut cache = PointImage::new(SIZE, PointImageParams::default())?;
    let (mut server, mut samples) = (Server::default(), Vec::new());
    let (mut moving, mut resting) = ((0.0, 0), (0.0, 0));
    for frame in 0..FRAMES {
        let (now, next) = (view(frame)?, view(frame + 1)?);
        let radius = viewpoint_radius(&now, SIZE, 1.0, SPREAD).max(step);
        let made = cache.frame(&Moment {
            view: now,
            predicted: Some(next),
            samples: &samples,
            wanted: count,
        });
        if frame % 10 == 9 {
            let quality = compare(&made.picture(), &truth(&now))?.psnr_disp;
            let sum = if frame < FRAMES - 30 { &mut moving } else { &mut resting };
            *sum = (sum.0 + quality, sum.1 + 1);
        }
        let stored = match way {
            Way::Exactly => {
                samples = (made.requests())
                    .map(|(tag, eye, along)| {
                        let (radiance, distance) = room(eye, along);
                        PointSample {
                            tag,
                            ..PointSample::new(Place::At(eye + along * distance), radiance)
                        }
                    })
                    .collect();
                continue;
            }
            Way::SingleRays => made
                .rays(&sections)
                .into_iter()
                .map(|(_, key, coords)| (key.beam, coords))
                .collect(),
            Way::Beams => {
                let beams = select_beams(&sections, &now, SIZE, &SelectOptions::default()).beams;
                let weighed: Vec<_> = made
                    .weigh(&sections, &beams, 0.75)
                    .iter()
                    .map(|wanted| (wanted.key.beam, wanted.weight))
                    .collect();
                server.deal(section, &weighed, &Viewpoint { eye: now.vp.to_array(), radius }, count)
            }
        };
        // A ray that passes the eye is its pixel's own, as in a display.
        samples.clear();
        for (beam, coords) in stored {
            let Some(pair) = section.cells(beam) else { continue };
            let ray = section.ray(pair, coords);
            let (radiance, distance) = room(ray.origin, ray.direction);
            let place = ray.origin + ray.direction * distance;
            let Some((x, y, _)) = now.project(place) else { continue };
            let is_near = ray_eye_distance(&ray, now.vp) <= radius + step;
            let pixel = View::pixel_at(SIZE, x, y);
            let tag = pixel.and_then(|(column, row)| {
                if is_near { cache.pixel_tag(column, row) } else { cache.guess_tag(column, row) }
            });
            samples.push(PointSample {
                tag: tag.unwrap_or_default(),
                ..PointSample::new(Place::At(place), radiance)
            });
        }
    }
    Ok([moving, resting].map(|(sum, count)| sum / f64::from(count)))
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("PSNR in dB, walking and at rest, of one new sample for so many pixels each frame");
    for mismatch in [8, 64, 256] {
        for way in [Way::Exactly, Way::SingleRays, Way::Beams] {
            let [moving, resting] = walk(way, mismatch)?;
            println!("1 in {mismatch:3}, {way:10?}: {moving:.2} {resting:.2}");
        }
    }
    Ok(())
}
