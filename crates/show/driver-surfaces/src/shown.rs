//! The view that the driver shows, with what it knows of it: its sums, its pixels on edges, and how
//! far its frames are refined.

use crate::light_store::luminance;
use glam::DVec3;
use holo_display::{Certainty, FramePhase, FrameRequest, PixelWeights, VisibleEnd};
use rayon::prelude::*;

use crate::draw::KnownLight;
use crate::edges::Looked;
use crate::{Gathered, LightStore, SurfaceView, VisiblePoint};

/// Pixels on edges that are examined in one go: about 10 ms on two cores.
const EDGE_PIXELS: usize = 1 << 12;

/// Distance in pixels between points whose beams are searched for. Beams are many pixels wide, and
/// the search must not delay the first picture.
const APART: usize = 4;

/// The view that is shown.
pub(crate) struct SurfacesView {
    pub(crate) look: FrameRequest,
    pub(crate) view: SurfaceView,
    /// The sums of the view's samples; `None` until a frame needs them.
    pub(crate) gathered: Option<Gathered>,
    pub(crate) edges: Edges,
    /// Known light. It is shown while the eye moves, and in the first frame at rest, so that these
    /// frames appear soon.
    pub(crate) known: Option<KnownLight>,
    /// Refinement of the last frame at rest; `None` before the first one.
    pub(crate) drawn: Option<Refined>,
    /// Number of samples that the last frame was drawn from; `None` before the first one.
    pub(crate) drawn_from: Option<u64>,
    pub(crate) covered: Vec<bool>,
    /// Weights of its pixels by the error of the last frame at rest; `None` before one.
    pub(crate) weights: Option<PixelWeights>,
}

/// Progress of looking into the view's pixels on edges.
pub(crate) enum Edges {
    /// Results for the first of these pixels. The view does not have them yet.
    Some(Vec<Looked>),
    /// All pixels are done, and the view has the results.
    All,
}

/// How a frame is refined.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Refined {
    /// True if the frame shows all samples instead of known light.
    is_gathered: bool,
    pub(crate) is_denoised: bool,
    has_edges: bool,
    /// True if the frame is as good as the samples allow, even if it takes longer.
    pub(crate) is_best: bool,
}

impl Refined {
    /// A frame of known light alone.
    pub(crate) const KNOWN: Refined =
        Refined { is_gathered: false, is_denoised: false, has_edges: false, is_best: false };
}

impl SurfacesView {
    /// Returns true if the next frame is drawn as well as possible, even if it takes longer.
    /// `samples` is the number of samples that it is drawn from.
    pub(crate) fn draws_best(&self, samples: u64, phase: FramePhase) -> bool {
        // Without new samples, nothing but a better frame can follow.
        let is_unchanged = matches!(self.edges, Edges::All) && self.drawn_from == Some(samples);
        phase == FramePhase::File || is_unchanged || self.look.is_small()
    }

    /// Returns how the best frame drawn now would be refined. If it is to appear soon, it is not
    /// denoised.
    pub(crate) fn refined(&self, has_denoiser: bool, is_soon: bool) -> Refined {
        let is_refined = !is_soon && !self.look.is_moving;
        let has_edges = matches!(self.edges, Edges::All);
        Refined {
            is_gathered: true,
            is_denoised: has_denoiser && is_refined,
            has_edges,
            // No frame is the best before its edges are known.
            is_best: has_edges,
        }
    }

    /// Looks into some pixels on edges of a view at rest, unless its first frame shows known light.
    /// Returns true if more are left.
    pub(crate) fn prepare_edges(&mut self, store: &LightStore) -> bool {
        let looks = !self.look.is_moving && self.known.is_none();
        looks && self.look_into_edges(store)
    }

    /// Looks into some pixels on edges. Returns true if more are left.
    pub(crate) fn look_into_edges(&mut self, store: &LightStore) -> bool {
        let Edges::Some(looked) = &mut self.edges else { return false };
        looked.extend(self.view.look_into_some(looked.len(), EDGE_PIXELS));
        if looked.len() < self.view.on_edges().len() {
            return true;
        }
        self.view.take_edges(std::mem::take(looked));
        self.edges = Edges::All;
        self.gathered.iter_mut().for_each(|known| known.look_into_edges(&self.view, store));
        false
    }

    /// Weighs the pixels of a frame at rest by their errors.
    ///
    /// An error counts as a person sees it who is used to the mean luminance of the picture: the
    /// eye's response grows with the logarithm of what is much brighter, and less steeply in the
    /// dark. Pixels of the sky, of lamps, and without any known light do not count.
    pub(crate) fn weigh(&mut self, pixels: &[[f32; 3]], certainty: &[Certainty]) {
        let of_row = |row: &[[f32; 3]]| row.iter().map(|&p| f64::from(luminance(p))).sum::<f64>();
        // Sums of rows are added in their order, so that the threads change no bit.
        let rows: Vec<f64> = pixels.par_chunks(self.view.size.0.max(1)).map(of_row).collect();
        let mean = rows.iter().sum::<f64>() / pixels.len().max(1) as f64;
        let error = |pixel: usize| {
            let Certainty { error, samples } = certainty[pixel];
            let counts = self.view.seen[pixel].is_surface() && self.covered[pixel];
            let bright = luminance(pixels[pixel]);
            let slope = 1.0 / (bright + mean as f32).max(f32::MIN_POSITIVE);
            counts.then(|| slope * error * (samples.max(1) as f32).sqrt())
        };
        self.weights = PixelWeights::new(self.look.size, error);
    }

    /// Returns the distance at which a surface is seen, scene units.
    pub(crate) fn distance(&self, seen: &VisiblePoint) -> f32 {
        if !seen.is_surface() {
            return self.view.way(seen).to_lamp;
        }
        self.view.length(seen)
    }

    pub(crate) fn depth(&self) -> Vec<f32> {
        self.view.seen.par_iter().map(|seen| self.distance(seen)).collect()
    }

    /// Returns visible surface points, in the scene's coordinates: of every [`APART`]th column and
    /// row.
    pub(crate) fn ends(&self, origin: DVec3) -> Vec<VisibleEnd> {
        let rows = self.view.seen.chunks(self.view.size.0.max(1)).step_by(APART);
        let seen = rows.flat_map(|row| row.iter().step_by(APART));
        let end = |seen: &VisiblePoint| VisibleEnd {
            point: origin + seen.point.as_dvec3(),
            normal: Some(seen.normal.as_dvec3()),
        };
        seen.filter(|seen| seen.is_surface()).map(end).collect()
    }
}
