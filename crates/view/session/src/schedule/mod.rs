//! The schedule of frames: how many pixels the next frame has, and when it is due.
//!
//! People and scripts have the same schedule. They differ only in where their views come from.
//!
//! | phase | pixels | due |
//! | --- | --- | --- |
//! | moving | as many as the time allows ([`detail`]) | at once |
//! | first, at rest | a quarter, soon after a jump and if pixels are many ([`sketch`]), else all | at once |
//! | second, at rest | all, if samples are not few | at once |
//! | at rest | all; a quarter for at most two seconds while samples are few | when samples have arrived, in a part of the time |
//! | for a file | all | when a person or a script wants it |
//!
//! [`FramePhase`](holo_display::FramePhase) names the phases for drivers.
//!
//! Invariant: a schedule is a function of the requests, times and counts that it is given. It reads
//! no clock.

mod detail;
mod sketch;

use std::time::{Duration, Instant};

use holo_display::FrameRequest;
use holo_picture::ViewSpec;

use detail::Detail;
pub use detail::scaled;
use sketch::Sketching;

/// Least time between two frames of a view at rest.
const REDRAW: Duration = Duration::from_millis(100);

/// Longest time between two frames of a view at rest while samples arrive.
const LATEST_REDRAW: Duration = Duration::from_secs(2);

/// Pause between frames at rest, as a share of the time since the eye moved. The longer the eye
/// rests, the less new samples change the picture.
const REDRAW_SHARE: f64 = 0.1;

/// Drawing frames at rest takes at most 1/`DRAWING_PART` of the time; the rest is for tracing.
const DRAWING_PART: u32 = 4;

/// A picture at rest is drawn again at once when this many times as many samples have arrived.
const MANY_MORE: u64 = 2;

/// Decides how many pixels the next frame has, and when it is due.
pub struct FrameSchedule {
    sketching: Sketching,
    detail: Detail,
    /// The last view that was requested, with the number of jumps until then.
    requested: Option<(ViewSpec, u64)>,
    /// When another view was requested.
    moved: Instant,
    /// When the last frame was ready.
    frame: Instant,
    /// Time that it took.
    drawn_in: Duration,
    /// Samples that had arrived when it was drawn.
    samples: u64,
    /// True if it was a sketch.
    is_sketch: bool,
    /// True if samples were too few for more pixels.
    has_few: bool,
    /// True once the view was to have all its pixels. It is then no sketch again.
    is_whole: bool,
}

/// The size of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameSize {
    /// Columns and rows.
    pub size: (u32, u32),
    /// Those of a picture with all pixels.
    pub full: (u32, u32),
    /// True if the eye moves.
    pub is_moving: bool,
    /// True if the frame is a sketch: it has fewer pixels, because samples are few.
    pub is_sketch: bool,
}

impl FrameSize {
    /// Returns whether a frame may have fewer pixels than the whole picture.
    #[must_use]
    pub fn has_few(&self) -> bool {
        self.is_moving || self.is_sketch
    }
}

impl FrameSchedule {
    /// Returns the schedule of a session in which nothing was requested yet.
    #[must_use]
    pub fn new(now: Instant) -> FrameSchedule {
        FrameSchedule {
            sketching: Sketching::default(),
            detail: Detail::default(),
            requested: None,
            moved: now,
            frame: now,
            drawn_in: Duration::ZERO,
            samples: 0,
            is_sketch: false,
            has_few: false,
            is_whole: false,
        }
    }

    /// Records that a view is requested, after so many jumps of the eye. The same view may be
    /// requested more than once.
    pub fn request(&mut self, spec: &ViewSpec, jumps: u64, now: Instant) {
        if self.requested.replace((*spec, jumps)) != Some((*spec, jumps)) {
            (self.moved, self.is_whole) = (now, false);
        }
        self.sketching.note(spec, jumps);
    }

    /// Records that the view begins anew, for example with another driver.
    pub fn restart(&mut self) {
        self.requested = None;
        self.sketching.restart();
    }

    /// Returns the size of the next frame, for a picture of `full` pixels. A driver that
    /// `keeps_pixels` draws all of them.
    pub fn size(
        &mut self,
        full: (u32, u32),
        is_moving: bool,
        keeps_pixels: bool,
        samples_per_pixel: f64,
        now: Instant,
    ) -> FrameSize {
        let rested = now.saturating_duration_since(self.moved);
        let is_small = u64::from(full.0) * u64::from(full.1) <= FrameRequest::SMALL;
        let is_sketch = !is_moving
            && !keeps_pixels
            && !is_small
            && !self.is_whole
            && self.sketching.suits(samples_per_pixel, rested);
        self.is_whole |= !is_moving && !is_sketch;
        self.has_few = Sketching::are_few(samples_per_pixel);
        let size = match is_moving {
            _ if keeps_pixels => full,
            true => self.detail.size(full),
            false if is_sketch => (full.0.div_ceil(2), full.1.div_ceil(2)),
            false => full,
        };
        FrameSize { size, full, is_moving, is_sketch }
    }

    /// Returns whether a view at rest is to be drawn again. `arrived` samples have arrived for it,
    /// and the driver `refines` its last frame without any more.
    #[must_use]
    pub fn is_due(&self, arrived: u64, refines: bool, now: Instant) -> bool {
        let is_new = arrived != self.samples || refines;
        let is_much = arrived / MANY_MORE > self.samples && now >= self.frame + self.drawn_in;
        let rested = now.saturating_duration_since(self.moved);
        let is_overdue = self.is_sketch && (!self.has_few || Sketching::is_over(rested));
        is_overdue || (is_new && now >= self.next_redraw()) || is_much
    }

    fn next_redraw(&self) -> Instant {
        let looked = self.frame.saturating_duration_since(self.moved);
        let pause = looked.mul_f64(REDRAW_SHARE).clamp(REDRAW, LATEST_REDRAW);
        self.frame + pause.max(self.drawn_in * DRAWING_PART)
    }

    /// Records that a frame was drawn between these times, when so many samples had arrived. It
    /// `is_lit` if it shows any.
    pub fn note_frame(
        &mut self,
        size: FrameSize,
        [begin, end]: [Instant; 2],
        arrived: u64,
        is_lit: bool,
    ) {
        (self.frame, self.drawn_in) = (end, end.saturating_duration_since(begin));
        (self.samples, self.is_sketch) = (arrived, size.is_sketch);
        self.sketching.note_frame();
        if size.is_moving && is_lit {
            self.detail.note(size.size, size.full, self.drawn_in.as_secs_f64());
        }
    }

    /// Returns the share of each side that frames have while the eye moves.
    #[must_use]
    pub fn moving_share(&self) -> f64 {
        self.detail.share()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const FULL: (u32, u32) = (1280, 720);

    /// Returns a view from this far along the x axis.
    fn view(x: f64) -> ViewSpec {
        ViewSpec { vp: Some(DVec3::X * x), ..ViewSpec::default() }
    }

    #[test]
    fn a_sketch_is_replaced_at_once_if_there_are_samples_for_all_pixels() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        for (samples_per_pixel, due) in [(1.0, true), (0.01, false)] {
            let mut schedule = FrameSchedule::new(start);
            schedule.request(&view(0.0), 1, start);
            let size = schedule.size(FULL, false, false, samples_per_pixel, start);
            assert!(size.is_sketch);
            schedule.note_frame(size, [start, at(100)], 1000, true);
            assert_eq!(schedule.is_due(1000, false, at(101)), due);
            schedule.request(&view(0.0), 1, at(101));
            let next = schedule.size(FULL, false, false, samples_per_pixel, at(101));
            assert_eq!(next.is_sketch, !due);
        }
    }

    #[test]
    fn few_samples_make_a_sketch_and_a_moving_eye_has_fewer_pixels() {
        let start = Instant::now();
        let mut schedule = FrameSchedule::new(start);
        schedule.request(&view(0.0), 0, start);
        let size = |schedule: &mut FrameSchedule, is_moving, keeps_pixels, samples, seconds| {
            let now = start + Duration::from_secs_f64(seconds);
            schedule.size(FULL, is_moving, keeps_pixels, samples, now).size
        };
        assert_eq!(size(&mut schedule, false, false, 0.01, 0.1), (640, 360));
        let sketch = schedule.size(FULL, false, false, 0.01, start);
        schedule.note_frame(sketch, [start, start], 1000, true);
        assert_eq!(size(&mut schedule, false, false, 1.0, 0.1), FULL);
        assert_eq!(size(&mut schedule, false, false, 0.01, 0.1), FULL, "no sketch again");
        schedule.request(&view(0.0), 1, start);
        assert_eq!(size(&mut schedule, false, false, 0.01, 0.1), (640, 360));
        assert_eq!(size(&mut schedule, false, false, 0.01, 3.0), FULL);
        assert_eq!(size(&mut schedule, true, false, 1.0, 0.1), (640, 360));
        schedule.request(&view(0.0), 2, start);
        let small = schedule.size((320, 240), false, false, 0.01, start);
        assert_eq!(small.size, (320, 240), "all pixels of a small picture are soon drawn");
        for is_moving in [false, true] {
            assert_eq!(size(&mut schedule, is_moving, true, 0.01, 0.1), FULL, "pixels are kept");
        }
    }

    #[test]
    fn frames_at_rest_follow_each_other_more_slowly_the_longer_the_eye_rests() {
        let start = Instant::now();
        let at = |seconds: f64| start + Duration::from_secs_f64(seconds);
        let mut schedule = FrameSchedule::new(start);
        schedule.request(&view(0.0), 0, start);
        let size = schedule.size(FULL, false, false, 1.0, at(1.0));
        let mut draw = |seconds: f64| {
            schedule.note_frame(size, [at(seconds - 0.01), at(seconds)], 1000, true);
            assert!(!schedule.is_due(1000, false, at(seconds + 60.0)), "nothing is new");
            assert!(schedule.is_due(1000, true, at(seconds + 60.0)), "the driver refines");
            assert!(schedule.is_due(3000, false, at(seconds + 0.02)), "there is much more");
            let ms = (0..10_000)
                .find(|&ms| schedule.is_due(1001, false, at(seconds + f64::from(ms) / 1000.0)));
            ms.unwrap()
        };
        assert!((100..=101).contains(&draw(0.1)));
        assert!((500..=501).contains(&draw(5.0)));
        assert!((2000..=2001).contains(&draw(60.0)));
    }
}
