//! The quadtree, or cells of its samples, from view to view: what it has is shown in the next view until that has samples of its own
//! (Larson & Simmons 1999, §3).
//!
//! What always holds:
//! - once the stored samples of a view have come, its pictures are of what was sent for this view and of nothing else, so a picture at
//!   rest does not depend on where one came from;
//! - while views follow each other in quick succession pictures are drafts, until a view's own samples have come or it rests;
//! - beyond 20° of rotation, or with a picture of another size, nothing is kept.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::canvas::AT_REST;
use holo_display::{Cells, CellsParams, Filling, Frame, Quadtree, QuadtreeParams, Resolution};
use holo_picture::View;
use holo_section::{BeamId, Sample, Section};

/// Samples kept for the next view at most: what two views of a large file cross. They are put into it again in some 25 ms.
const KEEP: usize = 500_000;

/// The quadtree for all views of a session, or the driver of cells. Clones share it.
#[derive(Clone, Default)]
pub struct Trees {
    shown: Arc<Mutex<Option<Shown>>>,
    cells: Option<Filling>,
}

struct Shown {
    /// What was sent for this view.
    own: Shape,
    /// That, and what there was before; until the view's own is all there.
    kept: Option<Shape>,
    size: (u32, u32),
    /// Until when the camera is taken to move; none: it rests.
    moves_until: Option<Instant>,
}

/// What samples are shown as.
enum Shape {
    Leaves(Box<Quadtree>),
    Cells(Box<Cells>),
}

impl Shape {
    fn tree(&self) -> &Quadtree {
        match self {
            Shape::Leaves(tree) => tree,
            Shape::Cells(cells) => cells.quadtree(),
        }
    }

    fn look(&mut self, view: View) -> bool {
        match self {
            Shape::Leaves(tree) => tree.look(view),
            Shape::Cells(cells) => cells.look(view),
        }
    }

    fn insert(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        match self {
            Shape::Leaves(tree) => tree.insert(section, beam, paths, samples),
            Shape::Cells(cells) => cells.insert(section, beam, paths, samples),
        }
    }

    fn insert_unseen(&mut self, section: u16, beam: BeamId) {
        match self {
            Shape::Leaves(tree) => tree.insert_unseen(section, beam),
            Shape::Cells(cells) => cells.insert_unseen(section, beam),
        }
    }

    fn draw(&self) -> Frame {
        match self {
            Shape::Leaves(tree) => tree.draw(),
            Shape::Cells(cells) => cells.draw(),
        }
    }

    /// The picture for somebody who moves.
    fn draft(&mut self) -> Frame {
        match self {
            Shape::Leaves(tree) => tree.draft().clone(),
            Shape::Cells(cells) => cells.draw(),
        }
    }
}

impl Trees {
    /// Cells in the place of leaves.
    pub fn of_cells(filling: Filling) -> Self {
        Self { cells: Some(filling), ..Self::default() }
    }

    /// Which driver it is.
    pub fn name(&self) -> &'static str {
        if self.cells.is_some() { "cells" } else { "quadtree" }
    }

    /// Takes another view, which is of half resolution while the camera moves.
    pub fn look(
        &self,
        sections: Arc<[Section]>,
        view: View,
        size: (u32, u32),
        sky: [f32; 3],
        resolution: Resolution,
    ) {
        let mut shown = self.lock();
        let before = shown.take().filter(|shown| shown.size == size);
        let kept = before
            .map(|shown| shown.kept.unwrap_or(shown.own))
            .and_then(|mut tree| tree.look(view).then_some(tree));
        let params = QuadtreeParams { sky, keep: KEEP, ..QuadtreeParams::default() };
        let own = match self.cells {
            Some(filling) => {
                let params = CellsParams { filling, tree: params };
                Shape::Cells(Box::new(Cells::new(sections, view, size, params)))
            }
            None => Shape::Leaves(Box::new(Quadtree::new(sections, view, size, params))),
        };
        let moves_until = (resolution == Resolution::Half).then(|| Instant::now() + AT_REST);
        *shown = Some(Shown { own, kept, size, moves_until });
    }

    pub fn insert(&self, section: u16, beam: BeamId, paths: u16, samples: &[Sample]) {
        self.of_all(|tree| tree.insert(section, beam, paths, samples));
    }

    pub fn insert_unseen(&self, section: u16, beam: BeamId) {
        self.of_all(|tree| tree.insert_unseen(section, beam));
    }

    /// The stored samples of the view, and those that tell most of what it sees, have come: nothing else is shown from now on.
    pub fn settle(&self) {
        if let Some(shown) = &mut *self.lock() {
            (shown.kept, shown.moves_until) = (None, None);
        }
    }

    /// What the sums of the view's own samples say; the default before the first view.
    pub fn own<T: Default>(&self, ask: impl FnOnce(&Quadtree) -> T) -> T {
        self.lock().as_ref().map_or_else(T::default, |shown| ask(shown.own.tree()))
    }

    /// The picture; `None` before the first view.
    pub fn draw(&self) -> Option<Frame> {
        self.lock().as_mut().map(|Shown { own, kept, moves_until, .. }| {
            let shape = kept.as_mut().unwrap_or(own);
            let moves = moves_until.is_some_and(|until| Instant::now() < until);
            if moves { shape.draft() } else { shape.draw() }
        })
    }

    fn of_all(&self, mut put: impl FnMut(&mut Shape)) {
        if let Some(shown) = &mut *self.lock() {
            put(&mut shown.own);
            shown.kept.iter_mut().for_each(put);
        }
    }

    /// A panic elsewhere leaves no picture half made that matters.
    fn lock(&self) -> MutexGuard<'_, Option<Shown>> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use holo_section::{SectionSpec, ViewClass};

    const SIZE: (u32, u32) = (40, 30);

    fn section() -> Section {
        Section::new(SectionSpec {
            origin: [-0.5; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            grid: [4; 3],
            class: ViewClass::Interior,
            obstructions: false,
        })
        .unwrap()
    }

    fn view(degrees: f64) -> View {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        View::new(DVec3::ZERO, DVec3::new(sine, cosine, 0.0), DVec3::Z, Some(60.0), None, SIZE)
            .unwrap()
    }

    /// Samples of every pixel's middle of a view, on a sphere.
    fn samples(view: &View) -> Vec<(BeamId, Sample)> {
        let section = section();
        let sample = |pixel: u32| {
            let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
            let (eye, direction) = view.ray(x, y);
            let hit = section.line(eye, direction).unwrap();
            let sample =
                Sample::encode(hit.coords, [0.5; 3], 5.0 - hit.entry_t, section.diagonal(), 0);
            (section.beam(hit.pair), sample)
        };
        (0..SIZE.0 * SIZE.1).map(sample).collect()
    }

    fn put(trees: &Trees, samples: &[(BeamId, Sample)]) {
        samples
            .iter()
            .for_each(|(beam, sample)| trees.insert(0, *beam, 1, std::slice::from_ref(sample)));
    }

    fn look(trees: &Trees, degrees: f64) -> Frame {
        trees.look(Arc::from([section()]), view(degrees), SIZE, [0.0; 3], Resolution::Full);
        trees.draw().unwrap()
    }

    #[test]
    fn the_last_view_s_samples_are_shown_until_the_next_one_s_have_come() {
        for trees in
            [Trees::default(), Trees::of_cells(Filling::Smooth), Trees::of_cells(Filling::Constant)]
        {
            are_shown_until_the_next_one_s_have_come(&trees);
        }
    }

    fn are_shown_until_the_next_one_s_have_come(trees: &Trees) {
        assert!(trees.draw().is_none());
        let pixels = u64::from(SIZE.0 * SIZE.1);
        assert_eq!(look(trees, 0.0).samples_used, 0);
        put(trees, &samples(&view(0.0)));
        let turned = look(trees, 10.0);
        // A sixth of the picture is new.
        assert!(
            turned.samples_used > pixels * 3 / 4 && turned.empty_pixels < pixels / 3,
            "{}",
            turned.empty_pixels
        );
        // On, before anything has come: they are still there.
        assert!(look(trees, 15.0).samples_used > pixels / 2);
        assert_eq!(look(trees, 40.0).samples_used, 0, "too far");
    }

    #[test]
    fn who_moves_sees_drafts_until_the_view_s_samples_have_come() {
        let trees = Trees::default();
        look(&trees, 0.0);
        let few: Vec<_> = samples(&view(0.0)).into_iter().step_by(7).collect();
        put(&trees, &few);
        let whole = trees.draw().unwrap();
        trees.look(Arc::from([section()]), view(0.0), SIZE, [0.0; 3], Resolution::Half);
        let since = Instant::now();
        let draft = trees.draw().unwrap();
        assert_eq!(draft.samples_used, whole.samples_used);
        let expected = {
            let mut shown = trees.lock();
            let kept = shown.as_mut().and_then(|shown| shown.kept.as_mut()).unwrap();
            (kept.draft().picture, kept.draw().picture)
        };
        assert!(expected.0 != expected.1);
        // A machine that is busy may take until the view rests.
        assert!(draft.picture == expected.0 || since.elapsed() >= AT_REST);
        put(&trees, &few);
        trees.settle();
        assert!(trees.draw().unwrap().picture == expected.1);
    }

    #[test]
    fn a_picture_at_rest_does_not_depend_on_where_one_came_from() {
        is_the_same_at_rest(Trees::default);
        is_the_same_at_rest(|| Trees::of_cells(Filling::Smooth));
        is_the_same_at_rest(|| Trees::of_cells(Filling::Constant));
    }

    fn is_the_same_at_rest(make: impl Fn() -> Trees) {
        let (walked, alone) = (make(), make());
        look(&walked, 0.0);
        put(&walked, &samples(&view(0.0)));
        let own = samples(&view(8.0));
        look(&walked, 8.0);
        look(&alone, 8.0);
        put(&walked, &own[..600]);
        put(&alone, &own[..600]);
        assert!(walked.draw().unwrap().samples_used > alone.draw().unwrap().samples_used);
        [&walked, &alone].into_iter().for_each(Trees::settle);
        assert_eq!(walked.draw().unwrap().picture, alone.draw().unwrap().picture);
        put(&walked, &own[600..]);
        put(&alone, &own[600..]);
        let (walked, alone) = (walked.draw().unwrap(), alone.draw().unwrap());
        assert!(walked.picture == alone.picture && walked.depth == alone.depth);
        assert!(alone.picture.pixels.iter().any(|pixel| pixel[0] > 0.4));
    }
}
