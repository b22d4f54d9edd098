//! The driver for whole sessions. It shows the samples of earlier views in the next view until that
//! view has samples of its own (Larson & Simmons 1999, §3).
//!
//! Invariants:
//! - Once the stored samples of a view have arrived, pictures use the samples of this view alone. A
//!   picture at rest does not depend on the earlier views.
//! - After a rotation of more than 20°, no sample of an earlier view is used.

use crate::live::Overlay;
use crate::log::Log;
use crate::{Filling, Quadtree, QuadtreeParams, ViewCells};
use holo_display::{
    Age, BeamSearch, Driver, DriverError, Frame, FramePhase, FrameRequest, Interrupt, LiveSample,
    PartsRenderer, PixelWeights, RayWishes, Renderer, Search, SkyView, StoringRenderer, ViewLight,
    WantedBeam, uncovered_pixels, viewpoint_radius,
};
use holo_picture::View;
use holo_section::{BeamKey, RayCoords, Sample, Section};
use std::collections::HashSet;
use std::sync::Arc;

/// Largest rotation of the view after which samples of earlier views are used. After a larger one,
/// glossy surfaces would look too different (Larson & Simmons 1999, §3).
const MAX_DEGREES: f64 = 20.0;

/// Returns the driver `quadtree`. `sky` is the radiance of rays that hit nothing.
pub fn quadtree_driver(sections: Arc<[Section]>, sky: impl Into<SkyView>) -> Driver {
    let sky = sky.into();
    let make = move || QuadtreeRenderer::new(Arc::clone(&sections), sky.clone(), None);
    Driver::new("quadtree", ViewLight::new(make))
}

/// Returns the driver `cells`, with cells that are filled in this way.
pub fn cells_driver(sections: Arc<[Section]>, sky: impl Into<SkyView>, filling: Filling) -> Driver {
    let sky = sky.into();
    let make = move || QuadtreeRenderer::new(Arc::clone(&sections), sky.clone(), Some(filling));
    Driver::new("cells", ViewLight::new(make))
}

/// The quadtree, or cells of its samples, from view to view.
struct QuadtreeRenderer {
    sections: Arc<[Section]>,
    sky: SkyView,
    /// The way that cells are filled; `None` for a quadtree.
    cells: Option<Filling>,
    /// Samples of the view, and those of earlier views until the view's own have arrived.
    log: Log,
    /// `None` before the first view.
    shown: Option<QuadtreeView>,
}

/// The current view.
struct QuadtreeView {
    look: FrameRequest,
    /// The samples of this view.
    own: Shape,
    /// The samples of this view and of earlier ones. `None` without samples of earlier views, or
    /// once the view has settled.
    both: Option<Shape>,
    /// `None` before the first live ray.
    overlay: Option<Overlay>,
}

/// The samples of one picture, in the form used for drawing.
enum Shape {
    Leaves(Box<Quadtree>),
    Cells(Box<ViewCells>),
}

impl Shape {
    fn tree(&self) -> &Quadtree {
        match self {
            Self::Leaves(tree) => tree,
            Self::Cells(cells) => cells.quadtree(),
        }
    }

    fn insert(&mut self, key: BeamKey, paths: u16, samples: &[Sample]) {
        match self {
            Self::Leaves(tree) => tree.insert(key, paths, samples),
            Self::Cells(cells) => cells.insert(key, paths, samples),
        }
    }

    fn insert_unseen(&mut self, key: BeamKey) {
        match self {
            Self::Leaves(tree) => tree.insert_unseen(key),
            Self::Cells(cells) => cells.insert_unseen(key),
        }
    }

    fn draw(&self) -> Frame {
        match self {
            Self::Leaves(tree) => tree.draw(),
            Self::Cells(cells) => cells.draw(),
        }
    }
}

impl QuadtreeRenderer {
    fn new(sections: Arc<[Section]>, sky: SkyView, cells: Option<Filling>) -> Self {
        Self { sections, sky, cells, log: Log::default(), shown: None }
    }

    /// Returns an empty shape for a view.
    fn shape(&self, look: &FrameRequest) -> Shape {
        let (sections, size) = (Arc::clone(&self.sections), look.size);
        let params = QuadtreeParams { sky: self.sky.clone(), ..QuadtreeParams::default() };
        match self.cells {
            None => Shape::Leaves(Box::new(Quadtree::new(sections, look.view, size, params))),
            Some(filling) => {
                Shape::Cells(Box::new(ViewCells::new(sections, look.view, size, filling, params)))
            }
        }
    }

    /// Returns a shape for a view with the samples of earlier views. `None` if there are none. If
    /// the view has turned too far, forgets them and returns `None`.
    fn of_earlier_views(&mut self, look: &FrameRequest) -> Option<Shape> {
        let before = self.shown.take()?;
        if look.view.vd.dot(before.look.view.vd) < MAX_DEGREES.to_radians().cos() {
            self.log.clear();
            return None;
        }
        let unseen: HashSet<_> =
            before.both.as_ref().unwrap_or(&before.own).tree().unseen().clone();
        if self.log.is_empty() && unseen.is_empty() {
            return None;
        }
        let mut shape = self.shape(look);
        unseen.into_iter().for_each(|key| shape.insert_unseen(key));
        self.log.replay(|key, paths, samples| shape.insert(key, paths, samples));
        Some(shape)
    }
}

impl StoringRenderer for QuadtreeRenderer {
    fn insert(&mut self, _age: Age, key: BeamKey, paths: u16, samples: &[Sample]) {
        let Some(shown) = &mut self.shown else { return };
        self.log.add(key, paths, samples);
        for shape in shown.both.iter_mut().chain([&mut shown.own]) {
            shape.insert(key, paths, samples);
        }
    }

    fn remove_earlier(&mut self, _key: BeamKey, _paths: u16, _samples: &[Sample]) -> bool {
        // Sums of samples do not know which ones they have.
        false
    }

    fn insert_unseen(&mut self, key: BeamKey) {
        let Some(shown) = &mut self.shown else { return };
        for shape in shown.both.iter_mut().chain([&mut shown.own]) {
            shape.insert_unseen(key);
        }
    }
}

impl Renderer for QuadtreeRenderer {
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError> {
        let both = self.of_earlier_views(look);
        self.log.begin_view();
        self.shown = Some(QuadtreeView { look: *look, own: self.shape(look), both, overlay: None });
        Ok(())
    }

    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]) {
        let Some(shown) = &mut self.shown else { return };
        if shown.look.is_moving {
            return;
        }
        let FrameRequest { view, size, .. } = shown.look;
        let own = &shown.own;
        let overlay = shown.overlay.get_or_insert_with(|| {
            let pixels = uncovered_pixels(&own.tree().covered, &view, size);
            Overlay::new(pixels, view, size)
        });
        overlay.insert(paths, rays);
    }

    fn settle(&mut self) {
        self.log.forget_earlier();
        if let Some(shown) = &mut self.shown {
            shown.both = None;
        }
    }

    fn draw(
        &mut self,
        _phase: FramePhase,
        _interrupt: &Interrupt,
        _stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame> {
        let shown = self.shown.as_ref()?;
        let mut frame = shown.both.as_ref().unwrap_or(&shown.own).draw();
        if let Some(overlay) = &shown.overlay {
            overlay.paint(&mut frame);
        }
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

impl RayWishes for QuadtreeRenderer {
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
        self.shown.as_ref().map_or_else(Vec::new, |shown| shown.own.tree().depth())
    }

    fn uncovered(&mut self) -> Vec<u32> {
        match &self.shown {
            Some(shown) if !shown.look.is_moving => {
                let FrameRequest { view, size, .. } = shown.look;
                uncovered_pixels(&shown.own.tree().covered, &view, size)
            }
            _ => Vec::new(),
        }
    }

    fn surface_beams(&mut self, search: Search) -> Option<BeamSearch> {
        self.shown.as_ref()?.own.tree().surface_beams(search)
    }
}
