//! The phases of a view: what each of its frames is for.

/// What a frame is for. It determines how long a renderer may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FramePhase {
    /// The eye moves, and another view follows soon. A renderer may trade accuracy for time.
    Moving,
    /// The first frame of a view at rest. It is to appear soon, for example by light that earlier
    /// frames have found.
    First,
    /// A further frame of a view at rest. A new request may interrupt it.
    Rest,
    /// A picture for a file. It is as good as the samples allow, and nothing interrupts it.
    File,
}

/// Follows a view through its phases.
#[derive(Clone, Copy, Debug)]
pub struct ViewPhases {
    is_moving: bool,
    /// True if the eye has just stopped.
    has_stopped: bool,
    /// True if all stored samples of the view have arrived.
    is_settled: bool,
    is_drawn: bool,
}

impl ViewPhases {
    /// Returns the state of a view that follows another one, if there was one.
    #[must_use]
    pub fn after(before: Option<&ViewPhases>, is_moving: bool) -> ViewPhases {
        let has_stopped = !is_moving && before.is_some_and(|before| before.is_moving);
        ViewPhases { is_moving, has_stopped, is_settled: false, is_drawn: false }
    }

    /// Returns the phase of the next frame that is displayed. `is_late` if nobody waits for a first
    /// frame any more.
    #[must_use]
    pub fn next(&self, is_late: bool) -> FramePhase {
        match self {
            _ if self.is_moving => FramePhase::Moving,
            _ if is_late => FramePhase::Rest,
            // If nothing more is to come, the first frame is the refined one. A person who stops
            // is shown the light of the motion even then, so that the stop has no delay.
            _ if !self.is_drawn && (self.has_stopped || !self.is_settled) => FramePhase::First,
            _ => FramePhase::Rest,
        }
    }

    /// Records that all stored samples of the view have arrived.
    pub fn settle(&mut self) {
        self.is_settled = true;
    }

    /// Records that a frame was drawn.
    pub fn note_frame(&mut self) {
        self.is_drawn = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_at_rest_has_one_first_frame_unless_everything_is_there() {
        let mut phases = ViewPhases::after(None, false);
        assert_eq!(phases.next(false), FramePhase::First);
        phases.note_frame();
        assert_eq!(phases.next(false), FramePhase::Rest);
        let mut phases = ViewPhases::after(Some(&phases), false);
        phases.settle();
        assert_eq!(phases.next(false), FramePhase::Rest);
    }

    #[test]
    fn the_first_frame_after_a_motion_is_a_first_one_in_any_case() {
        let mut moving = ViewPhases::after(None, true);
        moving.settle();
        moving.note_frame();
        assert_eq!(moving.next(false), FramePhase::Moving);
        let mut stopped = ViewPhases::after(Some(&moving), false);
        stopped.settle();
        assert_eq!(
            (stopped.next(false), stopped.next(true)),
            (FramePhase::First, FramePhase::Rest)
        );
        stopped.note_frame();
        assert_eq!(stopped.next(false), FramePhase::Rest);
    }
}
