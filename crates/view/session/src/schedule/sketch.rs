//! Decides whether a picture at rest is a sketch: a picture with fewer pixels. They suffice for few
//! samples, and after a jump of the eye they appear soon.

use std::time::Duration;

use holo_picture::ViewSpec;

/// With fewer samples than this for each pixel of the full picture, a sketch suffices.
const FEW: f64 = 0.15;

/// Time at rest during which the first picture is a sketch. Later, nobody waits for it any more.
const FIRST: Duration = Duration::from_millis(500);

/// Time at rest after which a picture has all its pixels, however few samples there are.
const LONGEST: Duration = Duration::from_secs(2);

/// Knows how the eye came to its view.
#[derive(Default)]
pub struct Sketching {
    /// The last view that was requested, and the number of jumps of the eye until then.
    last: Option<(ViewSpec, u64)>,
    /// True if the eye has moved since its last jump. A picture at rest then shows light that was
    /// found on the way, so it needs no sketch.
    has_moved: bool,
    /// True once a frame of the view was drawn.
    is_drawn: bool,
}

impl Sketching {
    /// Records that a view is requested after so many jumps of the eye.
    pub fn note(&mut self, spec: &ViewSpec, jumps: u64) {
        let before = self.last.replace((*spec, jumps));
        self.is_drawn &= before == Some((*spec, jumps));
        let before = before.filter(|(_, before)| *before == jumps);
        self.has_moved = before.is_some_and(|(before, _)| self.has_moved || before != *spec);
    }

    /// Records that a frame of the view was drawn.
    pub fn note_frame(&mut self) {
        self.is_drawn = true;
    }

    /// Records that the view begins anew.
    pub fn restart(&mut self) {
        self.is_drawn = false;
    }

    /// Returns whether there are too few samples for all pixels.
    pub fn are_few(samples_per_pixel: f64) -> bool {
        samples_per_pixel < FEW
    }

    /// Returns whether the picture of a view that has rested for some time is to be a sketch.
    pub fn suits(&self, samples_per_pixel: f64, rested: Duration) -> bool {
        let is_first = !self.is_drawn && rested < FIRST;
        let suffices = is_first || Sketching::are_few(samples_per_pixel);
        !self.has_moved && suffices && !Sketching::is_over(rested)
    }

    /// Returns whether a view has rested for too long for a sketch.
    pub fn is_over(rested: Duration) -> bool {
        rested >= LONGEST
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const SOON: Duration = Duration::from_millis(100);

    #[test]
    fn a_new_view_with_few_samples_is_a_sketch_for_a_limited_time() {
        let mut sketching = Sketching::default();
        // The same view may be requested more than once.
        sketching.note(&view(0.0), 0);
        sketching.note(&view(0.0), 0);
        sketching.note_frame();
        assert!(sketching.suits(0.01, SOON));
        assert!(!sketching.suits(1.0, SOON));
        assert!(!sketching.suits(0.01, LONGEST));
    }

    #[test]
    fn after_a_walk_every_picture_has_all_pixels_until_the_eye_jumps() {
        let mut sketching = Sketching::default();
        sketching.note(&view(0.0), 0);
        sketching.note(&view(0.1), 0);
        sketching.note(&view(0.1), 0);
        assert!(!sketching.suits(0.01, SOON));
        sketching.note(&view(5.0), 1);
        sketching.note(&view(5.0), 1);
        assert!(sketching.suits(0.01, SOON));
    }

    #[test]
    fn the_first_picture_after_a_jump_is_a_sketch_however_many_samples_there_are() {
        let mut sketching = Sketching::default();
        for jumps in 0..3 {
            sketching.note(&view(jumps as f64), jumps);
            assert!(sketching.suits(1.0, SOON), "{jumps}");
            assert!(!sketching.suits(1.0, FIRST), "{jumps}");
            sketching.note_frame();
            sketching.note(&view(jumps as f64), jumps);
            assert!(!sketching.suits(1.0, SOON), "{jumps}");
        }
        sketching.note(&view(2.1), 2);
        assert!(!sketching.suits(1.0, SOON), "the eye walks");
    }

    /// Returns a view from this far along the x axis.
    fn view(x: f64) -> ViewSpec {
        ViewSpec { vp: Some(DVec3::X * x), ..ViewSpec::default() }
    }
}
