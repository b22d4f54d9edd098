//! How the eye moves, and how long a requested ray is under way: together they say which view will
//! be shown when the ray's sample arrives (Walter et al. 2002, §3.1).

use std::time::{Duration, Instant};

use glam::DVec3;
use holo_picture::View;
use holo_proto::bulk::ViewSamples;
use holo_section::{BeamKey, RayCoords, SampleKind};

/// Assumed time from the request of a ray to its sample, before any was measured.
const FIRST_DELAY: Duration = Duration::from_millis(100);

/// Longest time for which a motion is extrapolated. A person may turn meanwhile.
const LONGEST_DELAY: Duration = Duration::from_millis(400);

/// Time after which a ray whose sample has not arrived is given up.
const LOST: Duration = Duration::from_secs(2);

/// Weight of the last measured delay in the running mean.
const NEWEST: f64 = 0.25;

/// The velocity of an eye that moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EyeVelocity {
    /// Scene units per second.
    pub eye: DVec3,
    /// Change of the direction of view, a unit vector, per second.
    pub direction: DVec3,
}

impl EyeVelocity {
    /// Returns the velocity of an eye that came from one place and direction to another in
    /// `seconds`. It is 0 if no time has passed.
    #[must_use]
    pub fn between(before: [DVec3; 2], now: [DVec3; 2], seconds: f64) -> EyeVelocity {
        if !seconds.is_finite() || seconds <= 0.0 {
            return EyeVelocity::default();
        }
        let [eye, direction] = [0, 1].map(|part| (now[part] - before[part]) / seconds);
        EyeVelocity { eye, direction }
    }

    /// Returns the view that follows `view` after some time, if the motion continues. `None` if the
    /// eye does not move, or would have no direction.
    #[must_use]
    pub fn ahead(&self, view: &View, time: Duration) -> Option<View> {
        let seconds = time.as_secs_f64();
        let (eye, direction) = (self.eye * seconds, self.direction * seconds);
        let ahead = view.moved(view.vp + eye, view.vd + direction).ok()?;
        (*self != EyeVelocity::default()).then_some(ahead)
    }
}

/// Measures the time from the request of single rays to their samples.
#[derive(Debug, Default)]
pub struct RayDelay {
    /// The ray that is timed, and when it was requested.
    timed: Option<((BeamKey, RayCoords), Instant)>,
    mean: Option<Duration>,
}

impl RayDelay {
    /// Records that rays were requested; `first` is the first of them.
    pub fn request(&mut self, first: (BeamKey, RayCoords), now: Instant) {
        let is_lost = |(_, at): &(_, Instant)| now.saturating_duration_since(*at) > LOST;
        if self.timed.as_ref().is_none_or(is_lost) {
            self.timed = Some((first, now));
        }
    }

    /// Looks for the timed ray in a message.
    pub fn receive(&mut self, message: &ViewSamples, now: Instant) {
        let Some(((key, coords), at)) = self.timed else { return };
        let has_it = message.iter().any(|(run, samples)| {
            run.kind == SampleKind::SingleRay
                && run.key == key
                && samples.iter().any(|sample| sample.coords == coords)
        });
        if has_it {
            let last = now.saturating_duration_since(at).min(LONGEST_DELAY);
            let mean =
                self.mean.map_or(last, |mean| mean.mul_f64(1.0 - NEWEST) + last.mul_f64(NEWEST));
            (self.mean, self.timed) = (Some(mean), None);
        }
    }

    /// Returns the expected time from a request to its samples.
    pub fn expected(&self) -> Duration {
        self.mean.unwrap_or(FIRST_DELAY)
    }
}

#[cfg(test)]
mod tests {
    use holo_proto::bulk::SampleSource;
    use holo_section::{BeamId, NumberRun, Sample};

    use super::*;

    #[test]
    fn the_expected_view_is_where_the_motion_leads() {
        let size = (64, 48);
        let view = |x: f64, turn: f64| {
            let (eye, ahead) = (DVec3::new(x, 0.0, 1.6), DVec3::new(turn.sin(), turn.cos(), 0.0));
            View::new(eye, ahead, DVec3::Z, Some(60.0), None, size).unwrap()
        };
        let (before, now, after) = (view(0.0, 0.0), view(0.14, 0.1), view(0.28, 0.2));
        let velocity = EyeVelocity::between([before.vp, before.vd], [now.vp, now.vd], 0.1);
        let ahead = velocity.ahead(&now, Duration::from_millis(100)).unwrap();
        assert!(ahead.vp.distance(after.vp) < 1e-9);
        assert!(ahead.vd.angle_between(after.vd) < 0.01, "{} {}", ahead.vd, after.vd);
        assert_eq!(EyeVelocity::default().ahead(&now, Duration::from_secs(1)), None);
        let still = EyeVelocity::between([now.vp, now.vd], [after.vp, after.vd], 0.0);
        assert_eq!(still, EyeVelocity::default());
    }

    #[test]
    fn the_delay_is_that_of_the_ray_that_was_timed_and_a_lost_ray_is_given_up() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let ray = |beam| (BeamKey { section: 0, beam: BeamId(beam) }, RayCoords([1, 2, 3, 4]));
        let message = |beam, kind| {
            let (key, coords) = ray(beam);
            let run = NumberRun { key, kind, first: 0, count: 1, paths: 1 };
            let samples = vec![Sample::from_codes(coords, [0; 4], 0)];
            ViewSamples { view: 1, source: SampleSource::Traced, runs: vec![run], samples }
        };
        let mut delay = RayDelay::default();
        assert_eq!(delay.expected(), FIRST_DELAY);
        delay.request(ray(1), at(0));
        delay.request(ray(2), at(30));
        for other in [message(2, SampleKind::SingleRay), message(1, SampleKind::Uniform)] {
            delay.receive(&other, at(40));
            assert_eq!(delay.expected(), FIRST_DELAY);
        }
        delay.receive(&message(1, SampleKind::SingleRay), at(60));
        assert_eq!(delay.expected(), Duration::from_millis(60));
        delay.request(ray(3), at(100));
        delay.request(ray(4), at(100) + 2 * LOST);
        delay.receive(&message(4, SampleKind::SingleRay), at(120) + 2 * LOST);
        assert_eq!(delay.expected(), Duration::from_millis(50), "a quarter of the way to 20");
    }
}
