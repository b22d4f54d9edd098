//! The driver for whole sessions: one mesh from view to view.
//!
//! While the eye moves a little, new samples go into the same mesh, whose vertices have their places
//! in the scene. Once the eye is far from the canonical eye, the mesh is built anew around the eye
//! from what the old one shows (Larson & Simmons 1999, §2.4.5). A turn of the head needs no new mesh
//! at all.
//!
//! The size of cells follows the size of pixels. While the eye moves, the session draws fewer pixels
//! if the machine is slow, so the mesh has fewer triangles, too.
//!
//! Invariants:
//! - A view at rest has its canonical eye at its eye. Once its stored samples have arrived, pictures
//!   use its own samples alone, and do not depend on the earlier views.
//! - Light of earlier views is forgotten where its direction has turned by more than 20°.
//! - There are at most [`MOST_POINTS`] points of earlier views.

use std::sync::Arc;

use glam::DVec3;
use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, LiveSample,
    PartsRenderer, PixelWeights, RayWishes, Renderer, Search, SkyView, StoringRenderer, ViewLight,
    VisibleEnd, WantedBeam, beams_ending_on, viewpoint_radius,
};
use holo_picture::View;
use holo_section::{BeamKey, RayCoords, Sample, Section};

use crate::cells::{VertexLight, cell_shift};
use crate::chart::{Chart, RayEnd};
use crate::landing::{SampleLanding, SampleProjector};
use crate::mask::PixelMask;
use crate::mesh::LitMesh;
use crate::paint::MeshPainter;
use crate::sums::CellSample;

/// Most points of earlier views that are kept.
const MOST_POINTS: usize = 500_000;
/// Most pixels of a picture whose cells are as large as pixels. Those of larger pictures are larger,
/// so that memory is bounded: about 250 bytes a cell.
const MOST_CELLS: f64 = 1_000_000.0;
/// Share of the middle distance that a moving eye may be away from the canonical eye.
const NEAR_EYE: f64 = 0.1;
/// Largest turn of the direction in which a point is seen, after which its light is still used:
/// glossy surfaces look different from elsewhere.
const MAX_DEGREES: f64 = 20.0;
/// Relative slack of distances in searches for beams: walls of the scene may coincide with those of
/// a section.
const SLACK: f64 = 0.04;
/// Pixels for each known distance that is reported.
const PIXELS_PER_DEPTH: usize = 16;

/// Returns the driver `mesh`. `sky` is what rays of beams show that cannot hit anything.
pub fn mesh_driver(sections: Arc<[Section]>, sky: impl Into<SkyView>) -> Driver {
    let sky = sky.into();
    let make =
        move || MeshRenderer { sections: Arc::clone(&sections), sky: sky.clone(), shown: None };
    Driver::new("mesh", ViewLight::new(make))
}

/// Draws one view after another.
struct MeshRenderer {
    sections: Arc<[Section]>,
    sky: SkyView,
    /// `None` before the first view.
    shown: Option<MeshView>,
}

/// The current view.
struct MeshView {
    look: FrameRequest,
    mesh: LitMesh,
    mask: PixelMask,
    painter: MeshPainter,
    /// Points of earlier views that the mesh does not show.
    dormant: Vec<MeshPoint>,
    samples_used: u64,
    /// True for each section that does not contain the eye while another one does.
    is_elsewhere: Vec<bool>,
}

/// Light of a vertex, at its place in the scene.
#[derive(Clone, Copy)]
struct MeshPoint {
    end: RayEnd,
    /// Direction in which it was seen, a unit vector.
    seen: DVec3,
    light: VertexLight,
}

impl MeshView {
    fn new(sections: &[Section], look: &FrameRequest, before: Option<MeshView>) -> MeshView {
        let FrameRequest { view, size, is_moving } = *look;
        let shift = shift(look);
        let (mesh, dormant) = match before {
            Some(before) if before.serves(look, shift) => before.into_next(),
            before => {
                let points = before.map_or_else(Vec::new, MeshView::into_points);
                let projector = SampleProjector::new(&view, size);
                let mut mesh = LitMesh::new(Chart::new(&view), shift);
                let mut dormant = Vec::new();
                for point in points {
                    if is_moving || projector.is_near(point.end) {
                        mesh.insert_point(&point);
                    } else {
                        dormant.push(point);
                    }
                }
                (mesh, dormant)
            }
        };
        let contains = |section: &Section| section.contains(view.vp);
        let is_inside = sections.iter().any(contains);
        MeshView {
            look: *look,
            mesh,
            mask: PixelMask::new(sections, &view, size),
            painter: MeshPainter::new(&view, size),
            dormant,
            samples_used: 0,
            is_elsewhere: sections.iter().map(|s| is_inside && !contains(s)).collect(),
        }
    }

    /// Returns whether the mesh can be used for another view.
    fn serves(&self, look: &FrameRequest, shift: u32) -> bool {
        if self.mesh.cells.shift() != shift || !self.mesh.chart.has_eye() {
            return false;
        }
        let moved = self.mesh.chart.eye.distance(look.view.eye());
        let near = || look.is_moving && moved <= NEAR_EYE * self.middle_distance();
        self.mesh.chart.is_of(&look.view) || look.view.kind.has_eye() && near()
    }

    /// Returns the middle one of the vertices' distances; 0 without any.
    fn middle_distance(&self) -> f64 {
        let depths = self.mesh.lights.iter().flatten().map(|light| light.depth);
        let mut depths: Vec<f32> = depths.filter(|depth| depth.is_finite()).collect();
        if depths.is_empty() {
            return 0.0;
        }
        let middle = depths.len() / 2;
        f64::from(*depths.select_nth_unstable_by(middle, f32::total_cmp).1)
    }

    /// Returns the mesh for the next view, and the points that it does not show.
    fn into_next(mut self) -> (LitMesh, Vec<MeshPoint>) {
        self.mesh.cells.begin_view();
        for point in &self.dormant {
            self.mesh.insert_point(point);
        }
        (self.mesh, Vec::new())
    }

    /// Returns the points that are known, newest first.
    fn into_points(self) -> Vec<MeshPoint> {
        let shown = self.mesh.cells.lights().map(|light| self.mesh.point(light));
        shown.chain(self.dormant.iter().copied()).take(MOST_POINTS).collect()
    }

    /// Adds a sample.
    fn insert(&mut self, landing: &SampleLanding) -> bool {
        let Some((direction, depth)) = self.mesh.chart.place(landing.end) else { return false };
        let depth = if landing.is_surface { depth } else { f64::INFINITY };
        let SampleLanding { radiance, weight, is_aligned, is_near, .. } = *landing;
        let sample = CellSample { direction, depth, radiance, weight, is_aligned, is_near };
        self.mesh.cells.insert(&sample);
        self.samples_used += 1;
        if let Some(pixel) = landing.pixel {
            self.mask.note_sample(pixel);
        }
        true
    }

    /// Returns points of the scene that the picture shows, spread over it, and their distances.
    fn visible_points(&self) -> Vec<(DVec3, f64)> {
        let FrameRequest { view, size, .. } = self.look;
        let most = (size.0 as usize * size.1 as usize / PIXELS_PER_DEPTH).max(1);
        let point = |light: VertexLight| {
            let end =
                if light.depth.is_finite() { self.mesh.point(light).end } else { return None };
            let RayEnd::Point(point) = end else { return None };
            let (x, y, distance) = view.project(point)?;
            let is_in = (0.0..1.0).contains(&x) && (0.0..1.0).contains(&y);
            is_in.then_some((light.direction, point, distance))
        };
        let mut points: Vec<_> = self.mesh.cells.own_lights().filter_map(point).collect();
        points.sort_unstable_by_key(|(direction, ..)| *direction);
        let step = points.len().div_ceil(most).max(1);
        points.iter().step_by(step).map(|&(_, point, distance)| (point, distance)).collect()
    }
}

impl LitMesh {
    /// Adds light of an earlier view, unless it was seen from too different a direction.
    fn insert_point(&mut self, point: &MeshPoint) {
        if self.cells.len() > 2 * MOST_POINTS {
            return;
        }
        let Some((direction, depth)) = self.chart.place(point.end) else { return };
        let has_turned = direction.unit().dot(point.seen) < MAX_DEGREES.to_radians().cos();
        if self.chart.has_eye() && has_turned {
            return;
        }
        let depth = if point.light.depth.is_finite() { depth as f32 } else { f32::INFINITY };
        let light = VertexLight { direction, depth, is_near: false, ..point.light };
        self.cells.insert_earlier(light);
    }

    /// Returns the point of a vertex's light.
    fn point(&self, light: VertexLight) -> MeshPoint {
        let end = self.chart.end(light.direction, f64::from(light.depth));
        MeshPoint { end, seen: light.direction.unit(), light }
    }
}

/// Returns the size of a view's cells.
fn shift(look: &FrameRequest) -> u32 {
    let (across, _) = look.view.extent();
    // The chart of a parallel view is a picture of width 1 at distance 1.
    let across = if look.view.kind.has_eye() { across } else { 1.0 };
    let pixels = f64::from(look.size.0) * f64::from(look.size.1);
    cell_shift(across / f64::from(look.size.0) * (pixels / MOST_CELLS).max(1.0).sqrt())
}

impl StoringRenderer for MeshRenderer {
    fn insert(&mut self, _age: Age, key: BeamKey, paths: u16, samples: &[Sample]) {
        let Some(shown) = &mut self.shown else { return };
        let number = usize::from(key.section);
        let Some(section) = self.sections.get(number) else { return };
        let FrameRequest { view, size, .. } = shown.look;
        let is_elsewhere = shown.is_elsewhere[number];
        let projector = SampleProjector::new(&view, size);
        projector.land(section, is_elsewhere, key, (paths, samples), |landing| {
            shown.insert(&landing);
        });
    }

    fn remove_earlier(&mut self, _key: BeamKey, _paths: u16, _samples: &[Sample]) -> bool {
        // Sums of samples do not know which ones they have.
        false
    }

    fn insert_unseen(&mut self, key: BeamKey) {
        let Some(shown) = &mut self.shown else { return };
        let FrameRequest { view, size, .. } = shown.look;
        shown.mask.note_unseen(&self.sections, &view, size, key);
    }
}

impl Renderer for MeshRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        let before = self.shown.take();
        self.shown = Some(MeshView::new(&self.sections, look, before));
        Ok(())
    }

    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        let Some(shown) = &mut self.shown else { return };
        let FrameRequest { view, size, is_moving } = shown.look;
        if is_moving {
            return;
        }
        let projector = SampleProjector::new(&view, size);
        for ray in rays {
            let line = (ray.origin, ray.direction);
            let Some(landing) = projector.live(line, ray.distance, paths, ray.radiance) else {
                continue;
            };
            if let Some(pixel) = landing.pixel
                && shown.insert(&landing)
            {
                shown.mask.note_live(pixel);
            }
        }
    }

    fn settle(&mut self) {
        if let Some(shown) = &mut self.shown
            && !shown.look.is_moving
        {
            let earlier = shown.mesh.cells.take_earlier();
            let earlier = earlier.into_iter().map(|light| shown.mesh.point(light));
            shown.dormant.extend(earlier);
            shown.dormant.truncate(MOST_POINTS);
        }
    }

    fn draw(
        &mut self,
        _phase: FramePhase,
        _interrupt: &Interrupt,
        stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        let shown = self.shown.as_mut()?;
        shown.mesh.update();
        stage_ended("triangulation");
        let mut frame = shown.painter.paint(&shown.mesh);
        shown.mask.apply(&mut frame, &shown.look.view, &self.sky);
        frame.blank_corners(&shown.look.view);
        frame.samples_used = shown.samples_used + shown.mesh.cells.earlier_count();
        stage_ended("triangles");
        Some(frame)
    }

    fn refines(&self) -> bool {
        false
    }

    fn prepare(&mut self, _phase: FramePhase) -> bool {
        // The triangles that the samples need so far, so that the frame need not wait for them.
        if let Some(shown) = &mut self.shown {
            shown.mesh.update();
        }
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

impl RayWishes for MeshRenderer {
    fn weigh(
        &mut self,
        _look: &FrameRequest,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        Ok(beams)
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
        let points = self.shown.as_ref().map_or_else(Vec::new, MeshView::visible_points);
        points.into_iter().map(|(_, distance)| distance as f32).collect()
    }

    fn uncovered(&mut self) -> Vec<u32> {
        match &self.shown {
            Some(shown) if !shown.look.is_moving => {
                shown.mask.uncovered(&shown.look.view, shown.look.size)
            }
            _ => Vec::new(),
        }
    }

    fn surface_beams(&mut self, search: Search) -> Option<BeamSearch> {
        let points = self.shown.as_ref()?.visible_points();
        let ends = points.into_iter().map(|(point, _)| VisibleEnd { point, normal: None });
        let (sections, ends) = (Arc::clone(&self.sections), ends.collect::<Vec<_>>());
        (!ends.is_empty()).then(|| -> BeamSearch {
            Box::new(move || beams_ending_on(&sections, &ends, SLACK, search))
        })
    }
}
