//! Determines whether the eye moves or rests, from the times between views.

use std::time::{Duration, Instant};

use holo_display::Resolution;

/// A view that lasts longer is at rest. Views that follow each other faster mean that the eye
/// moves, and frames at full resolution could not follow.
pub const AT_REST: Duration = Duration::from_millis(150);

/// When the last view was requested.
#[derive(Default)]
pub struct Pace(Option<Instant>);

impl Pace {
    /// Returns the resolution for a view that is requested `now`.
    pub fn next(&mut self, now: Instant) -> Resolution {
        let last = self.0.replace(now);
        let is_moving = last.is_some_and(|last| now.saturating_duration_since(last) < AT_REST);
        if is_moving { Resolution::Half } else { Resolution::Full }
    }

    /// Returns the resolution for the same view when nothing has moved for [`AT_REST`].
    pub fn rest(&mut self, now: Instant) -> Resolution {
        self.0 = Some(now);
        Resolution::Full
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_in_quick_succession_are_half_and_one_after_a_rest_is_full() {
        let (mut pace, start) = (Pace::default(), Instant::now());
        assert_eq!(pace.next(start), Resolution::Full);
        let soon = start + AT_REST / 2;
        assert_eq!(pace.next(soon), Resolution::Half);
        assert_eq!(pace.next(soon + AT_REST / 2), Resolution::Half);
        assert_eq!(pace.next(soon + 2 * AT_REST), Resolution::Full);
    }

    #[test]
    fn a_view_that_rests_is_full_and_the_next_one_moves_again() {
        let (mut pace, start) = (Pace::default(), Instant::now());
        pace.next(start);
        assert_eq!(pace.rest(start), Resolution::Full);
        assert_eq!(pace.next(start), Resolution::Half);
    }
}
