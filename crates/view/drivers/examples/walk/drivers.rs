//! One interface to all drivers. A view goes in and wanted rays come out; then samples go in and a
//! picture comes out.

use crate::live::{Live, RequestedRay};
use glam::DVec3;
use holo_display::{
    Age, DriverError, FramePhase, FrameRequest, Interrupt, LiveSample, SelectOptions, mix,
};
use holo_driver_mesh::mesh_driver;
use holo_driver_quadtree::{Filling, cells_driver, quadtree_driver};
use holo_driver_rendercache::frameless::{Frameless, PixelTag};
use holo_driver_rendercache::{
    Moment, Place, PointImage, PointImageParams, RayResult, Smoothing, Stages, Tag,
    frameless_driver, pointimage_driver,
};
use holo_driver_surfaces::surfaces_driver;
use holo_picture::{Picture, View};
use holo_raycast::Raycaster;
use holo_section::{BeamId, BeamKey, LineHit, Section};
use std::error::Error;
use std::sync::Arc;

/// A wanted ray: its direction has length 1.
pub struct Wanted {
    pub origin: DVec3,
    pub direction: DVec3,
    purpose: Purpose,
}

enum Purpose {
    Point(Tag),
    Pixel(PixelTag),
    /// Section, beam and sample coordinates, and the distance from the ray's beginning in the
    /// section to the traced origin.
    Beam(u16, BeamId, holo_section::RayCoords, f64),
    /// A ray for one view, outside all sections.
    Live,
    /// A stored ray that the driver of a session requests.
    Requested(RequestedRay),
}

impl Wanted {
    /// Returns a ray that the driver of a session requests.
    pub fn requested(origin: DVec3, direction: DVec3, ray: RequestedRay) -> Wanted {
        Wanted { origin, direction, purpose: Purpose::Requested(ray) }
    }
}

/// The traced result of a wanted ray.
pub struct Answer {
    pub radiance: [f32; 3],
    pub distance: f64,
    /// Expected standard deviation of the largest channel.
    pub noise: f32,
}

pub enum Driver {
    Points(Box<PointImage>, Vec<RayResult>),
    Frameless(Box<Frameless>),
    /// As a session uses it.
    Live(Box<Live>),
    Stored {
        stored: Box<Stored>,
        draws: Draws,
    },
}

/// The driver that draws stored samples.
pub enum Draws {
    Quadtree,
    Cells,
    Mesh,
    Surfaces(Arc<Raycaster>),
}

/// Samples of the sections, as a server would store them, and live rays of one view, as a display
/// would keep them.
pub struct Stored {
    sections: Arc<[Section]>,
    samples: Vec<(u16, BeamId, holo_section::Sample)>,
    live: Vec<LiveSample>,
    live_view: View,
    paths: u16,
    random: u64,
    sky: [f32; 3],
}

/// Everything needed to make a driver.
pub struct Making<'a> {
    pub size: (u32, u32),
    pub first: View,
    pub sections: &'a Arc<[Section]>,
    pub raycaster: &'a Arc<Raycaster>,
    pub paths: u16,
    pub sky: [f32; 3],
}

impl Driver {
    /// Makes a driver by its name; `pointimage-STAGE` is the render cache without that stage, and
    /// `DRIVER-live` the driver as a session uses it.
    pub fn new(name: &str, making: &Making) -> Result<Self, Box<dyn Error>> {
        let points = |params| -> Result<Self, Box<dyn Error>> {
            Ok(Self::Points(Box::new(PointImage::new(making.size, params)?), Vec::new()))
        };
        let params = PointImageParams::default();
        let without = |change: fn(&mut Stages)| {
            let mut params = PointImageParams::default();
            change(&mut params.stages);
            params
        };
        let stored = || {
            Box::new(Stored {
                sections: Arc::clone(making.sections),
                samples: Vec::new(),
                live: Vec::new(),
                live_view: making.first,
                paths: making.paths,
                random: 1,
                sky: making.sky,
            })
        };
        match name {
            "pointimage" => points(params),
            "1999" => points(PointImageParams {
                stages: Stages::OF_1999,
                smoothing: Smoothing::Everywhere,
                noise_smoothing: 0.0,
                ..params
            }),
            "pointimage-noise" => points(PointImageParams { noise_smoothing: 0.0, ..params }),
            "pointimage-prediction" => points(without(|stages| stages.prediction = false)),
            "pointimage-prefilter" => points(without(|stages| stages.prefilter = false)),
            "pointimage-pyramid" => points(without(|stages| stages.pyramid = false)),
            "pointimage-eviction" => points(without(|stages| stages.eviction = false)),
            "pointimage-ageing" => points(without(|stages| stages.ageing = false)),
            "pointimage-cull" => points(without(|stages| stages.depth_cull = false)),
            "pointimage-interpolation" => points(without(|stages| stages.interpolation = false)),
            "pointimage-dither" => points(without(|stages| stages.dither = false)),
            "pointimage-live" => {
                let params = PointImageParams { moving_mean: 32, ..params };
                let driver = pointimage_driver(Arc::clone(making.sections), making.sky, params);
                Ok(Self::Live(Box::new(Live::new(driver, making))))
            }
            "frameless-live" => {
                let driver = frameless_driver(Arc::clone(making.sections), making.sky);
                Ok(Self::Live(Box::new(Live::new(driver, making))))
            }
            "frameless" => {
                Ok(Self::Frameless(Box::new(Frameless::new(making.size, making.first, 1)?)))
            }
            "quadtree" => Ok(Self::Stored { stored: stored(), draws: Draws::Quadtree }),
            "cells" => Ok(Self::Stored { stored: stored(), draws: Draws::Cells }),
            "mesh" => Ok(Self::Stored { stored: stored(), draws: Draws::Mesh }),
            "surfaces" => Ok(Self::Stored {
                stored: stored(),
                draws: Draws::Surfaces(Arc::clone(making.raycaster)),
            }),
            _ => Err(format!("`{name}` is not a driver").into()),
        }
    }

    /// Shows a view with the samples that have arrived. Returns the rays wanted next, and the
    /// picture if `shown`.
    pub fn frame(
        &mut self,
        view: View,
        predicted: View,
        wanted: usize,
        shown: bool,
    ) -> Result<(Vec<Wanted>, Option<Picture>), DriverError> {
        match self {
            Self::Points(cache, samples) => {
                let frame =
                    cache.frame(&Moment { view, predicted: Some(predicted), samples, wanted });
                let picture = shown.then(|| frame.picture());
                let rays = frame.requests();
                let rays = rays.map(|(tag, origin, direction)| Wanted {
                    origin,
                    direction,
                    purpose: Purpose::Point(tag),
                });
                Ok((rays.collect(), picture))
            }
            Self::Frameless(driver) => {
                driver.look(view);
                let picture = shown.then(|| driver.picture().clone());
                let rays = driver.requests(wanted);
                let rays = rays.map(|(tag, origin, direction)| Wanted {
                    origin,
                    direction,
                    purpose: Purpose::Pixel(tag),
                });
                Ok((rays.collect(), picture))
            }
            Self::Live(live) => live.frame(view, wanted, shown),
            Self::Stored { stored, draws } => {
                let picture = shown.then(|| stored.draw(draws, view)).transpose()?;
                if stored.live_view != predicted {
                    stored.live.clear();
                    stored.live_view = predicted;
                }
                Ok(((0..wanted).map(|_| stored.wanted(&predicted)).collect(), picture))
            }
        }
    }

    /// Receives the answers to the rays of the last frame.
    pub fn take(&mut self, rays: &[Wanted], answers: &[Answer]) {
        if let Self::Points(_, samples) = self {
            samples.clear();
        }
        for ((ray, answer), number) in rays.iter().zip(answers).zip(0..) {
            match (&mut *self, &ray.purpose) {
                (Self::Points(_, samples), Purpose::Point(tag)) => {
                    let place = if answer.distance.is_finite() {
                        Place::At(ray.origin + ray.direction * answer.distance)
                    } else {
                        Place::Toward(ray.direction)
                    };
                    samples.push(RayResult {
                        tag: *tag,
                        noise: answer.noise,
                        ..RayResult::new(place, answer.radiance)
                    });
                }
                (Self::Live(live), Purpose::Requested(ray)) => {
                    live.take(ray, answer, mix(0, number))
                }
                (Self::Frameless(driver), Purpose::Pixel(tag)) => {
                    driver.insert(*tag, answer.radiance)
                }
                (Self::Stored { stored, .. }, Purpose::Beam(section, beam, coords, ahead)) => {
                    let diagonal = stored.sections[usize::from(*section)].diagonal();
                    let (distance, dither) = (answer.distance + ahead, stored.bits() as u32);
                    let sample = holo_section::Sample::encode(
                        *coords,
                        answer.radiance,
                        distance,
                        diagonal,
                        dither,
                    );
                    stored.samples.push((*section, *beam, sample));
                }
                (Self::Stored { stored, .. }, Purpose::Live) => {
                    let (origin, direction) = (ray.origin, ray.direction);
                    let Answer { radiance, distance, .. } = *answer;
                    stored.live.push(LiveSample { origin, direction, radiance, distance });
                }
                _ => {}
            }
        }
    }
}

impl Stored {
    /// Draws a view with a newly made driver.
    fn draw(&self, draws: &Draws, view: View) -> Result<Picture, DriverError> {
        let (sections, sky) = (Arc::clone(&self.sections), self.sky);
        let holo_display::Driver { mut light, mut renderer, .. } = match draws {
            Draws::Quadtree => quadtree_driver(sections, sky),
            Draws::Cells => cells_driver(sections, sky, Filling::Smooth),
            Draws::Mesh => mesh_driver(sections, sky),
            Draws::Surfaces(raycaster) => surfaces_driver(sections, Arc::clone(raycaster), None),
        };
        renderer.look(&FrameRequest { view, size: crate::SIZE, is_moving: false })?;
        for (section, beam, samples) in self.beams() {
            light.insert(Age::Present, BeamKey { section, beam }, self.paths, &samples);
        }
        renderer.insert_live(self.paths, self.live_of(&view));
        let drawn = renderer.draw(FramePhase::First, &Interrupt::default(), &mut |_| {});
        Ok(drawn.map_or_else(|| Picture::new(crate::SIZE.0, crate::SIZE.1), |frame| frame.picture))
    }

    /// Returns the live rays of a view.
    fn live_of(&self, view: &View) -> &[LiveSample] {
        if self.live_view == *view { &self.live } else { &[] }
    }

    /// Returns all samples so far, beam by beam.
    fn beams(&self) -> impl Iterator<Item = (u16, BeamId, Vec<holo_section::Sample>)> {
        let mut order: Vec<_> = self.samples.iter().collect();
        order.sort_by_key(|sample| (sample.0, sample.1));
        let beams: Vec<_> = order
            .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
            .map(|same| (same[0].0, same[0].1, same.iter().map(|sample| sample.2).collect()))
            .collect();
        beams.into_iter()
    }

    /// Returns a view ray through a random point of the picture, snapped to the coordinates of a
    /// section that it crosses. If it crosses none, it is a live ray of the view. In a section
    /// around the eye, the ray begins at the point nearest to the eye, so that walls behind the eye
    /// do not count.
    fn wanted(&mut self, view: &View) -> Wanted {
        let (x, y) = (self.unit(), self.unit());
        let (eye, along) = view.ray(x, y);
        let Some((number, hit)) = self.section_of(eye, along) else {
            return Wanted { origin: eye, direction: along.normalize(), purpose: Purpose::Live };
        };
        let section = &self.sections[usize::from(number)];
        let ray = section.ray(hit.pair, hit.coords);
        let ahead =
            if hit.exit_t > 0.0 { (eye - ray.origin).dot(ray.direction).max(0.0) } else { 0.0 };
        let purpose = Purpose::Beam(number, section.beam(hit.pair), hit.coords, ahead);
        Wanted { origin: ray.origin + ray.direction * ahead, direction: ray.direction, purpose }
    }

    /// Chooses one of the sections that a view ray crosses, with the weights of displays
    /// ([`SelectOptions::others_share`]). Most rays use the best one: the smallest around the eye,
    /// else the nearest ahead, else the nearest behind.
    fn section_of(&mut self, eye: DVec3, along: DVec3) -> Option<(u16, LineHit)> {
        let (mut around, mut ahead, mut behind) = (Vec::new(), Vec::new(), Vec::new());
        for (number, section) in (0_u16..).zip(self.sections.iter()) {
            let Some(hit) = section.line(eye, along) else { continue };
            match (hit.entry_t > 0.0, hit.exit_t < 0.0) {
                (true, _) => ahead.push((hit.entry_t, number, hit)),
                (_, true) => behind.push((-hit.exit_t, number, hit)),
                _ => around.push((hit.exit_t - hit.entry_t, number, hit)),
            }
        }
        for found in [&mut around, &mut ahead, &mut behind] {
            found.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        around.extend(ahead.first());
        around.extend(behind.first());
        let each = f64::from(SelectOptions::default().others_share);
        let chosen = (self.unit() / each) as usize + 1;
        let (_, number, hit) = around.get(chosen).or(around.first())?;
        Some((*number, *hit))
    }

    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns random bits (SplitMix64).
    fn bits(&mut self) -> u64 {
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }
}
