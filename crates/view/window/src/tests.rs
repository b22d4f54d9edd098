//! Helpers of the window's tests.

use std::{sync::Arc, time::Instant};

use holo_display::Frame;
use holo_picture::{Look, Picture, View, ViewSpec};
use holo_stage::{PublishedFrame, Viewer};

use super::seen::DisplayedFrame;

/// A view along y from the origin.
pub fn view(size: (u32, u32)) -> View {
    let mut spec = ViewSpec::default();
    spec.apply_line("-vp 0 0 0 -vd 0 1 0 -vu 0 0 1 -vh 60").unwrap();
    spec.resolve(size).unwrap().0
}

/// A frame at rest with uniform radiance at distance 2.
pub fn shown(size: (u32, u32), radiance: [f32; 3], number: u64) -> PublishedFrame {
    let pixels = (size.0 * size.1) as usize;
    let mut frame = Frame::black(size);
    frame.picture = Picture::from_pixels(size.0, size.1, vec![radiance; pixels]).unwrap();
    frame.depth = vec![2.0; pixels];
    let (view, frame) = (view(size), Arc::new(frame));
    let (options, input) = ("-vtv".to_owned(), (1, 1));
    let (is_at_rest, took, done) = (true, [0.0; 2], Instant::now());
    PublishedFrame { number, input, view, options, frame, is_at_rest, took, done }
}

/// The same frame in display colours.
pub fn seen(size: (u32, u32), radiance: [f32; 3], look: &Look) -> DisplayedFrame {
    let shown = shown(size, radiance, 1);
    let image = Viewer::default().see(&shown.frame.picture, look, Instant::now());
    DisplayedFrame { shown: Arc::new(shown), image }
}
