//! Draws pictures in parts, from the samples of the session, without changing the view that is
//! shown.
//!
//! A part is drawn with a margin, because the filter looks at the pixels around.

use crate::draw::{Density, WIDEST_DENOISED};
use crate::known::LightMemory;
use crate::{Drawn, Gathered, LightStore, Materials, SurfaceView};
use holo_denoise::Denoiser;
use holo_display::{FrameRequest, Interrupt, PartsPlan, covered};
use holo_picture::Picture;
use holo_raycast::Raycaster;
use holo_section::Section;
use std::ops::Range;
use std::sync::Arc;

/// Width of the margin, in squares of pixels. The filter's sums reach further, but its weights
/// there are small.
const MARGIN: u32 = 32;

/// The widest squares. Those of all parts lie on one grid.
const WIDEST: u32 = WIDEST_DENOISED as u32;

/// Least width of the margin with a denoiser, pixels: some of the widest squares.
const LEAST_MARGIN: u32 = 6 * WIDEST;

/// Pixels on edges that are examined between two looks at the interrupt.
const EDGE_PIXELS: usize = 1 << 12;

/// What parts are drawn from.
pub(crate) struct PartsSource<'a> {
    pub sections: &'a [Section],
    pub raycaster: &'a Arc<Raycaster>,
    pub materials: &'a Arc<Materials>,
    pub store: &'a LightStore,
    /// Samples for pixels that no section covers.
    pub live: &'a LightStore,
    pub denoiser: Option<&'a mut Denoiser>,
    pub interrupt: &'a Interrupt,
}

impl PartsSource<'_> {
    fn view(&self, eye: &holo_picture::View, size: (u32, u32)) -> SurfaceView {
        SurfaceView::new(Arc::clone(self.raycaster), Arc::clone(self.materials), eye, size)
    }

    pub fn plan(&self, look: &FrameRequest) -> PartsPlan {
        let size = PartsPlan::preview_size(look.size);
        let view = self.view(&look.view, size);
        let gathered = Gathered::new(&view, self.store);
        let pixels = |(width, height): (u32, u32)| width as f32 * height as f32;
        let density = gathered.density(&view).spread(pixels(look.size) / pixels(size));
        let mut preview = Picture::new(size.0, size.1);
        preview.pixels = gathered.draw(&view, self.store, None).pixels;
        preview.view = Some(look.view);
        PartsPlan { look: *look, step: density.step(true, self.denoiser.is_some()), preview }
    }

    pub fn part(
        mut self,
        plan: &PartsPlan,
        columns: Range<u32>,
        rows: Range<u32>,
    ) -> Option<Picture> {
        let FrameRequest { view: eye, size, .. } = plan.look;
        let least = if self.denoiser.is_some() { LEAST_MARGIN } else { 0 };
        let margin = (MARGIN * plan.step as u32).max(least);
        let widened = |range: &Range<u32>, whole: u32| {
            let start = range.start.saturating_sub(margin) / WIDEST * WIDEST;
            start..range.end.saturating_add(margin).min(whole)
        };
        let (across, down) = (widened(&columns, size.0), widened(&rows, size.1));
        let drawn_size = (across.end - across.start, down.end - down.start);
        let eye = eye.part(size, across.clone(), down.clone());
        let mut view = self.view(&eye, drawn_size);
        let mut looked = Vec::new();
        while looked.len() < view.on_edges().len() {
            self.interrupt.check()?;
            looked.extend(view.look_into_some(looked.len(), EDGE_PIXELS));
        }
        view.take_edges(looked);
        self.interrupt.check()?;
        let gathered = Gathered::new(&view, self.store);
        let mut drawn = self.drawn(&gathered, &view, plan.step)?;
        if self.live.samples() > 0 {
            let covered = covered(self.sections, &eye, drawn_size);
            if covered.contains(&false) {
                let with_live = gathered.with(&view, self.live);
                let with_live = self.drawn(&with_live, &view, plan.step)?;
                let of_both = drawn.pixels.iter_mut().zip(with_live.pixels).zip(covered);
                for ((pixel, with_live), _) in of_both.filter(|(_, is_covered)| !is_covered) {
                    *pixel = with_live;
                }
            }
        }
        let mut frame = holo_display::Frame::black(drawn_size);
        frame.picture.pixels = drawn.pixels;
        frame.blank_corners(&eye);
        let mut part = Picture::new(columns.end - columns.start, rows.end - rows.start);
        let from = (columns.start - across.start) as usize;
        let inner = frame.picture.pixels.chunks(drawn_size.0.max(1) as usize);
        let inner = inner.skip((rows.start - down.start) as usize);
        let width = part.width.max(1) as usize;
        for (to, row) in part.pixels.chunks_mut(width).zip(inner) {
            to.copy_from_slice(&row[from..from + width]);
        }
        Some(part)
    }

    fn drawn(&mut self, gathered: &Gathered, view: &SurfaceView, step: usize) -> Option<Drawn> {
        let (denoiser, known) = (self.denoiser.as_deref_mut(), &mut LightMemory::default());
        gathered.draw_and_learn((view, self.store), step, denoiser, known, self.interrupt)
    }
}

impl Density {
    /// Returns the density if the samples were spread over `more` times as many pixels.
    fn spread(self, more: f32) -> Density {
        let samples = self.samples / more.max(1.0);
        Density { samples, covered: self.covered.min(1.0 - (-samples).exp()) }
    }
}
