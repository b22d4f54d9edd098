//! Turns a frame's radiance into the colours of a screen. All front ends do it here.

use std::{num::NonZero, sync::OnceLock, thread, time::Instant};

use holo_picture::{Adaptation, Image, Look, Picture};

/// Largest number of threads that turn radiance into colours.
const MOST_THREADS: usize = 4;

/// Runs `work` on threads of its own. The threads that draw are busy for longer than a frame may
/// wait.
pub fn on_screen_threads<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static THREADS: OnceLock<Option<rayon::ThreadPool>> = OnceLock::new();
    let threads = THREADS.get_or_init(|| {
        let count = thread::available_parallelism().map_or(1, NonZero::get).min(MOST_THREADS);
        let name = |number| format!("screen {number}");
        rayon::ThreadPoolBuilder::new().num_threads(count).thread_name(name).build().ok()
    });
    match threads {
        Some(threads) => threads.install(work),
        None => work(),
    }
}

/// One person who looks at a session's frames. An automatic exposure adapts to the frames that this
/// person saw before.
#[derive(Debug, Default)]
pub struct Viewer {
    adaptation: Adaptation,
    /// When the last frame was seen.
    last: Option<Instant>,
}

impl Viewer {
    /// Returns the colours of a frame that is seen at `now`.
    pub fn see(&mut self, picture: &Picture, look: &Look, now: Instant) -> Image {
        let since = self.last.replace(now).map(|last| now.saturating_duration_since(last));
        let seconds = since.unwrap_or_default().as_secs_f32();
        on_screen_threads(|| look.follow(picture, &mut self.adaptation, seconds))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn exposure_follows_the_light_steadily_at_any_frame_rate() {
        let frame = |radiance| Picture::from_pixels(8, 8, vec![[radiance; 3]; 64]).unwrap();
        let (dark, bright, look) = (frame(0.01), frame(1.0), Look::default());
        let start = Instant::now();
        let factor = |viewer: &mut Viewer, picture: &Picture, milliseconds| {
            let now = start + Duration::from_millis(milliseconds);
            viewer.see(picture, &look, now).exposure.unwrap()
        };
        let (mut slow, mut quick) = (Viewer::default(), Viewer::default());
        let first = factor(&mut slow, &dark, 0);
        assert_eq!(factor(&mut quick, &dark, 0), first);
        let next = factor(&mut slow, &bright, 400);
        let at_rest = look.show(&bright).exposure.unwrap();
        assert!(at_rest < 0.5 * next && next < 0.5 * first, "{first} {next} {at_rest}");
        let last = (1..=10).map(|step| factor(&mut quick, &bright, 40 * step)).last().unwrap();
        assert!((last / next - 1.0).abs() < 1e-3, "{last} {next}");
        assert!((factor(&mut slow, &bright, 60_000) / at_rest - 1.0).abs() < 1e-3);
    }
}
