//! The driver's light, which is the file, and its renderers.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_display::{
    Age, BeamSearch, Camera, Certainty, Driver, DriverError, Frame, FramePhase, FrameRequest,
    Interrupt, Light, LiveSample, PartsRenderer, PixelWeights, RayWishes, Renderer, Search,
    WantedBeam, for_bands, viewpoint_radius,
};
use holo_picture::View;
use holo_section::{BeamKey, RayCoords, Sample};
use holo_splats::SplatFile;

use crate::{
    SplatShape, Traversal,
    holes::filled,
    paint::{PixelRays, paint},
};

const NAME: &str = "splats";

/// Diameter in pixels of the finest splats at rest.
const FINEST: f32 = 1.0;

/// Diameters of the finest splats while the eye moves: the least and the greatest.
const MOVING: (f32, f32) = (1.5, 16.0);

/// Ratio of two diameters that follow each other while the eye moves.
const STEP: f32 = 1.25;

/// Splats for each pixel while the eye moves.
const BUDGET: f64 = 0.25;

/// Rows that are prepared together.
const ROWS: usize = 16;

/// Returns the driver `splats`. `None` is a driver that refuses all views, because there is no
/// file.
pub fn splats_driver(file: Option<Arc<SplatFile>>, shape: SplatShape) -> Driver {
    let light = SplatLight { file, shape };
    // Distances of all surfaces are in the file before any sample has arrived.
    Driver { knows_surfaces: true, ..Driver::new(NAME, light) }
}

/// The light of a file. Samples are not used.
struct SplatLight {
    file: Option<Arc<SplatFile>>,
    shape: SplatShape,
}

impl Light for SplatLight {
    fn renderer(&mut self) -> Box<dyn Renderer> {
        Box::new(SplatRenderer {
            file: self.file.clone(),
            shape: self.shape,
            shown: None,
            finest: MOVING.0,
            damage: None,
        })
    }

    fn room(&self) -> u64 {
        0
    }

    fn insert(&mut self, _age: Age, _beam: BeamKey, _paths: u16, _samples: &[Sample]) {
        // All light is in the file.
    }

    fn remove_earlier(&mut self, _beam: BeamKey, _paths: u16, _samples: &[Sample]) -> bool {
        // None was inserted.
        true
    }

    fn insert_unseen(&mut self, _beam: BeamKey) {}
}

/// A view in camera coordinates.
struct ShownView {
    look: FrameRequest,
    camera: Camera,
    rays: PixelRays,
}

/// Draws views from the file.
struct SplatRenderer {
    file: Option<Arc<SplatFile>>,
    shape: SplatShape,
    shown: Option<ShownView>,
    /// Diameter of the finest splats while the eye moves, pixels. It follows the budget from frame
    /// to frame.
    finest: f32,
    damage: Option<String>,
}

impl SplatRenderer {
    /// Draws the present view with splats of this size, and returns the number of splats too.
    fn frame(
        &mut self,
        finest: f32,
        ended: &mut dyn FnMut(&'static str),
    ) -> Option<(Frame, usize)> {
        let (file, shown) = (self.file.as_ref()?, self.shown.as_ref()?);
        let ShownView { look, camera, rays } = shown;
        let is_clipped = look.view.is_clipped();
        let cut = Traversal::new(file, camera, look.size, finest, is_clipped).cut();
        ended("traversal");
        let header = file.header();
        let painted = paint(&cut.splats, rays, self.shape, header.peak);
        ended("drawing");
        let mut frame = Frame::black(look.size);
        frame.picture.view = Some(look.view);
        let sky = if camera.clips_sky() { [0.0; 3] } else { header.sky };
        frame.picture.pixels = painted.pixels;
        frame.depth = painted.depth;
        let samples = (header.samples / header.surfels.max(1)).clamp(1, u64::from(u32::MAX)) as u32;
        frame.certainty = painted
            .errors
            .iter()
            .map(|&error| Certainty { error, samples: if error.is_finite() { samples } else { 0 } })
            .collect();
        for gap in filled(&frame.picture.pixels, &frame.depth, rays.size) {
            frame.picture.pixels[gap.pixel] = gap.light;
            frame.depth[gap.pixel] = gap.depth;
            frame.empty_pixels += 1;
        }
        for (pixel, depth) in frame.picture.pixels.iter_mut().zip(&mut frame.depth) {
            if *depth == 0.0 {
                (*pixel, *depth) = (sky, f32::INFINITY);
                frame.unseen_pixels += 1;
            }
        }
        frame.samples_used = cut.len() as u64;
        frame.blank_corners(&look.view);
        ended("gaps");
        let count = cut.len();
        if let Some(damage) = cut.damage {
            self.damage = Some(damage.to_string());
        }
        Some((frame, count))
    }
}

impl Renderer for SplatRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        let error = |reason: String| Err(DriverError { driver: NAME, reason });
        if self.file.is_none() {
            return error("there are no splats: make them with `holodeck splats`".to_owned());
        }
        if let Some(damage) = &self.damage {
            return error(damage.clone());
        }
        if self.shown.as_ref().is_none_or(|shown| shown.look != *look) {
            let camera = Camera::new(&look.view, look.size);
            let rays = pixel_rays(&look.view, look.size, &camera);
            self.shown = Some(ShownView { look: *look, camera, rays });
        }
        Ok(())
    }

    fn insert_live(&mut self, _paths: u16, _rays: &[LiveSample]) {}

    fn settle(&mut self) {}

    fn draw(
        &mut self,
        phase: FramePhase,
        _interrupt: &Interrupt,
        stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        if phase != FramePhase::Moving {
            return self.frame(FINEST, stage_ended).map(|(frame, _)| frame);
        }
        let size = self.shown.as_ref()?.look.size;
        let (frame, splats) = self.frame(self.finest, stage_ended)?;
        let budget = BUDGET * f64::from(size.0) * f64::from(size.1);
        let share = splats as f64 / budget;
        let finest = if share > 1.0 {
            self.finest * STEP
        } else if share < 0.5 {
            self.finest / STEP
        } else {
            self.finest
        };
        self.finest = finest.clamp(MOVING.0, MOVING.1);
        Some(frame)
    }

    fn refines(&self) -> bool {
        false
    }

    fn prepare(&mut self, _phase: FramePhase) -> bool {
        false
    }

    fn switch(&mut self, _part: &str, _on: bool) -> bool {
        false
    }

    fn parts(&mut self) -> Option<&mut dyn PartsRenderer> {
        None
    }

    fn wishes(&mut self) -> &mut dyn RayWishes {
        self
    }
}

impl RayWishes for SplatRenderer {
    fn weigh(
        &mut self,
        _look: &FrameRequest,
        _beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        // Samples that arrive would not be drawn.
        Ok(Vec::new())
    }

    fn pixel_weights(&mut self) -> Option<PixelWeights> {
        None
    }

    fn rays(&mut self, _expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>> {
        None
    }

    fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64 {
        viewpoint_radius(&look.view, look.size, nearest, 1.0)
    }

    fn depths(&mut self) -> Vec<f32> {
        let frame = self.frame(MOVING.1, &mut |_| {});
        frame.map_or_else(Vec::new, |(frame, _)| frame.depth)
    }

    fn uncovered(&mut self) -> Vec<u32> {
        Vec::new()
    }

    fn surface_beams(&mut self, _search: Search) -> Option<BeamSearch> {
        None
    }
}

/// Returns the rays of a picture's pixels in camera coordinates.
fn pixel_rays(view: &View, size: (u32, u32), camera: &Camera) -> PixelRays {
    let (width, height) = (size.0 as usize, size.1 as usize);
    let ray = |at: usize| {
        let (x, y) = View::pixel_centre(size, (at % width) as u32, (at / width) as u32);
        view.try_ray(x, y)
    };
    let table = |value: &(dyn Fn((DVec3, DVec3)) -> DVec3 + Sync)| {
        let mut table = vec![Vec3::ZERO; width * height];
        for_bands(&mut table, width, ROWS, |band, rows| {
            for (at, place) in (band * ROWS * width..).zip(rows) {
                *place = ray(at).map_or(Vec3::ZERO, |ray| value(ray).as_vec3());
            }
        });
        table
    };
    let directions = table(&|(_, direction)| camera.to_camera(direction));
    let origins = match view.kind.has_eye() {
        true => Vec::new(),
        false => table(&|(origin, _)| camera.to_camera(origin - camera.eye)),
    };
    PixelRays { directions, origins, size: (width, height) }
}
