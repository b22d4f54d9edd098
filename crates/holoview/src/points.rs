//! The drivers that need nothing but samples, and that keep what they have from one view to the next: the render cache and
//! frameless rendering.
//!
//! The rays that the render cache wants are asked for one by one, as the nearest that can be stored, and become weights of the view's
//! beams too, for tracers that are faster than it asks. A sample counts as a pixel's own if its ray passes the eye as near as was asked for, which is a quarter of what other drivers ask for: but
//! never less than a step of ray coordinates, since rays lie on a lattice (with less, whole rows of pixels missed part of what they see).
//!
//! What always holds:
//! - a pixel that no section covers stays 0, and one whose beam is known to see nothing shows the sky;
//! - at rest a pixel is the mean of its own rays; what was stored for other views fills in until those come.

use std::{
    collections::HashSet,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use anyhow::Result;
use glam::DVec3;
use holo_display::{
    Frame, WantedBeam,
    frameless::Frameless,
    pointimage::{
        Moment, Place, PointImage, PointImageParams, Sample as PointSample, Stage, best_beam,
        far_depth,
    },
    viewpoint_radius,
};
use holo_picture::{Clip, Picture, View, ViewKind};
use holo_section::{BeamId, RayCoords, Sample, Section, ray_eye_distance};
use serde::Serialize;

use crate::point_args::Part;

/// Samples a pixel for which rays must pass the eye so near: within a quarter of a pixel's footprint on the nearest surface.
const SAMPLES_PER_PIXEL: f64 = 16.0;

/// Share of a view's beams' weight that is dealt by the pixels that want rays most; the rest by the pixels that beams serve.
const BY_REQUESTS: f32 = 0.75;

/// One request for so many pixels decides that share.
const PIXELS_PER_REQUEST: usize = 16;

/// In a parallel view, cosine of the angle to it up to which what a ray tells is taken for what the view sees: a ray that met
/// nothing, since where along it nothing begins is not known. Some 6°, as in a cell of a coarse grid.
const ALONG: f64 = 0.995;

/// How long a stage of a picture took.
#[derive(Clone, Debug, Serialize)]
pub struct StageTime {
    /// Its name, as in Walter et al. 2002, Table 1.
    pub stage: &'static str,
    /// Wall clock.
    pub milliseconds: f64,
}

/// Which of the drivers.
#[derive(Clone, Debug)]
pub enum Kind {
    /// The render cache.
    PointImage(PointImageParams),
    /// Pixels refreshed one by one.
    Frameless,
}

/// A driver for all views of a session. Clones share it.
#[derive(Clone)]
pub struct Points(Arc<Mutex<State>>);

struct State {
    sections: Arc<[Section]>,
    sky: [f32; 3],
    kind: Kind,
    shown: Option<Shown>,
}

/// The driver and the view that it shows.
struct Shown {
    driver: Driver,
    view: View,
    size: (u32, u32),
    /// How near to the eye the rays of the view pass.
    radius: f64,
    /// Best beam of every pixel's middle, once a picture was made of the view.
    best: Vec<Option<(u16, BeamId)>>,
    unseen: HashSet<(u16, BeamId)>,
    /// Distance from the eye of each pixel's newest sample, 0 without one; the render cache knows its own.
    depth: Vec<f32>,
    used: u64,
}

enum Driver {
    PointImage(Box<PointImage>),
    Frameless(Box<Frameless>),
}

impl Points {
    pub fn new(kind: Kind, sections: Arc<[Section]>, sky: [f32; 3]) -> Self {
        Self(Arc::new(Mutex::new(State { sections, sky, kind, shown: None })))
    }

    /// As after `--driver`.
    pub fn name(&self) -> &'static str {
        match self.lock().kind {
            Kind::PointImage(_) => "pointimage",
            Kind::Frameless => "frameless",
        }
    }

    /// Takes another view, and says how much of each of its `beams` is wanted, considering what is shown already.
    pub fn look(
        &self,
        view: View,
        size: (u32, u32),
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>> {
        self.lock().look(view, size, beams)
    }

    /// Leaves parts of the render cache out, or takes them in again, from the next picture on. False if the driver has no such parts.
    pub fn switch(&self, parts: &[Part], on: bool) -> bool {
        let mut state = self.lock();
        let State { kind: Kind::PointImage(params), shown, .. } = &mut *state else { return false };
        parts.iter().for_each(|part| *part.of(&mut params.stages) = on);
        if let Some(Shown { driver: Driver::PointImage(cache), .. }) = shown {
            cache.set_stages(params.stages);
        }
        true
    }

    /// The rays that would improve the picture most, if the driver can say.
    pub fn wanted_rays(&self) -> Vec<(u16, BeamId, RayCoords)> {
        let mut state = self.lock();
        let State {
            sections,
            shown: Some(Shown { driver: Driver::PointImage(cache), view, size, .. }),
            ..
        } = &mut *state
        else {
            return Vec::new();
        };
        let wanted = size.0 as usize * size.1 as usize / PIXELS_PER_REQUEST;
        cache.frame(&Moment { view: *view, predicted: None, samples: &[], wanted }).rays(sections)
    }

    /// How near to the eye rays are to pass if the nearest visible surface is at `nearest`.
    pub fn radius(&self, view: &View, size: (u32, u32), nearest: f64) -> f64 {
        radius(&self.lock().sections, view, size, nearest)
    }

    /// Puts the distance of the nearest visible surface right.
    pub fn set_nearest(&self, nearest: f64) {
        let mut state = self.lock();
        let State { sections, shown: Some(shown), .. } = &mut *state else { return };
        shown.radius = radius(sections, &shown.view, shown.size, nearest);
    }

    pub fn insert(&self, section: u16, beam: BeamId, samples: &[Sample]) {
        let mut state = self.lock();
        let State { sections, shown: Some(shown), .. } = &mut *state else { return };
        let Some(known) = sections.get(usize::from(section)) else { return };
        shown.insert(known, beam, samples);
    }

    pub fn insert_unseen(&self, section: u16, beam: BeamId) {
        let mut state = self.lock();
        let is_known = state
            .sections
            .get(usize::from(section))
            .is_some_and(|known| beam.0 < known.beam_count());
        if let Some(shown) = state.shown.as_mut().filter(|_| is_known) {
            shown.unseen.insert((section, beam));
        }
    }

    /// The picture, and how long each stage of it took.
    pub fn draw(&self) -> (Frame, Vec<StageTime>) {
        let mut state = self.lock();
        let State { sections, shown, sky, .. } = &mut *state;
        shown.as_mut().map_or_else(|| (nothing(), Vec::new()), |shown| shown.draw(sections, *sky))
    }

    /// A panic elsewhere leaves no picture half made that matters.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The picture before the first view.
pub fn nothing() -> Frame {
    Frame {
        picture: Picture::new(1, 1),
        depth: vec![0.0],
        uncovered_pixels: 1,
        empty_pixels: 0,
        unseen_pixels: 0,
        samples_used: 0,
    }
}

fn radius(sections: &[Section], view: &View, size: (u32, u32), nearest: f64) -> f64 {
    let finest = sections.iter().map(step).fold(f64::INFINITY, f64::min);
    viewpoint_radius(view, size, nearest, SAMPLES_PER_PIXEL).max(finest)
}

/// The longest step of a section's ray coordinates.
fn step(section: &Section) -> f64 {
    let spec = section.spec();
    let cell =
        |axis: usize| DVec3::from_array(spec.axes[axis]).length() / f64::from(spec.grid[axis]);
    (0..3).map(cell).fold(0.0, f64::max) / 256.0
}

impl State {
    fn look(
        &mut self,
        view: View,
        size: (u32, u32),
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>> {
        let before = self.shown.take();
        let earlier = before.as_ref().map(|shown| shown.view);
        let keeps = |shown: &Shown| shown.size == size && sees_alike(&shown.view, &view);
        let driver = match (before.filter(keeps), &self.kind) {
            (Some(shown), _) => shown.driver,
            (None, Kind::PointImage(params)) => {
                Driver::PointImage(Box::new(PointImage::new(size, params.clone())?))
            }
            (None, Kind::Frameless) => Driver::Frameless(Box::new(Frameless::new(size, view, 0)?)),
        };
        let mut shown = Shown {
            driver,
            view,
            size,
            radius: 0.0,
            best: Vec::new(),
            unseen: HashSet::new(),
            depth: vec![0.0; size.0 as usize * size.1 as usize],
            used: 0,
        };
        let weights = match &mut shown.driver {
            Driver::Frameless(frameless) => {
                frameless.look(view);
                beams
            }
            Driver::PointImage(cache) => {
                let predicted = earlier.and_then(|earlier| ahead(&earlier, &view));
                let wanted = size.0 as usize * size.1 as usize / PIXELS_PER_REQUEST;
                let frame = cache.frame(&Moment { view, predicted, samples: &[], wanted });
                frame.weigh(&self.sections, &beams, BY_REQUESTS)
            }
        };
        self.shown = Some(shown);
        Ok(weights)
    }
}

/// Whether what is kept for one view is good for another. Parallel views keep what is infinitely far away by where it is seen, and what
/// is clipped is black.
fn sees_alike(before: &View, now: &View) -> bool {
    if (before.vo, before.va) != (now.vo, now.va) {
        return false;
    }
    before.kind.has_eye() && now.kind.has_eye() || before.kind == now.kind && before.vd == now.vd
}

/// Where a view will be that goes on as it came from `earlier` to `now`.
fn ahead(earlier: &View, now: &View) -> Option<View> {
    let vp = now.vp + (now.vp - earlier.vp);
    let vd = now.vd + (now.vd - earlier.vd);
    // Half turns lead nowhere.
    let is_same_walk = now.vd.dot(earlier.vd) > 0.0 && now.kind == earlier.kind;
    now.moved(vp, vd).ok().filter(|_| is_same_walk)
}

impl Shown {
    fn insert(&mut self, section: &Section, beam: BeamId, samples: &[Sample]) {
        let Some(pair) = section.cells(beam) else { return };
        // What was snapped to the lattice may pass by a step farther off.
        let near = self.radius + step(section);
        for sample in samples {
            let ray = section.ray(pair, sample.coords);
            let distance = sample.distance(section.diagonal());
            let (place, seen) = if distance.is_finite() {
                let place = ray.origin + ray.direction * distance;
                (Place::At(place), self.view.project(place))
            } else if !self.view.kind.has_eye() {
                // Where the ray leaves the section it still sees what the view sees there.
                let seen = self.view.project(ray.origin + ray.direction * ray.length);
                let seen = seen.filter(|_| ray.direction.dot(self.view.vd) >= ALONG);
                (Place::Toward(self.view.vd), seen.map(|(x, y, _)| (x, y, f64::INFINITY)))
            } else {
                let seen = self.view.project_direction(ray.direction);
                (Place::Toward(ray.direction), seen.map(|(x, y)| (x, y, f64::INFINITY)))
            };
            let Some((x, y, mut seen_at)) = seen else { continue };
            let clip = match place {
                Place::At(place) => self.view.clip(place),
                Place::Toward(_) if self.view.clips_sky() => Clip::Beyond,
                Place::Toward(_) => Clip::Shown,
            };
            let mut rgb = sample.rgb();
            match clip {
                Clip::Before => continue,
                Clip::Shown => {}
                Clip::Beyond => (seen_at, rgb) = (f64::INFINITY, [0.0; 3]),
            }
            let eye = match place {
                Place::At(place) => self.view.ray_to(place).0,
                // Of a parallel view, where the ray begins: it goes along with the view, or was not let in.
                Place::Toward(_) if self.view.kind.has_eye() => self.view.eye(),
                Place::Toward(_) => ray.origin,
            };
            let is_near = ray_eye_distance(&ray, eye) <= near;
            let pixel = View::pixel_at(self.size, x, y);
            match (&mut self.driver, pixel) {
                (Driver::PointImage(cache), Some((column, row))) if is_near => {
                    if let Some(tag) = cache.pixel_tag(column, row) {
                        let noise = f32::INFINITY;
                        cache.insert(&[PointSample { tag, noise, ..PointSample::new(place, rgb) }]);
                        self.used += 1;
                    }
                }
                (Driver::PointImage(cache), Some((column, row))) => {
                    if let Some(tag) = cache.guess_tag(column, row) {
                        let noise = f32::INFINITY;
                        cache.insert(&[PointSample { tag, noise, ..PointSample::new(place, rgb) }]);
                        self.used += 1;
                    }
                }
                (Driver::Frameless(frameless), Some((column, row))) => {
                    if let Some(tag) = frameless.pixel_tag(column, row) {
                        if is_near {
                            frameless.insert(tag, rgb);
                            self.depth[row as usize * self.size.0 as usize + column as usize] =
                                seen_at as f32;
                        } else {
                            frameless.guess(tag, rgb);
                        }
                        self.used += 1;
                    }
                }
                (_, None) => {}
            }
        }
    }

    fn draw(&mut self, sections: &[Section], sky: [f32; 3]) -> (Frame, Vec<StageTime>) {
        if self.best.is_empty() {
            let (width, height) = self.size;
            let middle = |pixel| View::pixel_centre(self.size, pixel % width, pixel / width);
            let ray = |(x, y)| self.view.clipped_ray(x, y);
            let rays = (0..width * height).map(|pixel| ray(middle(pixel)));
            self.best = rays
                .map(|ray| ray.and_then(|(eye, direction, _)| best_beam(sections, eye, direction)))
                .collect();
        }
        let mut stages = Vec::new();
        let (picture, depth) = match &mut self.driver {
            Driver::PointImage(cache) => {
                let mut last = Instant::now();
                let mut ended = |stage: Stage| {
                    let now = Instant::now();
                    let milliseconds = 1e3 * (now - last).as_secs_f64();
                    stages.push(StageTime { stage: stage.name(), milliseconds });
                    last = now;
                };
                let moment = Moment { view: self.view, predicted: None, samples: &[], wanted: 0 };
                let frame = cache.frame_watched(&moment, &mut ended);
                (frame.picture(), distances(&self.view, self.size, frame.depth()))
            }
            Driver::Frameless(frameless) => {
                // What is left of other views is shown, though nothing is known of it.
                let shown = frameless.has_colour().zip(&self.depth);
                let depth = |(has, &depth)| if has && depth == 0.0 { f32::INFINITY } else { depth };
                (frameless.picture().clone(), shown.map(depth).collect())
            }
        };
        let mut frame = Frame {
            picture,
            depth,
            uncovered_pixels: 0,
            empty_pixels: 0,
            unseen_pixels: 0,
            samples_used: self.used,
        };
        frame.picture.view = Some(self.view);
        for ((best, pixel), depth) in
            self.best.iter().zip(&mut frame.picture.pixels).zip(&mut frame.depth)
        {
            match best {
                None => {
                    (*pixel, *depth) = ([0.0; 3], 0.0);
                    frame.uncovered_pixels += 1;
                }
                Some(beam) if self.unseen.contains(beam) => {
                    let sky = if self.view.clips_sky() { [0.0; 3] } else { sky };
                    (*pixel, *depth) = (sky, f32::INFINITY);
                    frame.unseen_pixels += 1;
                }
                Some(_) => frame.empty_pixels += u64::from(*depth == 0.0),
            }
        }
        (frame, stages)
    }
}

/// Distances from where rays begin, of depths as [`PointImage`] has them.
fn distances(view: &View, size: (u32, u32), depth: impl Iterator<Item = f32>) -> Vec<f32> {
    let far = far_depth(view);
    let distance = |(pixel, depth): (u32, f32)| {
        if f64::from(depth) >= far {
            return f32::INFINITY;
        }
        if view.kind != ViewKind::Perspective {
            return depth;
        }
        let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
        let (_, direction) = view.ray(x, y);
        (f64::from(depth) / direction.dot(view.vd)) as f32
    };
    (0..).zip(depth).map(distance).collect()
}

#[cfg(test)]
mod tests {
    use holo_section::{SectionSpec, ViewClass};

    use super::*;
    use crate::point_args::{EmptyArg, PointArgs};

    const SIZE: (u32, u32) = (48, 36);

    /// A driver that looks at a checked wall, of which it has a sample for every third pixel.
    fn driver() -> Points {
        let axes = [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]];
        let spec = SectionSpec {
            origin: [-1.0; 3],
            axes,
            grid: [8; 3],
            class: ViewClass::Interior,
            obstructions: true,
        };
        let section = Section::new(spec).unwrap();
        let args = PointArgs { empty_pixels: EmptyArg::Black, ..PointArgs::default() };
        let points =
            Points::new(Kind::PointImage(args.params()), Arc::from([section.clone()]), [0.0; 3]);
        let view = View::new(DVec3::ZERO, DVec3::Y, DVec3::Z, Some(60.0), None, SIZE).unwrap();
        points.look(view, SIZE, Vec::new()).unwrap();
        points.set_nearest(5.0);
        for pixel in (0..SIZE.0 * SIZE.1).step_by(3) {
            let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
            let (eye, direction) = view.ray(x, y);
            let hit = section.line(eye, direction).unwrap();
            let distance = 5.0 / direction.y - hit.entry_t;
            let rgb = [0.5 + 0.4 * (pixel % 2) as f32; 3];
            let sample = Sample::encode(hit.coords, rgb, distance, section.diagonal(), 0);
            points.insert(0, section.beam(hit.pair), &[sample]);
        }
        points
    }

    /// Names of stages that ran, and pixels that show nothing.
    fn drawn(points: &Points) -> (Vec<&'static str>, Picture, usize) {
        let (frame, stages) = points.draw();
        let black = frame.picture.pixels.iter().filter(|pixel| **pixel == [0.0; 3]).count();
        (stages.iter().map(|time| time.stage).collect(), frame.picture, black)
    }

    #[test]
    fn parts_are_left_out_at_once_and_come_back() {
        let points = driver();
        let (prefilter, interpolation) = (Stage::Prefilter.name(), Stage::Interpolate.name());
        let (stages, all, black) = drawn(&points);
        assert!(
            stages.contains(&prefilter) && stages.contains(&interpolation) && black == 0,
            "{stages:?} {black}"
        );
        assert!(points.switch(&[Part::Prefilter, Part::Interpolation], false));
        let (stages, _, black) = drawn(&points);
        assert!(!stages.contains(&prefilter), "{stages:?}");
        assert!(
            black > (SIZE.0 * SIZE.1 / 2) as usize,
            "what no sample is near shows nothing: {black}"
        );
        assert!(points.switch(&[Part::Interpolation], true));
        let (_, _, some) = drawn(&points);
        assert!(some < black, "{some} {black}");
        assert!(points.switch(&[Part::Prefilter], true));
        let (stages, again, _) = drawn(&points);
        assert!(stages.contains(&prefilter) && again.pixels == all.pixels);
        // Nothing changes: nothing is computed.
        assert!(
            points.switch(&[Part::Prefilter], true)
                && drawn(&points).0 == [Stage::UpdatePoints.name()]
        );
        // Another size is another cache: it has the parts that were chosen.
        points.switch(&[Part::Prefilter], false);
        let view = View::new(DVec3::ZERO, DVec3::Y, DVec3::Z, Some(60.0), None, (40, 30)).unwrap();
        points.look(view, (40, 30), Vec::new()).unwrap();
        assert!(!drawn(&points).0.contains(&prefilter));
    }

    #[test]
    fn a_driver_without_parts_says_so() {
        let points = Points::new(Kind::Frameless, Arc::from([]), [0.0; 3]);
        assert!(!points.switch(&[Part::Dither], false));
    }

    #[test]
    fn what_is_kept_of_another_type_of_view_is_used_only_if_it_means_the_same() {
        let view = |words: &str| {
            View::parse_vf(&format!("-vp 0 0 0 {words}")).unwrap().resolve(SIZE).unwrap().0
        };
        let (perspective, fisheye) = (view("-vd 0 1 0"), view("-vd 0 1 0 -vta"));
        let (parallel, turned) = (view("-vd 0 1 0 -vtl -vh 3"), view("-vd 1 1 0 -vtl -vh 3"));
        assert!(
            sees_alike(&perspective, &fisheye)
                && sees_alike(&parallel, &view("-vd 0 2 0 -vtl -vh 9"))
        );
        assert!(!sees_alike(&perspective, &view("-vd 0 1 0 -va 3")));
        assert!(!sees_alike(&perspective, &parallel) && !sees_alike(&parallel, &turned));
    }
}
